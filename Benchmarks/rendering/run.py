"""How fast structures are drawn in 3D, and what a changed look costs.

    python dev.py bench rendering [--size N] [--pixels N]

A volume of five balls in noise is shown in one of Slicer's 3D views, without a screen, by whatever OpenGL the computer has:
first by Slicer's own volume rendering through its preset CT-AAA, then as a volume of structures, without and with what is
around them, all in the same run. They stand still, at full sampling, and turn, with fewer samples the longer a picture takes,
as Slicer does while the user turns. A changed look is timed with the picture that shows it, in turns with pictures where only
the camera changed: the difference is what the change itself costs. What it takes to make the volume of structures from
refined maps is timed by itself. Where OpenGL runs in software, figures say little of computers with a graphics card, ratios
more. Writes `rendering.json` and `rendering.md`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import slicer
from trame_slicer.core import SlicerApp
from trame_slicer.views import DirectViewFactory, ViewLayoutDefinition
from trame_slicer.views.render_scheduler import NoScheduleRendering
from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

from Benchmarks.interaction.made_up_volume import centres, phantom
from Benchmarks.shared.arguments import benchmark_parser
from Benchmarks.shared.machine import in_words, machine
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import paragraphs, table
from ViTTransferFunction.Logic.core.colors import default_color
from ViTTransferFunction.Logic.core.stepped_work import finished
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.rendering.intensity_levels import gray_levels, intensity_levels
from ViTTransferFunction.Logic.rendering.iso_surfaces import similarity_volume
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume, structure_volume
from ViTTransferFunction.Logic.rendering.surroundings import Surroundings
from ViTTransferFunction.Logic.scene.rendering import ClassRendering
from ViTTransferFunction.Logic.scene.volume import bytes_image, set_image

WISHED_FRAMES_PER_S = 8.0
"""What Slicer's views ask for while the user turns them."""

PRESET = "CT-AAA"


def main() -> None:
    """Measure, and write what was measured."""
    parser = benchmark_parser(__doc__)
    parser.add_argument("--size", type=int, default=256, help="voxels along each edge of the volume (default 256)")
    parser.add_argument("--pixels", type=int, default=512, help="along each edge of the view (default 512)")
    parser.add_argument("--frames", type=int, default=8, help="pictures that are timed of each kind (default 8)")
    options = parser.parse_args()
    volume = phantom((options.size,) * 3)
    structures, making = made_structures(volume)
    stage = Stage(volume, options.pixels, options.frames)
    drawn = {"Slicer's own, the volume": stage.own_rendering(), **stage.structure_renderings(structures)}
    measured = {
        "machine": machine(),
        "volume": options.size,
        "pixels": options.pixels,
        "making_ms": making,
        "drawn": drawn,
        "changes": stage.changes(structures),
    }
    write_results(options.results, "rendering", {**measured, "summary": summary(measured)}, text(measured))


def made_structures(volume: Volume) -> tuple[StructureVolume, dict[str, float]]:
    """The balls as structures, and how many milliseconds each step took."""
    maps, radius = [], min(volume.shape) / 8
    grid = np.ogrid[tuple(slice(0, count) for count in volume.shape)]
    for centre in centres(volume.shape):
        distance = np.sqrt(sum((axis - c) ** 2 for axis, c in zip(grid, centre, strict=True)))
        maps.append(np.rint(255.0 * np.clip(0.5 + (radius - distance) / 6.0, 0.0, 1.0)).astype(np.uint8))
    composed_ms, composition = _timed(lambda: similarity_volume(maps, [0.5] * len(maps), volume.shape))
    levels = intensity_levels(volume)
    gray_ms, gray = _timed(lambda: gray_levels(volume.array, levels, volume.shape))
    light_ms, voxels = _timed(lambda: composition.voxels(gray))
    structures = structure_volume(voxels, len(maps), levels, volume.geometry, volume)
    return structures, {"structures": composed_ms, "grey levels": gray_ms, "light": light_ms}


class Stage:
    """A 3D view of Slicer's that looks at a volume.

    Args:
        volume: what to show.
        pixels: along each edge of the view.
        frames: pictures to time of each kind.
    """

    def __init__(self, volume: Volume, pixels: int, frames: int) -> None:
        self._app = SlicerApp()
        self._app.view_manager.register_factory(DirectViewFactory(do_render_offscreen=True))
        self._frames = frames
        self._node = self._app.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "volume")
        set_image(self._node, volume.array, volume.geometry.ijk_to_ras)
        self._view = self._app.view_manager.create_view(ViewLayoutDefinition.threed_view(background_color="#000000"))
        self._view.set_scheduled_render(NoScheduleRendering())
        self._view.render_window().SetSize(pixels, pixels)
        self._view.get_view_node().SetVolumeRenderingQuality(slicer.vtkMRMLViewNode.Adaptive)
        self._rendering = ClassRendering(self._app.scene, self._app.app_logic)
        camera = self._view.get_camera_node()
        middle = volume.geometry.ijk_to_ras_points((np.array(volume.shape[::-1])[None] - 1) / 2)[0]
        camera.SetFocalPoint(*middle)
        camera.SetPosition(*(middle + np.array([0.0, 2.2 * float(volume.geometry.extent_mm.max()), 0.0])))
        camera.SetViewUp(0.0, 0.0, 1.0)

    def own_rendering(self) -> dict[str, float]:
        """Slicer's volume rendering of the volume itself."""
        display = self._app.volume_rendering.create_display_node(self._node, PRESET)
        drawn = self._drawn()
        display.SetVisibility(False)
        return drawn

    def structure_renderings(self, structures: StructureVolume) -> dict[str, dict[str, float]]:
        """Structures by themselves, translucent, and with what is around them."""
        looks, around = _looks(structures), _around(structures)
        kinds: dict[str, tuple[list[Appearance], Surroundings]] = {
            "structures": (looks, Surroundings()),
            "structures, glass": ([replace(look, opacity=0.5, style="glass") for look in looks], Surroundings()),
            "structures and surroundings": (looks, around),
        }
        image = finished(bytes_image(structures.voxels))
        drawn = {}
        for name, kind in kinds.items():
            uniforms = structures.uniforms(*kind)
            self._rendering.show(self._node, image, len(looks), uniforms, structures.geometry.ijk_to_ras)
            drawn[name] = self._drawn()
        return drawn

    def changes(self, structures: StructureVolume) -> dict[str, float]:
        """Milliseconds that a picture with a changed look takes longer than one from another side."""
        looks = _looks(structures)
        self._rendering.change(structures.uniforms(looks, Surroundings()))
        self._picture()
        changes: dict[str, Callable[[int], dict[str, Any]]] = {
            "colour": lambda n: {"color": default_color(n)},
            "opacity": lambda n: {"opacity": 1.0 - 0.01 * n},
            "window": lambda n: {"low": 10.0 * n, "tone": 0.5},
            "preset": lambda n: {"style": ("surface", "glass")[n % 2]},
        }
        costs = {}
        for name, change in changes.items():
            differences_ms = []
            for n in range(self._frames):
                changed = [replace(looks[0], **change(n)), *looks[1:]]
                same_ms, _ = _timed(self._turned_picture)
                changed_ms, _ = _timed(lambda: self._changed_picture(structures, changed))  # noqa: B023
                differences_ms.append(changed_ms - same_ms)
            costs[name] = float(np.median(differences_ms))
        return costs

    def _drawn(self) -> dict[str, float]:
        """Milliseconds for the first picture, for one at full sampling, and for one while the view is turned."""
        window = self._view.render_window()
        window.SetDesiredUpdateRate(0.0001)
        first_ms, _ = _timed(self._picture)
        still_ms = np.median([_timed(self._turned_picture)[0] for _ in range(self._frames)])
        window.SetDesiredUpdateRate(WISHED_FRAMES_PER_S)
        # The renderer needs some pictures to find out how many samples it can afford.
        turning_ms = np.median([_timed(self._turned_picture)[0] for _ in range(2 * self._frames)][self._frames :])
        window.SetDesiredUpdateRate(0.0001)
        return {"first_ms": first_ms, "still_ms": float(still_ms), "turning_ms": float(turning_ms)}

    def _changed_picture(self, structures: StructureVolume, looks: list[Appearance]) -> None:
        self._rendering.change(structures.uniforms(looks, Surroundings()))
        self._turned_picture()

    def _turned_picture(self) -> None:
        self._view.renderer().GetActiveCamera().Azimuth(3.0)
        self._picture()

    def _picture(self) -> None:
        """Draw, and wait until it is done: software hands back at once."""
        self._view.renderer().ResetCameraClippingRange()
        self._view.render()
        grabber = vtkWindowToImageFilter()
        grabber.SetInput(self._view.render_window())
        grabber.ReadFrontBufferOff()
        grabber.ShouldRerenderOff()
        grabber.Update()


def _looks(structures: StructureVolume) -> list[Appearance]:
    return [Appearance(default_color(n)) for n in range(len(structures.own_levels))]


def _around(structures: StructureVolume) -> Surroundings:
    """What is brighter than the noise, faintly."""
    low, high = float(structures.levels[200]), float(structures.levels[255])
    return Surroundings(((low, (0.9, 0.8, 0.7), 0.0), (high, (0.9, 0.8, 0.7), 0.1)))


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    began = time.perf_counter()
    result = work()
    return 1e3 * (time.perf_counter() - began), result


def summary(measured: dict[str, Any]) -> dict[str, float]:
    """The figures that are tracked."""
    own, *ours = measured["drawn"].values()
    return {
        "change_ms": max(measured["changes"].values()),
        "making_ms": sum(measured["making_ms"].values()),
        "still_ratio": ours[0]["still_ms"] / own["still_ms"],
        "surroundings_still_ratio": ours[-1]["still_ms"] / own["still_ms"],
        "turning_frames_per_s": 1e3 / max(rendering["turning_ms"] for rendering in ours),
    }


def text(measured: dict[str, Any]) -> str:
    """The report for people."""
    own = next(iter(measured["drawn"].values()))
    return paragraphs(
        "# Rendering",
        f"{in_words(measured['machine'])}.",
        f"{measured['volume']}³ voxels, a view of {measured['pixels']}² pixels, medians. In brackets, times Slicer's own.",
        table(
            ["what", "first picture", "standing still", "turning"],
            [
                [
                    name,
                    *(f"{times[key]:.0f} ms ({times[key] / own[key]:.2f})" for key in ("first_ms", "still_ms", "turning_ms")),
                ]
                for name, times in measured["drawn"].items()
            ],
        ),
        "## A changed look",
        "What it takes longer than a picture where nothing changed but the camera. Nothing is computed anew.",
        table(["what", "time"], [[name, f"{cost:.0f} ms"] for name, cost in measured["changes"].items()]),
        "## A new volume of structures",
        table(["step", "time"], [[name, f"{cost:.0f} ms"] for name, cost in measured["making_ms"].items()]),
    )


if __name__ == "__main__":
    main()
