"""What each preset is for: for front ends, which offer them before anything that computes is loaded."""

from __future__ import annotations

DEFAULT_PRESET = "balanced"

PRESET_MEANINGS = {
    "preview": "a first look within seconds, at a coarser scale than the others",
    "fast": "about two fifths of the time of balanced, at a slightly coarser scale",
    "balanced": "the one to begin with: detail as fine as the grid's cells",
    "paper": "as in the paper, and many times slower: every slice along all three axes, over the full range of intensities",
}
"""By name, in the order in which they are offered; one sentence for users each."""
