"""Pictures of the module as a user has it: its panel and the views, drawn without a screen.

    python dev.py screenshots --volume CT.nii.gz --annotations POINTS.json

The panel runs on the stand-in for Slicer's application that the tests use, the views are Slicer's own, arranged as usual.
Writes `module.png`, `module_transfer_function.png` and `module_panel.png`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import slicer
from PySide6.QtGui import QImage
from trame_slicer.core import SlicerApp
from trame_slicer.views import DirectViewFactory, ViewLayoutDefinition

from ViTTransferFunction.CommandLine.canvas import save_png
from ViTTransferFunction.Logic.core.intensity_window import display_window
from ViTTransferFunction.Logic.files.annotation_files import AnnotatedClass, read_annotations
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Testing.support.scenes import add_volume
from ViTTransferFunction.Testing.support.standin.host import PANEL_WIDTH, Host
from ViTTransferFunction.Testing.support.views import pixels

PANEL_HEIGHT = 880
VIEW_SIZE = (440, PANEL_HEIGHT // 2)
GAP = 2
ZOOM = 1.15
"""Of the 3D view, which by itself leaves room for the whole volume."""


def main() -> None:
    """Annotate a volume in the panel, and take the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--volume", type=Path, required=True, help="a CT")
    parser.add_argument("--annotations", type=Path, required=True, help="points in it")
    parser.add_argument("--weights", type=Path, help="weights file; else VITTF_WEIGHTS, the cache, or a download")
    parser.add_argument("--out", type=Path, default=Path("Screenshots"), help="folder for the pictures")
    options = parser.parse_args()
    desk = Desk(SlicerApp(), options.volume)
    desk.compute_features(options.weights)
    desk.annotate(read_annotations(options.annotations, desk.volume.geometry))
    options.out.mkdir(exist_ok=True)
    save_png(desk.picture(), options.out / "module.png")
    desk.session.parameters.set("rendering", "transfer function")
    desk.settle()
    save_png(desk.view("3d", (900, 700)), options.out / "module_transfer_function.png")
    save_png(desk.whole_panel(), options.out / "module_panel.png")
    desk.close()


class Desk:
    """A volume, the panel and four views."""

    def __init__(self, app: Any, path: Path) -> None:
        self.volume = read_volume(path)
        node = add_volume(app.scene, self.volume)
        window = display_window(self.volume)
        node.GetDisplayNode().SetAutoWindowLevel(False)
        node.GetDisplayNode().SetWindowLevelMinMax(window.low, window.high)
        # Before the panel: a slice view takes the scene's slice node of its name only if it finds none.
        self._views = _views(app, node)
        self._host = Host(app)
        self._widget = self._host.open_panel()
        # The panel's stand-in for Slicer's layout has its own idea of how the views lie.
        for name in ("axial", "coronal", "sagittal"):
            self._views[name].get_view_node().SetOrientation(name.capitalize())
        self._widget.ui.volumeSelector.setCurrentNode(node)

    @property
    def session(self) -> Any:
        """The panel's session."""
        return self._widget.panel.session

    def close(self) -> None:
        """End the application."""
        self._host.close()

    def compute_features(self, weights: Path | None) -> None:
        """Have the panel compute the features."""
        if weights:
            self.session.parameters.set("weightsPath", str(weights))
        self._until(lambda: self.session.estimate is not None)
        self.session.start_extraction()
        self._until(lambda: self.session.phase == "ready")

    def annotate(self, classes: list[AnnotatedClass]) -> None:
        """Place all points, and look at the middle of the first structure's."""
        for given in classes:
            state = self.session.annotations.add_class(given.name, given.color)
            self.session.annotations.add_points(state.id, given.request.positive, positive=True)
            self.session.annotations.add_points(state.id, given.request.negative, positive=False)
        self.session.select_class(self.session.classes[0].id)
        place = classes[0].request.positive[0]
        for name in ("axial", "coronal", "sagittal"):
            self._views[name].get_view_node().JumpSliceByCentering(*place)
        self.settle()

    def settle(self) -> None:
        """Wait until everything is computed and shown."""
        self._until(lambda: not self.session.busy)

    def picture(self) -> np.ndarray:
        """The panel, and the four views beside it, (H, W, 3) uint8."""
        upper = _row(self.view("axial", VIEW_SIZE), self.view("3d", VIEW_SIZE))
        lower = _row(self.view("coronal", VIEW_SIZE), self.view("sagittal", VIEW_SIZE))
        views = np.concatenate([upper, np.zeros((GAP, upper.shape[1], 3), np.uint8), lower])
        self._host.window.resize(PANEL_WIDTH, len(views))
        self._host.window.repaint()
        return _row(_pixels(self._host.window)[: len(views)], views)

    def whole_panel(self) -> np.ndarray:
        """The panel with everything unfolded, (H, W, 3) uint8."""
        for name in ("shortcutsCollapsibleButton", "advancedCollapsibleButton"):
            getattr(self._widget.ui, name).collapsed = False
        self._host.window.resize(PANEL_WIDTH, 1400)
        self.settle()
        return _pixels(self._host.window)

    def view(self, name: str, size: tuple[int, int]) -> np.ndarray:
        """A view, drawn again, (H, W, 3) uint8."""
        view = self._views[name]
        view.render_window().SetSize(*size)
        if name == "3d":
            view.reset_camera()
            view.renderer().GetActiveCamera().Zoom(ZOOM)
        else:
            view.fit_view_to_content()
        return pixels(view)[::-1]

    def _until(self, finished: Callable[[], bool]) -> None:
        while not finished():
            error = self.session.take_error()
            if error:
                raise SystemExit(error)
            self.session.poll()
            slicer.app.processEvents()
            time.sleep(0.01)


def _views(app: Any, node: Any) -> dict[str, Any]:
    """Slicer's four usual views."""
    app.view_manager.register_factory(DirectViewFactory(do_render_offscreen=True))
    layouts = {
        "axial": ViewLayoutDefinition.axial_view(),
        "coronal": ViewLayoutDefinition.coronal_view(),
        "sagittal": ViewLayoutDefinition.sagittal_view(),
        "3d": ViewLayoutDefinition.threed_view(),
    }
    views = {name: app.view_manager.create_view(layout) for name, layout in layouts.items()}
    for name, view in views.items():
        view.render_window().SetSize(*VIEW_SIZE)
        if name != "3d":
            view.set_background_volume_id(node.GetID())
            view.fit_view_to_content()
    return views


def _row(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    return np.concatenate([left, np.zeros((len(left), GAP, 3), np.uint8), right], axis=1)


def _pixels(window: Any) -> np.ndarray:
    image = window.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), dtype=np.uint8).reshape(image.height(), image.bytesPerLine())
    return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).copy()


if __name__ == "__main__":
    main()
