"""Which points lie on the structure that is shown of the selected class."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry, transform_points
from ViTTransferFunction.Logic.scene.annotation.shown_structures import REACH_OF_STRUCTURE_MM, ShownStructures
from ViTTransferFunction.Logic.scene.classes.class_state import new_class_state
from ViTTransferFunction.Testing.support.corrected import CELLS, MIDDLE, RADIUS_MM, sphere
from ViTTransferFunction.Testing.support.scenes import MOVED, put_under

INSIDE = MIDDLE + np.array([0.0, RADIUS_MM - REACH_OF_STRUCTURE_MM, 0.0])
BESIDE = MIDDLE + np.array([0.0, RADIUS_MM + 0.5 * REACH_OF_STRUCTURE_MM, 0.0])
BEYOND = MIDDLE + np.array([0.0, RADIUS_MM + 3.0 * REACH_OF_STRUCTURE_MM, 0.0])


class Parts:
    """What it is asked of: a class of which a sphere is shown."""

    def __init__(self, volume: Any) -> None:
        state = new_class_state(())
        self.selected: Any = SimpleNamespace(state=state)
        geometry = sphere(CELLS, in_bytes=False).geometry
        self.volume: Any = SimpleNamespace(changed=False, content=SimpleNamespace(geometry=geometry))
        self.parameters: Any = SimpleNamespace(volume=volume)
        self.proxy: Any = SimpleNamespace(maps={state.id: sphere(CELLS, in_bytes=False)})

    def is_on_selected(self, point_ras: np.ndarray) -> bool:
        nobody: Any = None
        shown = ShownStructures(nobody, nobody, self.parameters, nobody, self.selected, self.volume, self.proxy)
        return shown.is_on_selected(point_ras)


@pytest.fixture
def parts(a_volume: Any) -> Parts:
    return Parts(a_volume)


@pytest.mark.parametrize("to_scene", [np.eye(4), MOVED], ids=["in place", "moved"])
def test_one_points_at_a_structure_inside_it_and_right_beside_it(parts: Parts, to_scene: np.ndarray) -> None:
    put_under(parts.parameters.volume, to_scene)
    points = transform_points(to_scene, np.array([MIDDLE, INSIDE, BESIDE, BEYOND]))
    assert [parts.is_on_selected(point) for point in points] == [True, True, True, False]


def test_in_a_small_specimen_one_points_at_a_structure_from_less_far(parts: Parts) -> None:
    parts.volume.content.geometry = Geometry((10, 10, 10), np.diag([0.96, 0.96, 0.96, 1.0]))
    assert [parts.is_on_selected(point) for point in (INSIDE, BESIDE)] == [True, False]


@pytest.mark.parametrize("missing", ["class", "map", "volume", "hidden", "stale"])
def test_what_is_not_shown_is_not_pointed_at(parts: Parts, missing: str) -> None:
    if missing == "class":
        parts.selected.state = None
    elif missing == "map":
        parts.proxy.maps = {}
    elif missing == "volume":
        parts.parameters.volume = None
    elif missing == "hidden":
        parts.selected.state = SimpleNamespace(id=parts.selected.state.id, visible=False)
    else:
        parts.volume.changed = True
    assert not parts.is_on_selected(MIDDLE)
