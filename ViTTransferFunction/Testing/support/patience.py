"""How long tests wait for what happens by itself."""

LONGEST_WAIT_S = 180.0
"""Nothing takes as long, except where other programs have the processors."""
