"""A clinician's desk: a scan, the module's panel, and Slicer's own views of the scan, drawn without a screen."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import slicer
from PySide6.QtGui import QImage
from trame_slicer.core import SlicerApp
from trame_slicer.views import DirectViewFactory, ViewLayoutDefinition
from trame_slicer.views.render_scheduler import NoScheduleRendering

from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.closed_curve import closed_curve_through
from ViTTransferFunction.Logic.scene.annotation_tool import INSIDE_COLOR
from ViTTransferFunction.Logic.scene.tools.drawing_tool import DrawingTool, Shape
from ViTTransferFunction.Testing.support.scenes import add_volume
from ViTTransferFunction.Testing.support.standin.host import PANEL_WIDTH, Host
from ViTTransferFunction.Testing.support.views import look_from, pixels, slice_pixel

MODEL = "dinov2_vits14_focus"
"""The model of the pictures: the one that a computer can have that reaches the Python package index alone."""
ORIENTATIONS = ("axial", "coronal", "sagittal")
_VIEW_ANGLE_DEGREES = 30.0


@dataclass(frozen=True)
class Look:
    """How a scan is looked at.

    Attributes:
        window: intensities from black to white.
        centre_ras: in the middle of the slice views, millimetres.
        width_mm: of what a slice view shows.
        centre_3d_ras: in the middle of the 3D view.
        height_3d_mm: of what the 3D view shows.
        from_ras: direction from which the 3D view looks.
    """

    window: IntensityWindow
    centre_ras: tuple[float, float, float]
    width_mm: float
    centre_3d_ras: tuple[float, float, float]
    height_3d_mm: float
    from_ras: tuple[float, float, float] = (0.0, 1.0, 0.0)


class Desk:
    """A scan, the panel and four views.

    Args:
        volume: the scan.
        look: at it.

    Attributes:
        look: at the scan, from now on.
        session: the panel's session.
        ui: the panel's widgets by their names.
    """

    def __init__(self, volume: Volume, look: Look) -> None:
        app = SlicerApp()
        self.look = look
        node = add_volume(app.scene, volume)
        node.GetDisplayNode().SetAutoWindowLevel(False)
        node.GetDisplayNode().SetWindowLevelMinMax(look.window.low, look.window.high)
        # Before the panel: a slice view takes the scene's slice node of its name only if it finds none.
        self._views = _views(app, node)
        self._host = Host(app)
        widget = self._host.open_panel()
        # The panel's stand-in for Slicer's layout has its own idea of how the views lie.
        for name in ORIENTATIONS:
            self._views[name].get_view_node().SetOrientation(name.capitalize())
        self.ui = widget.ui
        self.session = widget.panel.session
        self.session.parameters.set("model", MODEL)
        self.ui.volumeSelector.setCurrentNode(node)
        self.until(lambda: self.session.estimate is not None)

    def close(self) -> None:
        """Close the scene, and end the application."""
        # Otherwise the panel would keep the points as unsaved, and offer them the next time, also on the app's picture.
        slicer.mrmlScene.Clear(False)
        self._host.close()

    def compute_features(self) -> None:
        """Have the panel compute the features, unless they are in the cache."""
        self.settle()
        if self.session.phase != "ready":
            self.session.start_extraction()
            self.until(lambda: self.session.phase == "ready")

    def add_structure(self, given: AnnotatedClass) -> str:
        """Add a structure without points, and select it; returns its id."""
        id_: str = self.session.annotations.add_class(given.name, given.color).id
        self.session.select_class(id_)
        return id_

    def click(self, id_: str, ras: Sequence[float], positive: bool) -> None:
        """Place a point of a structure."""
        self.session.annotations.add_points(id_, np.array([ras]), positive=positive)

    def drag_diameter(self, id_: str, name: str, width: int, height: int, ends_ras: Sequence[Sequence[float]]) -> np.ndarray:
        """Drag a diameter of a structure across a slice view of this size; returns the view before the button is released."""
        return self._drag("line", partial(self.session.regions.add_diameter, id_), name, width, height, ends_ras)

    def drag_outline(self, id_: str, name: str, width: int, height: int, outline_ras: Sequence[Sequence[float]]) -> np.ndarray:
        """Drag once around a structure in a slice view of this size; returns the view before the button is released.

        The hand goes smoothly through the corners that are given, (N, 3), and back to the first.
        """
        way_ras = closed_curve_through(np.array(outline_ras))
        return self._drag("lasso", partial(self.session.regions.add_outline, id_), name, width, height, way_ras)

    def _drag(
        self,
        shape: Shape,
        on_drawn: Callable[[np.ndarray], None],
        name: str,
        width: int,
        height: int,
        way_ras: Sequence[Sequence[float]] | np.ndarray,
    ) -> np.ndarray:
        self._arrange(name, width, height)
        view = self._views[name]
        tool = DrawingTool(view.interactor(), view.get_view_node(), lambda: None, shape, INSIDE_COLOR, on_drawn, lambda: None)
        tool.activate()
        first, *others = [slice_pixel(view, np.array(place))[::-1] for place in way_ras]
        for event, (x, y) in (("LeftButtonPressEvent", first), *(("MouseMoveEvent", place) for place in others)):
            view.interactor().SetEventInformation(x, y, 0, 0)
            view.interactor().InvokeEvent(event)
        dragged = self.view(name, width, height)
        view.interactor().InvokeEvent("LeftButtonReleaseEvent")
        tool.deactivate()
        return dragged

    def wait_for_overlay(self, id_: str) -> None:
        """Wait for the first answer to a structure's first click, which is coarse."""
        self.until(lambda: self.session.chosen_iso(id_) is not None)

    def annotate(self, classes: Sequence[AnnotatedClass]) -> None:
        """Add structures with all their points, and wait for what is made of them."""
        for given in classes:
            id_ = self.add_structure(given)
            self.session.annotations.add_points(id_, given.request.positive, positive=True)
            self.session.annotations.add_points(id_, given.request.negative, positive=False)
        self.settle()

    def create_segments(self) -> Any:
        """Press *Create segments*, and show them in 3D; returns the segmentation."""
        self.session.segments.write()
        self.settle()
        segmentation = self.session.parameters.segmentation
        segmentation.CreateClosedSurfaceRepresentation()
        return segmentation

    def look_at(self, ras: Sequence[float]) -> None:
        """Bring a point's slices into the slice views."""
        for name in ORIENTATIONS:
            self._views[name].get_view_node().JumpSliceByOffsetting(*ras)

    def settle(self) -> None:
        """Wait until everything is computed and shown."""
        self.until(lambda: not self.session.busy)

    def until(self, finished: Callable[[], bool]) -> None:
        """Let the panel work until something is so. Ends the program where the panel reports an error."""
        while not finished():
            error = self.session.take_error()
            if error:
                raise SystemExit(error)
            self.session.poll()
            slicer.app.processEvents()
            time.sleep(0.01)

    def panel(self, height: int) -> np.ndarray:
        """The panel from its top, (H, W, 3) uint8."""
        self._host.window.resize(PANEL_WIDTH, height)
        slicer.app.processEvents()
        self._host.window.repaint()
        return _window_pixels(self._host.window)[:height]

    def view(self, name: str, width: int, height: int) -> np.ndarray:
        """A view, drawn again, (H, W, 3) uint8."""
        self._arrange(name, width, height)
        return pixels(self._views[name])[::-1]

    def place_in_view(self, name: str, width: int, height: int, ras: Sequence[float]) -> tuple[int, int]:
        """Where a slice view of this size shows a point, (x, y) from its top left corner."""
        self._arrange(name, width, height)
        row, column = slice_pixel(self._views[name], np.array(ras))
        return column, height - 1 - row

    def _arrange(self, name: str, width: int, height: int) -> None:
        view = self._views[name]
        view.render_window().SetSize(width, height)
        if name == "3d":
            distance = self.look.height_3d_mm / 2.0 / np.tan(np.radians(_VIEW_ANGLE_DEGREES / 2.0))
            direction = np.array(self.look.from_ras)
            look_from(view, np.array(self.look.centre_3d_ras), distance, tuple(direction / np.linalg.norm(direction)))
            return
        node = view.get_view_node()
        offset = node.GetSliceOffset()
        node.SetDimensions(width, height, 1)
        node.SetFieldOfView(self.look.width_mm, self.look.width_mm * height / width, 1.0)
        node.JumpSliceByCentering(*self.look.centre_ras)
        node.SetSliceOffset(offset)


def _views(app: Any, node: Any) -> dict[str, Any]:
    """Slicer's four usual views."""
    app.view_manager.register_factory(DirectViewFactory(do_render_offscreen=True))
    layouts = {
        "axial": ViewLayoutDefinition.axial_view(),
        "coronal": ViewLayoutDefinition.coronal_view(),
        "sagittal": ViewLayoutDefinition.sagittal_view(),
        "3d": ViewLayoutDefinition.threed_view(background_color="#000000"),
    }
    views = {name: app.view_manager.create_view(layout) for name, layout in layouts.items()}
    for view in views.values():
        # Rays take seconds without a graphics card: drawn when a picture is taken, not with every change.
        view.set_scheduled_render(NoScheduleRendering())
    for name in ORIENTATIONS:
        views[name].set_background_volume_id(node.GetID())
        views[name].fit_view_to_content()
    return views


def _window_pixels(window: Any) -> np.ndarray:
    image = window.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), dtype=np.uint8).reshape(image.height(), image.bytesPerLine())
    return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).copy()
