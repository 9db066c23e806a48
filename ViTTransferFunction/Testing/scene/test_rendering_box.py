"""The box that 3D renderings are cut to."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.scene.parameters import SceneParameters
from ViTTransferFunction.Logic.scene.rendering_box import shown_box
from ViTTransferFunction.Logic.scene.volume import set_image


def test_the_box_is_made_around_the_volume_when_wanted_and_hidden_when_not(slicer_app: Any) -> None:
    scene = slicer_app.scene
    parameters = SceneParameters(scene.AddNewNodeByClass("vtkMRMLScriptedModuleNode"))
    volume = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    set_image(volume, np.zeros((10, 20, 30), dtype=np.int16), np.diag([1.0, 1.0, 2.0, 1.0]))
    assert shown_box(scene, parameters, volume) is None
    parameters.set("renderingCut", True)
    box: Any = shown_box(scene, parameters, volume)
    bounds = [0.0] * 6
    box.GetRASBounds(bounds)
    displayed = box.GetDisplayNode()
    assert bounds == pytest.approx([-0.5, 29.5, -0.5, 19.5, -1.0, 19.0])
    assert shown_box(scene, parameters, volume) is box
    parameters.set("renderingCut", False)
    assert shown_box(scene, parameters, volume) is None
    assert not displayed.GetVisibility()
    parameters.set("renderingCut", True)
    scene.RemoveNode(box)
    assert shown_box(scene, parameters, volume) is not None
