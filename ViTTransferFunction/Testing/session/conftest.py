"""What several tests of sessions use."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.spheres import Spheres
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict


@pytest.fixture
def tiny_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SessionSettings:
    """Settings that name the weights file of a tiny model, and a small grid."""
    monkeypatch.setitem(PRETRAINED_MODELS, "tiny", TINY_MODEL)
    path = tmp_path / "tiny.pth"
    torch.save(random_state_dict(TINY_MODEL), path)
    return SessionSettings(grid=8, model="tiny", weights_path=str(path), device="cpu")


@pytest.fixture
def session(spheres: Spheres) -> SegmentationSession:
    """A session on the spheres whose cached features are the share of each label in a cell."""
    cache_known_features(*spheres)
    session = open_session(spheres[0], SessionSettings(grid=GRID))
    assert session.load_features().cached
    return session
