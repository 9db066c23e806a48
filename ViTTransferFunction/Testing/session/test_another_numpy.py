"""PyTorch that was built for another NumPy, as on the Macs that Slicer's packages are for: the same results."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.volumes import torch_arrays
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.spheres import Spheres, requests_of


def segmented(spheres: Spheres, settings: SessionSettings, cache: Path, monkeypatch: pytest.MonkeyPatch) -> list[np.ndarray]:
    """Features that are computed anew, low-resolution maps, and labels."""
    monkeypatch.setenv("VITTF_CACHE", str(cache))
    session = open_session(spheres[0], settings)
    session.load_features()
    requests = requests_of(spheres)
    maps = session.low_resolution_maps(requests)
    segmentation = session.segment(requests)
    return [session.features.array, *(of_class.array for of_class in maps), segmentation.labels]


def test_nothing_is_asked_of_pytorch_that_it_does_not_know(
    spheres: Spheres, tiny_weights: SessionSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = segmented(spheres, tiny_weights, tmp_path / "first", monkeypatch)

    def unknown(*arguments: object, **others: object) -> None:
        raise RuntimeError("Numpy is not available")

    monkeypatch.setattr(torch, "from_numpy", unknown)
    monkeypatch.setattr(torch.Tensor, "numpy", unknown)
    monkeypatch.setattr(torch.Tensor, "__array__", unknown)
    torch_arrays.pytorch_knows_numpy.cache_clear()
    try:
        found = segmented(spheres, tiny_weights, tmp_path / "second", monkeypatch)
    finally:
        torch_arrays.pytorch_knows_numpy.cache_clear()
    assert expected[-1].any()
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)
