"""What several tests of sessions use."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict


@pytest.fixture
def tiny_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SessionSettings:
    """Settings that name the weights file of a tiny model, and a small grid."""
    monkeypatch.setitem(PRETRAINED_MODELS, "tiny", TINY_MODEL)
    path = tmp_path / "tiny.pth"
    torch.save(random_state_dict(TINY_MODEL), path)
    return SessionSettings(grid=8, model="tiny", weights_path=str(path), device="cpu")
