"""What the documents say of scripts in Slicer is run as it stands there."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.scenes import add_volume, segment_masks
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.standin.host import Host

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

DOCUMENT = Path(__file__).parents[3] / "docs" / "COMMAND_LINE.md"
POINT_RAS = (80.0, 152.0, 400.0)
"""Where the script of the document clicks."""


def script() -> str:
    (code,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    return str(code)


def moved_to(point_ras: tuple[float, float, float], spheres: Spheres) -> Volume:
    """The spheres, where the first has its centre at the point."""
    matrix = spheres[0].geometry.ijk_to_ras.copy()
    matrix[:3, 3] += np.array(point_ras) - centre_ras(spheres, 1)[0]
    return replace(spheres[0], geometry=Geometry(spheres[0].geometry.shape, matrix))


def test_the_script_of_the_document_segments(
    host: Host, spheres: Spheres, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cache_known_features(*spheres)
    saved: list[tuple[Any, str]] = []
    volume = moved_to(POINT_RAS, spheres)
    monkeypatch.setattr(slicer.util, "loadVolume", lambda path: add_volume(slicer.mrmlScene, volume))
    monkeypatch.setattr(slicer.util, "saveNode", lambda node, path: saved.append((node, path)))
    host.representation.reload()
    logic = host.representation.python_widget.logic
    monkeypatch.setattr(slicer.util, "getModuleLogic", {"ViTTransferFunction": logic}.get)
    SceneParameters(logic.getParameterNode()).set("grid", GRID)
    exec(script(), {"slicer": slicer})
    ((segmentation, path),) = saved
    liver, sphere = segment_masks(segmentation, slicer.util.getNode(volume.name))["liver"], spheres[1] == 1
    assert 2 * (liver & sphere).sum() / (liver.sum() + sphere.sum()) > 0.8
    assert (path, capsys.readouterr().out.strip()) == ("/path/to/liver.seg.nrrd", "")


def test_the_script_of_the_document_saves_nothing_where_features_are_not_to_be_had(
    host: Host, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    host.representation.reload()
    logic = host.representation.python_widget.logic
    monkeypatch.setattr(slicer.util, "getModuleLogic", {"ViTTransferFunction": logic}.get)
    monkeypatch.setattr(slicer.util, "loadVolume", lambda path: add_volume(slicer.mrmlScene, spheres[0]))
    SceneParameters(logic.getParameterNode()).set("weightsPath", "nowhere.pt")
    with pytest.raises(RuntimeError, match=r"nowhere\.pt"):
        exec(script(), {"slicer": slicer})
