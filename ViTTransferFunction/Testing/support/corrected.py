"""A structure that is clicked on, drawn and outlined while a sphere is shown of it, and what is made of that."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import slicer

from ViTTransferFunction.Logic.core.classes.class_map import FULL_SCALE, ClassMap
from ViTTransferFunction.Logic.core.classes.diameter_points import points_of_diameter
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.scene.annotation.annotations import SceneAnnotations
from ViTTransferFunction.Logic.scene.annotation.close_up_hints import CloseUpHints
from ViTTransferFunction.Logic.scene.classes.class_requests import ClassRequests, class_requests
from ViTTransferFunction.Logic.scene.classes.class_state import ClassState
from ViTTransferFunction.Logic.scene.interface.message_texts import CloserLookReason
from ViTTransferFunction.Logic.scene.volumes.volume_content import content_of
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.scenes import add_parameter_node

VOXELS = Geometry((60, 60, 60), np.diag([2.0, 2.0, 2.0, 1.0]))
CELLS = VOXELS.resized((24, 24, 24))
"""Of 5 mm."""
MIDDLE, RADIUS_MM = np.array([59.0, 59.0, 59.0]), 20.0
WITHIN, BESIDE = MIDDLE + np.array([10.0, 0.0, 0.0]), MIDDLE + np.array([23.0, 0.0, 0.0])
FAR = MIDDLE + np.array([30.0, 0.0, 0.0])

VAGUE_MM = 40.0
"""Over which the similarity sinks where a border is not clear."""
SMALL_MM, LARGE_MM = 19.0, 21.0
"""Of less and more than four cells."""


def sphere(geometry: Geometry, in_bytes: bool, radius_mm: float = RADIUS_MM, fade_mm: float = 10.0) -> ClassMap:
    """Its map; the similarity sinks from 1 to 0 over `fade_mm`."""
    away = np.linalg.norm(geometry.voxel_centres_ras() - MIDDLE, axis=1).reshape(geometry.shape)
    array = np.clip(0.5 + (radius_mm - away) / fade_mm, 0.0, 1.0).astype(np.float32)
    return ClassMap(np.rint(FULL_SCALE * array).astype(np.uint8) if in_bytes else array, geometry, 0.5)


def circle(radius_mm: float, width: float = 1.0) -> np.ndarray:
    """Around the middle, (60, 3) RAS millimetres; or an ellipse, which is so much as wide as it is long."""
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    return MIDDLE + radius_mm * np.stack([np.cos(angles), width * np.sin(angles), 0.0 * angles], axis=1)


class Corrected:
    """A class of which a sphere is shown whatever is clicked, and what is made of that.

    Attributes:
        annotations: of the class; after each change, the answer is there at once, unless `proxy.up_to_date` says otherwise.
        proxy: has the maps.
        volume: is looked at.
    """

    proxy: Any
    volume: Any

    def __init__(self, scene: Any) -> None:
        self.node = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
        set_image(self.node, np.zeros(VOXELS.shape, dtype=np.int16), VOXELS.ijk_to_ras)
        self.volume = SimpleNamespace(content=SimpleNamespace(geometry=VOXELS), changed=False)
        self.proxy = SimpleNamespace(phase="ready", up_to_date=True, maps={}, low_maps={}, refined=())
        self.annotations = SceneAnnotations(scene, add_parameter_node(scene), lambda: self.hints.note())
        self.hints = self._new_hints()
        self.id = self.annotations.add_class("aorta").id
        self.add(MIDDLE)
        self.show(self.id)

    def _new_hints(self) -> CloseUpHints:
        parameters: Any = SimpleNamespace(volume=self.node)
        maps: Any = self  # Has the requests.
        return CloseUpHints(parameters, self.annotations, self.volume, maps, self.proxy)

    def open_anew(self) -> None:
        """A scene is opened that has the class already."""
        self.hints = self._new_hints()
        self.hints.forget()

    @property
    def state(self) -> ClassState:
        return self.annotations.classes[0]

    def show(self, id_: str, fade_mm: float = 10.0) -> None:
        self.proxy.maps[id_] = sphere(VOXELS, in_bytes=True, fade_mm=fade_mm)
        self.proxy.low_maps[id_] = sphere(CELLS, in_bytes=False, fade_mm=fade_mm)

    def show_vaguely(self) -> None:
        """From now on, the sphere has no clear border."""
        self.show(self.id, VAGUE_MM)

    def add(self, *points_ras: np.ndarray, positive: bool = True, continued: bool = False) -> None:
        self.annotations.add_points(self.id, np.array(points_ras), positive, continued)

    def cut(self, *points_ras: np.ndarray, continued: bool = False) -> None:
        self.add(*points_ras, positive=False, continued=continued)

    def move(self, positive: bool, index: int, to_ras: np.ndarray) -> None:
        """Drag a point."""
        points = self.annotations.points_node(self.id, positive)
        points.SetNthControlPointPositionWorld(index, *to_ras)
        points.InvokeEvent(slicer.vtkMRMLMarkupsNode.PointEndInteractionEvent)

    def draw(self, length_mm: float, middle_ras: np.ndarray = MIDDLE) -> None:
        """Draw a diameter where nothing was shown."""
        half = 0.5 * length_mm * np.array([0.0, 0.6, 0.8])
        self.draw_points(*points_of_diameter(np.stack([middle_ras - half, middle_ras + half]), 1.0))

    def draw_points(self, inside_ras: np.ndarray, outside_ras: np.ndarray) -> None:
        """Draw what stands for these points where nothing was shown."""
        shown, self.proxy.maps = self.proxy.maps, {}
        self.annotations.add_points_of_both(self.id, inside_ras, outside_ras)
        self.proxy.maps = shown

    def begin(self, radius_mm: float, shown_mm: float = RADIUS_MM) -> str:
        """Begin a class with an outline around the middle; then a sphere of `shown_mm` is shown of it. Returns its id."""
        id_ = self.annotations.add_class(f"structure {len(self.annotations.classes)}").id
        self.outline(id_, radius_mm)
        self.proxy.maps[id_] = sphere(VOXELS, in_bytes=True, radius_mm=shown_mm)
        self.proxy.low_maps[id_] = sphere(CELLS, in_bytes=False, radius_mm=shown_mm)
        self.proxy.refined = (True,) * len(self.proxy.maps)
        return id_

    def outline(self, id_: str, radius_mm: float) -> None:
        outline = circle(radius_mm)
        self.annotations.add_points_of_both(id_, *points_of_outline(outline, 1.0))
        self.hints.note_outline(id_, outline)

    def unasked(self) -> list[str]:
        """The classes that are to be looked at closely now; they are at once."""
        ids = list(self.hints.take_unasked())
        for id_ in ids:
            self.annotations.set_close_up(id_, (*MIDDLE.tolist(), 50.0, 50.0, 50.0))
        return ids

    @property
    def requests(self) -> ClassRequests:
        return class_requests(self.annotations.classes, {}, self.node, content_of(self.node))

    def reason(self, state: ClassState | None = None) -> CloserLookReason | None:
        return self.hints.of(state or self.state)
