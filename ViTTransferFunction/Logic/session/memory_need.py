"""What segmenting a volume takes of memory, so that what cannot fit is refused before it is begun."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..core.system.available_memory import require_memory
from ..core.volumes.volume import Volume

BYTES_PER_REFINED_VOXEL = 6
"""Of the box that a class is refined in: four for its map; the solver's cells, or a mask and intensities while it settles."""
ADVICE = "Close other programs, or crop the volume to the region of interest, or resample it to larger voxels."


def check_memory_for_features(volume: Volume, features_bytes: int, cached: bool) -> None:
    """Raise InputError where memory is not enough for a volume's features and its labels, however small its structures are.

    Args:
        volume: to be segmented.
        features_bytes: size of its features, in float16.
        cached: whether they only have to be loaded; while they are computed, their sums are held in float32.
    """
    labels = math.prod(volume.shape)
    need = features_bytes if cached else 3 * features_bytes
    require_memory(max(need, features_bytes + labels), _what(volume), ADVICE)


def check_memory_for_refinement(volume: Volume, held_voxels: Sequence[int], bytes_per_label: int) -> None:
    """Raise InputError where memory is not enough to refine classes one after the other.

    Args:
        volume: to be segmented.
        held_voxels: of each class, in the box that is held of its map.
        bytes_per_label: of the label map.
    """
    labels = bytes_per_label * math.prod(volume.shape)
    require_memory(labels + BYTES_PER_REFINED_VOXEL * max(held_voxels), _what(volume), ADVICE)


def _what(volume: Volume) -> str:
    size = "×".join(str(count) for count in volume.shape[::-1])
    return f"Segmenting '{volume.name}' ({size} voxels)"
