"""How fast structures are drawn in 3D, what a changed look costs, and how long a click takes until it is seen.

    python dev.py bench rendering [--size N] [--pixels N]

A volume of five balls in noise is shown in one of Slicer's 3D views, without a screen, by whatever OpenGL the computer has:
first by Slicer's own volume rendering through its preset CT-AAA, then as a volume of structures, without and with what is
around them, all in the same run. They stand still, with the samples that Slicer's qualities *Normal* and *Adaptive* take, and
turn, with as few samples as *Adaptive* finds necessary for as many pictures a second as Slicer's views ask for. A changed look
is timed with the picture that shows it while it is being changed, in turns with pictures where only the camera changed: the
difference is what the change itself costs; and then with the picture that is drawn in full. Clicks go the whole way, from
the point placed to the picture drawn (`clicks`). What it takes to make the volume of structures from refined maps is timed by
itself. Where OpenGL runs in software, figures say little of computers with a graphics card, ratios more. Writes `rendering.md`
and `rendering.json`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from trame_slicer.core import SlicerApp

from Benchmarks.interaction.made_up_volume import centres, phantom
from Benchmarks.rendering.clicks import CLASSES, measure_clicks
from Benchmarks.rendering.stage import Stage, timed
from Benchmarks.shared.arguments import benchmark_parser
from Benchmarks.shared.cache_of_its_own import cache_of_its_own
from Benchmarks.shared.machine import in_words, machine
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import paragraphs, table
from ViTTransferFunction.Logic.core.classes.colors import default_color
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.rendering.intensity_levels import gray_levels, intensity_levels
from ViTTransferFunction.Logic.rendering.iso_surfaces import similarity_volume
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume, structure_volume
from ViTTransferFunction.Logic.rendering.surroundings import Surroundings
from ViTTransferFunction.Logic.scene.views.quick_pictures import GOAL_S
from ViTTransferFunction.Logic.scene.views.rendering import ClassRendering
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import image_of
from ViTTransferFunction.Testing.support.scenes import add_volume

PRESET = "CT-AAA"


def main() -> None:
    """Measure, and write what was measured."""
    parser = benchmark_parser(__doc__)
    parser.add_argument("--size", type=int, default=256, help="voxels along each edge of the volume (default 256)")
    parser.add_argument("--pixels", type=int, default=512, help="along each edge of the view (default 512)")
    parser.add_argument("--frames", type=int, default=8, help="pictures that are timed of each kind (default 8)")
    parser.add_argument("--clicks", type=int, default=10, help="clicks that are timed (default 10)")
    options = parser.parse_args()
    volume = phantom((options.size,) * 3)
    structures, making = made_structures(volume)
    with cache_of_its_own():
        clicks = measure_clicks(volume, options.pixels, options.clicks)
    app = SlicerApp()
    node = add_volume(app.scene, volume)
    stage = Stage(app, volume.geometry, options.pixels, options.frames)
    measured = {
        "machine": machine(),
        "opengl": stage.opengl,
        "volume": options.size,
        "pixels": options.pixels,
        "making_ms": making,
        "drawn": {"Slicer's own, the volume": measure_own(app, node, stage)},
        "clicks": clicks,
    }
    rendering = ClassRendering(app.scene, app.app_logic, lambda: [stage.window])
    measured["drawn"] |= measure_structures(rendering, node, stage, structures)
    measured["changes"] = measure_changes(rendering, stage, structures)
    write_results(options.results, "rendering", {**measured, "summary": summary(measured)}, text(measured))


def made_structures(volume: Volume) -> tuple[StructureVolume, dict[str, float]]:
    """The balls as structures, and how many milliseconds each step took."""
    maps, radius = [], min(volume.shape) / 8
    grid = np.ogrid[tuple(slice(0, count) for count in volume.shape)]
    for centre in centres(volume.shape):
        distance = np.sqrt(sum((axis - c) ** 2 for axis, c in zip(grid, centre, strict=True)))
        maps.append(np.rint(255.0 * np.clip(0.5 + (radius - distance) / 6.0, 0.0, 1.0)).astype(np.uint8))
    composed_ms, composition = timed(lambda: similarity_volume(maps, [0.5] * len(maps), volume.shape))
    levels = intensity_levels(volume)
    gray_ms, gray = timed(lambda: gray_levels(volume.array, levels, volume.shape))
    light_ms, voxels = timed(lambda: composition.voxels(gray))
    structures = structure_volume(voxels, len(maps), levels, volume.geometry, volume.geometry, hounsfield=False)
    return structures, {"structures": composed_ms, "grey levels": gray_ms, "light": light_ms}


def measure_own(app: SlicerApp, node: Any, stage: Stage) -> dict[str, float]:
    """Slicer's volume rendering of the volume itself."""
    display = app.volume_rendering.create_display_node(node, PRESET)
    measured = stage.measured()
    display.SetVisibility(False)
    return measured


def measure_structures(
    rendering: ClassRendering, node: Any, stage: Stage, structures: StructureVolume
) -> dict[str, dict[str, float]]:
    """Structures by themselves, translucent, and with what is around them."""
    looks, around = _looks(structures), _around(structures)
    kinds: dict[str, tuple[list[Appearance], Surroundings]] = {
        "structures": (looks, Surroundings()),
        "structures, glass": ([replace(look, opacity=0.5, style="glass") for look in looks], Surroundings()),
        "structures and surroundings": (looks, around),
    }
    image = image_of(structures.voxels)
    measured = {}
    for name, kind in kinds.items():
        uniforms = structures.uniforms(*kind)
        rendering.show(node, image, len(looks), uniforms, structures.geometry.ijk_to_ras)
        measured[name] = stage.measured()
    return measured


def measure_changes(rendering: ClassRendering, stage: Stage, structures: StructureVolume) -> dict[str, dict[str, float]]:
    """From a changed look to the picture: while it is being changed, and in full as soon as it rests."""
    looks, around = _looks(structures), _around(structures)
    changes: dict[str, tuple[Callable[[int], dict[str, Any]], Surroundings]] = {
        "colour": (lambda n: {"color": default_color(n)}, Surroundings()),
        "opacity": (lambda n: {"opacity": 1.0 - 0.01 * n}, Surroundings()),
        "window": (lambda n: {"low": 10.0 * n, "tone": 0.5}, Surroundings()),
        "preset": (lambda n: {"style": ("surface", "glass")[n % 2]}, Surroundings()),
        "opacity, with surroundings": (lambda n: {"opacity": 1.0 - 0.01 * n}, around),
    }
    costs = {}
    for name, (change, surroundings) in changes.items():
        step = 0

        def changed(change: Callable[[int], dict[str, Any]] = change, surroundings: Surroundings = surroundings) -> None:
            nonlocal step
            step += 1
            look = replace(looks[0], **change(step))
            rendering.change(structures.uniforms([look, *looks[1:]], surroundings))

        # Twice: the graphics driver compiles shaders when it first needs them.
        for _ in range(2):
            full_ms = stage.full_ms(changed, rendering)
            compared = stage.compared(changed)
        likeness, edge = stage.likeness(rendering)
        costs[name] = {**compared, "edge_pixels": edge, "likeness": likeness, "full_ms": full_ms}
    return costs


def _looks(structures: StructureVolume) -> list[Appearance]:
    return [Appearance(default_color(n)) for n in range(len(structures.own_levels))]


def _around(structures: StructureVolume) -> Surroundings:
    """What is brighter than the noise, faintly."""
    low, high = float(structures.levels[200]), float(structures.levels[255])
    return Surroundings(((low, (0.9, 0.8, 0.7), 0.0), (high, (0.9, 0.8, 0.7), 0.1)))


def summary(measured: dict[str, Any]) -> dict[str, float]:
    """The figures that are tracked."""
    own, *ours = measured["drawn"].values()
    return {
        "change_ms": max(change["itself_ms"] for change in measured["changes"].values()),
        "changed_picture_ms": max(change["picture_ms"] for change in measured["changes"].values()),
        "changed_full_picture_ms": max(change["full_ms"] for change in measured["changes"].values()),
        "likeness": min(change["likeness"] for change in measured["changes"].values()),
        "making_ms": sum(measured["making_ms"].values()),
        "click_to_picture_ms": measured["clicks"]["picture"]["median_ms"],
        "still_ratio": ours[0]["still_ms"] / own["still_ms"],
        "surroundings_still_ratio": ours[-1]["still_ms"] / own["still_ms"],
        "turning_frames_per_s": 1e3 / max(rendering["turning_ms"] for rendering in ours),
    }


def text(measured: dict[str, Any]) -> str:
    """The report for people."""
    own = next(iter(measured["drawn"].values()))
    kinds = ("first_ms", "normal_ms", "still_ms", "turning_ms")
    return paragraphs(
        "# Rendering",
        f"{in_words(measured['machine'])}. OpenGL: {measured['opengl']}.",
        f"{measured['volume']}³ voxels, a view of {measured['pixels']}² pixels, medians. In brackets, times Slicer's own.",
        table(
            ["what", "first picture", "standing still, *Normal*", "standing still, *Adaptive*", "turning, *Adaptive*"],
            [
                [name, *(f"{times[key]:.0f} ms ({times[key] / own[key]:.2f})" for key in kinds)]
                for name, times in measured["drawn"].items()
            ],
        ),
        "## A changed look",
        f"Nothing is computed anew. While a look is being changed, views that would take longer than {1e3 * GOAL_S:.0f} ms are "
        "drawn with fewer rays; as soon as it rests, in full. *Likeness*: structural similarity of the two. *The change "
        "itself*: what it takes longer than a picture where only the camera changed.",
        table(
            ["what", "to the picture", "a ray for", "likeness", "in full", "the change itself"],
            [
                [
                    name,
                    f"{cost['picture_ms']:.0f} ms",
                    f"{cost['edge_pixels']:.0f}² pixels",
                    f"{cost['likeness']:.3f}",
                    f"{cost['full_ms']:.0f} ms",
                    f"{cost['itself_ms']:.0f} ms",
                ]
                for name, cost in measured["changes"].items()
            ],
        ),
        "## A click",
        f"On features that are in the cache, {CLASSES} classes; with the compute process and Slicer's renderer.",
        table(
            ["from the point placed to", "median", "slowest"],
            [[name, f"{ms['median_ms']:.0f} ms", f"{ms['worst_ms']:.0f} ms"] for name, ms in measured["clicks"].items()],
        ),
        "## A volume of structures from refined maps",
        table(["step", "time"], [[name, f"{cost:.0f} ms"] for name, cost in measured["making_ms"].items()]),
    )


if __name__ == "__main__":
    main()
