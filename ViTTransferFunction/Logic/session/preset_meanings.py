"""What each preset is for: for front ends, which offer them before anything that computes is loaded."""

from __future__ import annotations

DEFAULT_PRESET = "balanced"

PRESET_MEANINGS = {
    "balanced": "the one to begin with: seconds on an ordinary computer",
    "fine": "8 to 24 times as slow: better for ribs and vertebrae, hardly for anything else",
    "paper": "as in the paper, and many times slower: every slice along all three axes, over the full range of intensities",
}
"""By name, in the order in which they are offered; one sentence for users each."""
