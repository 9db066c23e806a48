"""Which slices are run along an axis, and what each adds to the layers of the feature volume."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .background_tokens import cell_members


@dataclass(frozen=True)
class SliceSample:
    """One slice to run, and the layers of F that its keys contribute to.

    Attributes:
        position: index along the sliced axis; fractional positions interpolate linearly between neighbours.
        layers: (layer, weight) pairs; over all samples of an axis the weights of each layer sum to 1.
    """

    position: float
    layers: tuple[tuple[int, float], ...]


def slice_samples(slices: int, layers: int, every_slice: bool, layer_step: int = 1) -> list[SliceSample]:
    """Which of an axis' `slices` to run for its `layers`, and how they pool.

    With `every_slice` this is adaptive average pooling: layer l averages slices ⌊l·n/m⌋ to ⌈(l+1)·n/m⌉ − 1. Otherwise one
    slice through the centre of every `layer_step`-th layer, the last one included; layers between are interpolated.
    """
    if every_slice:
        members = cell_members(slices, layers)
        return [
            SliceSample(float(index), tuple((layer, 1.0 / len(m)) for layer, m in enumerate(members) if index in m))
            for index in range(slices)
        ]
    run = _layers_run(layers, layer_step)
    weights = np.stack([np.interp(np.arange(layers), run, np.eye(len(run))[index]) for index in range(len(run))])
    return [
        SliceSample(
            layer_centre(layer, slices, layers), tuple((int(at), float(of_layer[at])) for at in np.flatnonzero(of_layer))
        )
        for layer, of_layer in zip(run, weights, strict=True)
    ]


def slice_count(slices: int, layers: int, every_slice: bool, layer_step: int) -> int:
    """How many `slice_samples` are."""
    return slices if every_slice else len(_layers_run(layers, layer_step))


def _layers_run(layers: int, layer_step: int) -> list[int]:
    return sorted({*range(0, layers, layer_step), layers - 1})


def layer_centre(layer: int, slices: int, layers: int) -> float:
    """Where the centre of a layer lies along an axis of `slices` slices, integers at theirs, of `layers` layers in all."""
    return min(max((layer + 0.5) * slices / layers - 0.5, 0.0), slices - 1.0)


def slice_at(array: np.ndarray, axis: int, position: float) -> np.ndarray:
    """One slice across `axis`, float32, linearly interpolated where the position lies between two."""
    lower = math.floor(position)
    fraction = np.float32(position - lower)
    # Not `take`, which copies a whole mirrored or transposed volume first.
    layers = np.moveaxis(array, axis, 0)
    first: np.ndarray = layers[lower].astype(np.float32)
    if fraction == 0.0:
        return first
    with np.errstate(invalid="ignore"):  # Between infinities of either sign, nothing is a number.
        between: np.ndarray = first * (1 - fraction) + layers[lower + 1].astype(np.float32) * fraction
    return between
