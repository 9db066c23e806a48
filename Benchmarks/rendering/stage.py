"""One of Slicer's 3D views, without a screen, whose pictures are timed."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import slicer
from skimage.metrics import structural_similarity
from trame_slicer.core import SlicerApp
from trame_slicer.views import DirectViewFactory, ViewLayoutDefinition
from trame_slicer.views.render_scheduler import NoScheduleRendering
from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.scene.views.quick_pictures import REST_S
from ViTTransferFunction.Logic.scene.views.rendering import ClassRendering
from ViTTransferFunction.Logic.scene.views.view_picture import pixels_of

STILL_RATE = 0.0001
"""Pictures a second that VTK is asked for where nothing moves: as few as it likes."""


class Stage:
    """A 3D view that looks at a volume, and is turned a little before each picture.

    Args:
        app: with the scene.
        geometry: of the volume, which fits the view.
        pixels: along each edge of the view.
        frames: pictures to time of each kind.
    """

    def __init__(self, app: SlicerApp, geometry: Geometry, pixels: int, frames: int) -> None:
        app.view_manager.register_factory(DirectViewFactory(do_render_offscreen=True))
        self._frames = frames
        self._view = app.view_manager.create_view(ViewLayoutDefinition.threed_view(background_color="#000000"))
        self._view.set_scheduled_render(NoScheduleRendering())
        # As in Slicer, unless its settings say otherwise, and in the app where OpenGL runs in software.
        self.window.SetMultiSamples(0)
        self.set_pixels(pixels)
        self.set_adaptive(adaptive=True)
        camera = self._view.get_camera_node()
        middle = geometry.ijk_to_ras_points((np.array(geometry.shape[::-1])[None] - 1) / 2)[0]
        camera.SetFocalPoint(*middle)
        camera.SetPosition(*(middle + np.array([0.0, 2.2 * float(geometry.extent_mm.max()), 0.0])))
        camera.SetViewUp(0.0, 0.0, 1.0)
        self.renderer = self._view.renderer()

    @property
    def window(self) -> Any:
        """What the view is drawn in."""
        return self._view.render_window()

    @property
    def opengl(self) -> str:
        """What draws: the name of a graphics card, or of OpenGL in software."""
        self._view.render_window().Render()
        capabilities = self._view.render_window().ReportCapabilities().splitlines()
        return next(line.split(":", 1)[1].strip() for line in capabilities if line.startswith("OpenGL renderer"))

    def set_pixels(self, pixels: int) -> None:
        """Let the view be so many pixels wide and high."""
        self._view.render_window().SetSize(pixels, pixels)

    def set_adaptive(self, *, adaptive: bool) -> None:
        """Let fewer samples be taken while the view is turned (Slicer's quality *Adaptive*), or not (*Normal*)."""
        qualities = slicer.vtkMRMLViewNode
        self._view.get_view_node().SetVolumeRenderingQuality(qualities.Adaptive if adaptive else qualities.Normal)

    def set_turning(self, *, turning: bool) -> None:
        """Let pictures be drawn as Slicer draws them while the user turns the view, or as when nothing moves."""
        rate = self._view.interactor().GetDesiredUpdateRate() if turning else STILL_RATE
        self._view.render_window().SetDesiredUpdateRate(rate)

    def measured(self) -> dict[str, float]:
        """Milliseconds for the first picture, and medians for others: of what stands still, and while it is turned."""
        self.set_turning(turning=False)
        first_ms, _ = timed(self.picture)
        still_ms = self.median_ms()
        self.set_adaptive(adaptive=False)
        self.picture()
        normal_ms = self.median_ms()
        self.set_adaptive(adaptive=True)
        self.set_turning(turning=True)
        # The renderer needs some pictures to find out how many samples it can afford.
        self.median_ms()
        turning_ms = self.median_ms()
        self.set_turning(turning=False)
        return {"first_ms": first_ms, "normal_ms": normal_ms, "still_ms": still_ms, "turning_ms": turning_ms}

    def median_ms(self) -> float:
        """Of pictures from one side after the other."""
        return float(np.median([timed(self.turned_picture)[0] for _ in range(self._frames)]))

    def compared(self, prepare: Callable[[], Any]) -> dict[str, float]:
        """Medians of pictures that something is done before, and of how much longer each takes than the one before it."""
        pictures_ms, differences_ms = [], []
        for _ in range(self._frames):
            without_ms, _ = timed(self.turned_picture)
            with_ms = timed(prepare)[0] + timed(self.turned_picture)[0]
            pictures_ms.append(with_ms)
            differences_ms.append(with_ms - without_ms)
        return {"picture_ms": float(np.median(pictures_ms)), "itself_ms": float(np.median(differences_ms))}

    def full_ms(self, change: Callable[[], Any], rendering: ClassRendering) -> float:
        """Median of pictures that are drawn in full after a change of what `rendering` shows."""
        pictures_ms = []
        for _ in range(self._frames):
            change()
            self.picture()
            pictures_ms.append(timed(lambda: self._rested_picture(rendering))[0] - 1e3 * REST_S)
        return float(np.median(pictures_ms))

    def likeness(self, rendering: ClassRendering) -> tuple[float, float]:
        """How like the picture of a look that is being changed is to the full one, and how many pixels wide its rays are."""
        self.picture()
        mappers = [volume.GetMapper() for volume in self.renderer.GetVolumes() if volume.GetVisibility()]
        edge = max(mapper.GetImageSampleDistance() for mapper in mappers)
        quick = pixels_of(self.window)
        self._rested_picture(rendering)
        return float(structural_similarity(quick, pixels_of(self.window), channel_axis=2)), float(edge)

    def _rested_picture(self, rendering: ClassRendering) -> None:
        time.sleep(REST_S)
        rendering.draw_in_full_at_rest()
        self.picture()

    def turned_picture(self) -> None:
        """Draw from another side than before."""
        self.renderer.GetActiveCamera().Azimuth(3.0)
        self.picture()

    def picture(self) -> None:
        """Draw, and wait until it is done: software hands back at once."""
        self.renderer.ResetCameraClippingRange()
        self._view.render()
        grabber = vtkWindowToImageFilter()
        grabber.SetInput(self._view.render_window())
        grabber.ReadFrontBufferOff()
        grabber.ShouldRerenderOff()
        grabber.Update()


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """How many milliseconds work took, and what came of it."""
    began = time.perf_counter()
    result = work()
    return 1e3 * (time.perf_counter() - began), result
