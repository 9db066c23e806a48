"""Whether what was read as a scan looks like a map of labels: all would run on it, and nothing of it would mean anything."""

from __future__ import annotations

from collections import Counter

import numpy as np

LABEL_INTENT = "1002"
"""NIFTI_INTENT_LABEL, by which a header says that it is one."""
MOST_LABELS = 300
"""Of atlases, there are few with more."""
EVEN_SHARE = 0.6
"""Of neighbours along a row, outside of what there is most of, that are equal: in scans, noise makes it less than half."""
_LOOKED_AT = 32
"""Slices at most: enough to know, and no copy of a volume is made."""


def looks_like_labels(array: np.ndarray) -> bool:
    """Whether voxels (K, J, I) are few whole numbers from 0 up, in even regions."""
    slices = array[:: -(-len(array) // _LOOKED_AT)]
    found: Counter[float] = Counter()
    for each in slices:
        if each.dtype.kind == "f" and not (np.isfinite(each).all() and (each == np.rint(each)).all()):
            return False
        values, counts = np.unique(each, return_counts=True)
        if len(values) > MOST_LABELS or values[0] < 0:
            return False
        found.update(dict(zip(values.tolist(), counts.tolist(), strict=True)))
    if len(found) > MOST_LABELS:
        return False
    ((background, _),) = found.most_common(1)
    equal = pairs = 0
    for each in slices:
        left, right = each[:, :-1], each[:, 1:]
        within = (left != background) & (right != background)
        pairs += int(within.sum())
        equal += int(((left == right) & within).sum())
    return pairs > 0 and equal >= EVEN_SHARE * pairs
