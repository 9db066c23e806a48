"""PyTorch that was built for another NumPy, as on the Macs that Slicer's packages are for: the same results."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core import torch_arrays
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.support.spheres import Spheres, requests_of
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SessionSettings:
    """Of a tiny model, and a cache that keeps nothing from one session to the next."""
    monkeypatch.setitem(PRETRAINED_MODELS, "tiny", TINY_MODEL)
    path = tmp_path / "tiny.pth"
    torch.save(random_state_dict(TINY_MODEL), path)
    return SessionSettings(grid=16, model="tiny", weights_path=str(path), device="cpu")


def segmented(spheres: Spheres, settings: SessionSettings, cache: Path, monkeypatch: pytest.MonkeyPatch) -> list[np.ndarray]:
    """Features, low-resolution maps, a refined map and labels."""
    monkeypatch.setenv("VITTF_CACHE", str(cache))
    session = open_session(spheres[0], settings)
    session.load_features()
    requests = requests_of(spheres)
    maps = session.low_resolution_maps(requests)
    segmentation = session.segment(requests)
    return [session.features.array, *(of_class.array for of_class in maps), segmentation.labels]


def test_nothing_is_asked_of_pytorch_that_it_does_not_know(
    spheres: Spheres, settings: SessionSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = segmented(spheres, settings, tmp_path / "first", monkeypatch)

    def unknown(*arguments: object, **others: object) -> None:
        raise RuntimeError("Numpy is not available")

    monkeypatch.setattr(torch, "from_numpy", unknown)
    monkeypatch.setattr(torch.Tensor, "numpy", unknown)
    monkeypatch.setattr(torch.Tensor, "__array__", unknown)
    torch_arrays.pytorch_knows_numpy.cache_clear()
    try:
        found = segmented(spheres, settings, tmp_path / "second", monkeypatch)
    finally:
        torch_arrays.pytorch_knows_numpy.cache_clear()
    assert expected[-1].any()
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)
