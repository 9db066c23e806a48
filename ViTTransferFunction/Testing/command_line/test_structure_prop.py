"""Structures in a picture: light, translucency and leaps, in grids of any shape and direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from vtkmodules.vtkRenderingCore import vtkCamera, vtkLight, vtkRenderer

from ViTTransferFunction.CommandLine.offscreen_window import OffscreenWindow
from ViTTransferFunction.CommandLine.structure_prop import structure_prop
from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.rendering.composition import DEPTH, NUMBER, own_levels
from ViTTransferFunction.Logic.rendering.iso_surfaces import similarity_volume
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Logic.rendering.surroundings import Surroundings

PIXELS = 90
DISTANCE_MM = 150.0
GREY: Color = (0.8, 0.8, 0.8)
TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
OBLIQUE = np.array([[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]])
GRIDS = {
    "cubic": ((30, 30, 30), np.diag([2.0, 2.0, 2.0])),
    "mirrored, as from DICOM": ((30, 30, 30), np.diag([-2.0, -2.0, 2.0])),
    "long": ((25, 25, 75), np.diag([2.0, 2.0, 2.0])),
    "turned, thick slices": ((12, 30, 50), TURNED @ np.diag([2.0, 2.0, 5.0])),
    "oblique": ((20, 30, 40), OBLIQUE @ np.diag([2.0, 2.0, 3.0])),
}


def grid(name: str) -> Geometry:
    """About the origin."""
    shape, directions = GRIDS[name]
    ijk_to_ras = np.eye(4)
    ijk_to_ras[:3, :3] = directions
    ijk_to_ras[:3, 3] = -directions @ ((np.array(shape[::-1]) - 1) / 2)
    return Geometry(shape, ijk_to_ras)


def ball(geometry: Geometry, radius_mm: float, centre_ras: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """A map of a ball."""
    kji = np.indices(geometry.shape).reshape(3, -1).T
    distance_mm = np.linalg.norm(geometry.ijk_to_ras_points(kji[:, ::-1]) - centre_ras, axis=1).reshape(geometry.shape)
    softness_mm = 2.0 * float(geometry.spacing_mm.max())
    return np.clip(0.5 + (radius_mm - distance_mm) / softness_mm, 0.0, 1.0).astype(np.float32)


def structures(geometry: Geometry, maps: Sequence[np.ndarray], gray: int = 0) -> StructureVolume:
    composition = similarity_volume(maps, [0.5] * len(maps), geometry.shape)
    voxels = composition.voxels(np.full(geometry.shape, gray, dtype=np.uint8))
    return StructureVolume(voxels, own_levels(voxels, len(maps)), np.arange(256.0), False, 1.0, geometry)


def picture(
    shown: StructureVolume,
    looks: Sequence[Appearance],
    seen_from: Sequence[float] = (0.0, 1.0, 0.0),
    light_from: Sequence[float] | None = None,
    surroundings: Surroundings | None = None,
    lights: bool = True,
) -> np.ndarray:
    """(H, W, 4) float; `light_from` is in the camera's frame, without it there is a headlight, or nothing."""
    renderer = vtkRenderer()
    renderer.AddVolume(structure_prop(shown, looks, surroundings))
    if not lights or light_from is not None:
        renderer.AutomaticLightCreationOff()
    if light_from is not None:
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*light_from)
        renderer.AddLight(light)
    camera = vtkCamera()
    camera.SetPosition(*(DISTANCE_MM * np.array(seen_from)))
    camera.SetViewUp(0.0, 0.0, 1.0)
    camera.SetViewAngle(25.0)
    try:
        window = OffscreenWindow(renderer)
    except InputError as error:
        pytest.skip(str(error))
    with window:
        return window.picture(camera, (PIXELS, PIXELS), transparent=True).astype(float)


def brightest_side(shown: np.ndarray) -> np.ndarray:
    """Where, rightwards and upwards of its middle, what is shown is bright, in its radii."""
    rows, columns = np.nonzero(shown[..., 3] > 128)
    light = shown[rows, columns, 0]
    middle = np.array([columns.mean(), rows.mean()])
    offset = np.average(np.stack([columns, rows], axis=1), axis=0, weights=light) - middle
    return np.array([1.0, -1.0]) * offset / (np.ptp(columns) / 2)


@pytest.mark.parametrize("name", GRIDS)
def test_a_ball_is_bright_where_the_light_is(name: str) -> None:
    geometry = grid(name)
    shown = structures(geometry, [ball(geometry, 20.0)])
    rightwards, upwards = brightest_side(picture(shown, [Appearance(GREY)], light_from=(-1.0, 0.0, 0.6)))
    assert rightwards == pytest.approx(-0.37, abs=0.06)
    assert upwards == pytest.approx(0.0, abs=0.06)
    rightwards, upwards = brightest_side(picture(shown, [Appearance(GREY)]))
    assert [rightwards, upwards] == pytest.approx([0.0, 0.0], abs=0.06)


def test_without_any_light_structures_are_seen_as_by_a_headlight() -> None:
    geometry = grid("cubic")
    shown = structures(geometry, [ball(geometry, 20.0)])
    lit, unlit = picture(shown, [Appearance(GREY)]), picture(shown, [Appearance(GREY)], lights=False)
    assert lit.max() > 100
    assert np.abs(lit - unlit).max() <= 2.0


@pytest.mark.parametrize("name", ["turned, thick slices", "oblique"])
def test_what_is_translucent_is_as_dense_from_every_side(name: str) -> None:
    geometry = grid(name)
    shown = structures(geometry, [ball(geometry, 20.0)], gray=200)
    look = Appearance(GREY, 0.3, "as scanned", low=100.0, high=150.0)
    middle = slice(PIXELS // 2 - 4, PIXELS // 2 + 5)
    opacities = [
        picture(shown, [look], seen_from)[middle, middle, 3].mean()
        for seen_from in ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.1, 0.0, 1.0), (0.6, 0.6, 0.5))
    ]
    assert min(opacities) > 40
    assert max(opacities) < 1.15 * min(opacities)


def test_leaps_of_rays_change_no_picture() -> None:
    geometry = Geometry((60, 60, 60), np.array([[1.0, 0, 0, -29.5], [0, 1, 0, -29.5], [0, 0, 1, -29.5], [0, 0, 0, 1]]))
    balls = [ball(geometry, radius_mm, centre) for radius_mm, centre in ((5.0, (-18.0, 3.0, 4.0)), (2.0, (15.0, -9.0, -12.0)))]
    shown = structures(geometry, balls, gray=100)
    voxels = shown.voxels.copy()
    assert voxels[..., NUMBER].max() > 20
    voxels[voxels[..., DEPTH] == 0, NUMBER] = 0
    stepwise = replace(shown, voxels=voxels)
    for looks in ([Appearance(GREY), Appearance(GREY)], [Appearance(GREY, 0.5, "glass"), Appearance(GREY, 0.4, "X-ray")]):
        leaping, stepping = (picture(each, looks) for each in (shown, stepwise))
        assert leaping.max() > 100
        assert np.abs(leaping - stepping).max() <= 2.0
    # What is around structures is not leapt over.
    around = Surroundings(((50.0, GREY, 0.02), (150.0, GREY, 0.02)))
    assert picture(shown, [Appearance(GREY)] * 2, surroundings=around)[..., 3].min() > 60


def test_forty_structures_have_forty_colours() -> None:
    geometry = Geometry((6, 40, 64), np.array([[1.0, 0, 0, -31.5], [0, 0, 1, -2.5], [0, -1, 0, 19.5], [0, 0, 0, 1]]))
    rng = np.random.default_rng(3)
    colors = rng.uniform(0.2, 1.0, (40, 3))
    centres = [(-28.0 + 8.0 * (n % 8), 0.0, 16.0 - 8.0 * (n // 8)) for n in range(40)]
    shown = structures(geometry, [ball(geometry, 2.5, centre) for centre in centres])
    seen = picture(shown, [Appearance((r, g, b)) for r, g, b in colors.tolist()])[..., :3]
    mm_per_pixel = 2.0 * DISTANCE_MM * np.tan(np.radians(12.5)) / PIXELS
    for centre, color in zip(centres, colors, strict=True):
        # From the front, the patient's right is on the left.
        column, row = (PIXELS / 2 + np.array([-centre[0], -centre[2]]) / mm_per_pixel).astype(int)
        pixel = seen[row, column]
        difference = np.abs(pixel / pixel.max() - colors / colors.max(axis=1, keepdims=True)).max(axis=1)
        assert difference[(colors == color).all(axis=1)] < 0.12
