"""In which window views show volumes that Slicer finds none for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.intensity_window import display_window
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import add_parameter_node, add_volume
from ViTTransferFunction.Testing.support.spheres import Spheres


def opened(app: Any, volume: Volume) -> SceneSession:
    session = SceneSession(app.scene, app.app_logic, add_parameter_node(app.scene))
    session.set_volume(add_volume(app.scene, volume))
    return session


@pytest.mark.parametrize("infinite", [[np.inf], [-np.inf], [np.inf, -np.inf, np.nan]])
def test_a_volume_with_infinite_voxels_is_shown_in_the_window_of_the_others(
    slicer_app: Any, spheres: Spheres, infinite: list[float]
) -> None:
    array = spheres[0].array.astype(np.float32)
    array[0, 0, : len(infinite)] = infinite
    volume = Volume(array, spheres[0].geometry)

    session = opened(slicer_app, volume)

    window = display_window(volume)
    assert session.parameters.window == pytest.approx((window.low, window.high))
    assert session.errors == ()
    session.close()


def test_the_window_of_any_other_volume_stays(slicer_app: Any, spheres: Spheres) -> None:
    session = opened(slicer_app, spheres[0])
    assert session.parameters.volume.GetScalarVolumeDisplayNode().GetAutoWindowLevel()
    session.close()


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_a_volume_without_a_finite_voxel_is_refused_once_in_words(slicer_app: Any, spheres: Spheres, value: float) -> None:
    session = opened(slicer_app, spheres[0])
    node = session.parameters.volume
    nothing = Volume(spheres[0].array.astype(np.float32), spheres[0].geometry)
    nothing.array[:] = value
    session.set_volume(add_volume(slicer_app.scene, nothing))
    session.wait()
    assert ["no finite voxel" in message for message in session.errors] == [True]
    session.set_volume(node)
    session.wait()
    assert session.errors == ()
    session.close()
