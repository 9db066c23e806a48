"""How long all structures of a scan take together, from their coarse maps to labels, as a user waits for it."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.sessions import labels_of
from Benchmarks.shared.simulated_clicker import Clicks
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession

REPEATS = 7


def refine_together(session: SegmentationSession, labelled: LabelledVolume, clicks: Clicks) -> dict[str, Any]:
    """Seconds of the session's own refinement of all structures, the answer to the clicks being there already.

    Args:
        session: on the labelled volume, with features.
        labelled: the volume, for the structures' names.
        clicks: of each structure.

    Returns:
        How many structures; median and slowest of so many repeats.
    """
    # Once before: coarse maps are kept from then on, and PyTorch is slower at first.
    labels_of(session, labelled, clicks)
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        labels_of(session, labelled, clicks)
        seconds.append(time.perf_counter() - start)
    median, slowest = float(np.median(seconds)), max(seconds)
    return {"structures": len(clicks), "seconds": round(median, 3), "slowest": round(slowest, 3)}
