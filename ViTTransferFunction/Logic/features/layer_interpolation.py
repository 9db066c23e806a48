"""A volume of vectors interpolated to a finer grid, layer by layer, so that little of it is held at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from ..core.volumes.torch_arrays import array_of, tensor_of
from .line_resizing import resizing_matrix
from .slice_sampling import layer_centre


def interpolated_layers(
    layers: Iterable[np.ndarray], present: tuple[int, int, int], shape: tuple[int, int, int]
) -> Iterator[np.ndarray]:
    """Layers of vectors interpolated trilinearly to another grid that fills the same box.

    Args:
        layers: (C, J, I) float32, as many as `present` says; two of them are held at a time.
        present: shape of their grid.
        shape: of the grid that is wanted.

    Yields:
        (C, J', I') float32.
    """
    import torch

    if present == shape:
        yield from layers
        return
    to_rows, to_columns = (resizing_matrix(present[axis], shape[axis]) for axis in (1, 2))
    remaining = (tensor_of(layer).contiguous() for layer in layers)
    lower = next(remaining)
    upper, number = next(remaining, lower), 0
    for k in range(shape[0]):
        position = layer_centre(k, present[0], shape[0])
        while number < int(position):
            lower, upper, number = upper, next(remaining, upper), number + 1
        between = torch.lerp(lower, upper, position - number)
        yield array_of(to_rows @ (between @ to_columns.T))
