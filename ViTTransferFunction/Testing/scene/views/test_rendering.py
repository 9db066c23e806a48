"""Classes in 3D, seen in the pixels of a 3D view."""

from __future__ import annotations

from collections.abc import Sequence
from colorsys import hsv_to_rgb
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vtkmodules.vtkRenderingCore import vtkCellPicker

from ViTTransferFunction.CommandLine.structure_prop import structure_prop
from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry, transform_points
from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.rendering.composition import own_levels
from ViTTransferFunction.Logic.rendering.intensity_levels import gray_levels
from ViTTransferFunction.Logic.rendering.iso_surfaces import similarity_volume
from ViTTransferFunction.Logic.rendering.mask_volume import mask_volume
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Logic.rendering.surroundings import Surroundings
from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.mrml.transforms import vtk_matrix
from ViTTransferFunction.Logic.scene.views import rendering as rendering_module
from ViTTransferFunction.Logic.scene.views.display import SceneDisplay
from ViTTransferFunction.Logic.scene.views.rendering import ClassRendering
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import image_of, set_image
from ViTTransferFunction.Testing.support.views import Views, ball, look_from, pixel_3d, pixels

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SHAPE = (16, 20, 24)
GRID = Geometry(SHAPE, np.array([[-2.0, 0, 0, 30], [0, 2.0, 0, -10], [0, 0, 2.5, 5], [0, 0, 0, 1]]))
LEFT_KJI, RIGHT_KJI = (7.5, 9.5, 6.0), (7.5, 9.5, 17.0)
LEFT, RIGHT = GRID.ijk_to_ras_points(np.array([LEFT_KJI[::-1], RIGHT_KJI[::-1]]))
MIDDLE = GRID.ijk_to_ras_points(np.array([[11.5, 9.5, 7.5]]))[0]
DISTANCE_MM = 130.0
BESIDE, IN_FRONT = MIDDLE + np.array([500.0, 0.0, 0.0]), MIDDLE + np.array([0.0, 500.0, 0.0])


NOTHING = Surroundings()


def structures(voxels: np.ndarray, count: int, geometry: Geometry) -> StructureVolume:
    return StructureVolume(voxels, own_levels(voxels, count), np.arange(256.0), False, 0.5, geometry)


def show(
    rendering: ClassRendering,
    volume: Any,
    shown: StructureVolume,
    looks: Sequence[Appearance],
    surroundings: Surroundings = NOTHING,
) -> None:
    image, uniforms = image_of(shown.voxels), shown.uniforms(looks, surroundings)
    rendering.show(volume, image, len(looks), uniforms, shown.geometry.ijk_to_ras)


def appearances(colors: Sequence[Color], opacities: Sequence[float] | None = None) -> list[Appearance]:
    return [Appearance(*look) for look in zip(colors, opacities or [1.0] * len(colors), strict=True)]


class Stage:
    """A rendering in the scene, a view that looks at the middle of the grid, and what it shows."""

    def __init__(self, slicer_app: Any, grid: Geometry = GRID, middle: np.ndarray = MIDDLE) -> None:
        self.views = Views(slicer_app, grid.shape, grid.ijk_to_ras)
        self.scene = self.views.scene
        self.view = self.views.view_3d()
        self.rendering = ClassRendering(self.scene, slicer_app.app_logic, lambda: [self.view.render_window()])
        self.grid = grid
        look_from(self.view, middle, DISTANCE_MM)

    def show(self, maps: Sequence[np.ndarray], colors: Sequence[Color], opacities: Sequence[float] | None = None) -> None:
        self.show_structures(maps, appearances(colors, opacities))

    def show_structures(
        self,
        maps: Sequence[np.ndarray],
        looks: Sequence[Appearance],
        surroundings: Surroundings = NOTHING,
        intensities: np.ndarray | None = None,
    ) -> StructureVolume:
        composition = similarity_volume(maps, [0.5] * len(maps))
        gray = None if intensities is None else gray_levels(intensities, np.arange(256.0), composition.shape)
        shown = structures(composition.voxels(gray), len(maps), self.grid.resized(composition.shape))
        show(self.rendering, self.views.volume, shown, looks, surroundings)
        return shown

    def change(self, shown: StructureVolume, looks: Sequence[Appearance], surroundings: Surroundings = NOTHING) -> np.ndarray:
        """What is seen after another look, with the same volume."""
        self.rendering.change(shown.uniforms(looks, surroundings))
        return self.picture()

    def mean(self, picture: np.ndarray, point_ras: np.ndarray) -> np.ndarray:
        """Of the pixels about a point: rays start at random depths."""
        ((row, column),) = self.at(point_ras)
        average: np.ndarray = picture[row - 3 : row + 4, column - 3 : column + 4].mean(axis=(0, 1))
        return average

    def picture(self) -> np.ndarray:
        self.view.renderer().ResetCameraClippingRange()
        return pixels(self.view).astype(int)

    def at(self, *points_ras: np.ndarray) -> list[tuple[int, int]]:
        return [pixel_3d(self.view, ras) for ras in points_ras]


@pytest.fixture
def stage(slicer_app: Any) -> Stage:
    return Stage(slicer_app)


def two_balls() -> list[np.ndarray]:
    return [ball(SHAPE, LEFT_KJI, 4.0), ball(SHAPE, RIGHT_KJI, 4.0)]


def hue(pixel: np.ndarray) -> np.ndarray:
    """Without the highlights, which are white."""
    return (pixel - pixel.min()) / max(np.ptp(pixel), 1)


def test_classes_show_in_their_colours_where_they_are(stage: Stage) -> None:
    stage.show(two_balls(), [RED, GREEN])
    left, right, middle = stage.at(LEFT, RIGHT, MIDDLE)
    shown = stage.picture()
    assert hue(shown[left]) == pytest.approx([1, 0, 0], abs=0.05)
    assert hue(shown[right]) == pytest.approx([0, 1, 0], abs=0.05)
    assert shown[left].max() > 120
    assert (shown[middle] == 0).all()


def test_a_view_that_looks_elsewhere_is_turned_to_the_scan_by_its_first_structures(stage: Stage) -> None:
    look_from(stage.view, BESIDE, DISTANCE_MM)
    stage.show(two_balls(), [RED, GREEN])
    left, right = stage.at(LEFT, RIGHT)
    shown = stage.picture()
    assert hue(shown[left]) == pytest.approx([1, 0, 0], abs=0.05)
    assert hue(shown[right]) == pytest.approx([0, 1, 0], abs=0.05)


def test_a_view_that_looks_away_from_the_scan_is_turned_too(stage: Stage) -> None:
    look_from(stage.view, IN_FRONT, DISTANCE_MM, (0.0, -1.0, 0.0))
    stage.show(two_balls(), [RED, GREEN])
    (left,) = stage.at(LEFT)
    assert hue(stage.picture()[left]) == pytest.approx([1, 0, 0], abs=0.05)


@pytest.mark.parametrize("parallel", [False, True])
def test_a_view_in_which_the_scan_is_a_dot_comes_near_to_it(stage: Stage, parallel: bool) -> None:
    """As Slicer's view, which begins with a picture for bodies, where the scan is of an insect."""
    camera = stage.view.renderer().GetActiveCamera()
    camera.SetParallelProjection(parallel)
    camera.SetParallelScale(2000.0)
    camera.Dolly(1.0 / 30.0)
    left, right = stage.at(LEFT, RIGHT)
    assert abs(left[1] - right[1]) < 3
    stage.show(two_balls(), [RED, GREEN])
    left, right = stage.at(LEFT, RIGHT)
    assert abs(left[1] - right[1]) > 20


def test_a_view_stays_as_the_user_has_it_once_structures_were_in_sight(stage: Stage) -> None:
    camera = stage.view.get_camera_node()
    before = camera.GetPosition()
    stage.show(two_balls(), [RED, GREEN])
    assert camera.GetPosition() == before
    look_from(stage.view, BESIDE, DISTANCE_MM)
    away = camera.GetPosition()
    stage.show(two_balls()[:1], [RED])
    assert camera.GetPosition() == away


def test_a_view_that_comes_with_a_later_layout_is_turned_to_the_scan_and_the_others_stay(slicer_app: Any, stage: Stage) -> None:
    look_from(stage.view, BESIDE, DISTANCE_MM)
    window = stage.view.render_window()
    shown: list[Any] = []
    stage.rendering = ClassRendering(stage.scene, slicer_app.app_logic, lambda: shown)
    stage.show(two_balls(), [RED, GREEN])
    shown.append(window)
    stage.rendering.look_in_new_views()
    (left,) = stage.at(LEFT)
    assert hue(stage.picture()[left]) == pytest.approx([1, 0, 0], abs=0.05)
    look_from(stage.view, BESIDE, DISTANCE_MM)
    away = stage.view.get_camera_node().GetPosition()
    stage.rendering.look_in_new_views()
    assert stage.view.get_camera_node().GetPosition() == away


def test_nothing_of_a_structure_is_cut_off_that_lies_nearer_than_what_was_shown_before(stage: Stage) -> None:
    """As in Slicer, where a scene is opened, or a structure added, and the view is not turned."""
    stage.view.renderer().GetActiveCamera().SetClippingRange(1.0, 2.0)
    stage.show(two_balls(), [RED, GREEN])
    (left,) = stage.at(LEFT)
    assert hue(pixels(stage.view).astype(int)[left]) == pytest.approx([1, 0, 0], abs=0.05)


def test_twelve_classes_show_at_once(slicer_app: Any) -> None:
    grid = Geometry((20, 8, 30), np.diag([2.0, 2.0, 2.0, 1.0]))
    stage = Stage(slicer_app, grid, grid.ijk_to_ras_points(np.array([[14.5, 3.5, 9.5]]))[0])
    centres = [(3.0 + 6.5 * (n // 4), 3.5, 4.0 + 7.0 * (n % 4)) for n in range(12)]
    colors = np.array([hsv_to_rgb(n / 12, 1.0, 0.7) for n in range(12)])
    stage.show([ball(grid.shape, centre, 2.6) for centre in centres], colors.tolist())
    shown = stage.picture()
    for n, centre in enumerate(centres):
        (pixel,) = stage.at(grid.ijk_to_ras_points(np.array([centre[::-1]]))[0])
        difference = np.linalg.norm(hue(shown[pixel]) - colors / 0.7, axis=1)
        assert difference.argmin() == n
        assert difference[n] < 0.15


def test_no_rim_of_a_class_is_of_another_colour(stage: Stage) -> None:
    stage.show(two_balls()[:1], [(1.0, 0.8, 0.6)])
    shown = stage.picture()
    lit = shown[shown.max(axis=2) > 40].astype(float)
    assert len(lit) > 200
    # Ambient and diffuse light keep the colour's proportions, highlights make it whiter.
    assert (lit[:, 1] / lit[:, 0] > 0.75).all()
    assert (lit[:, 2] / lit[:, 0] > 0.53).all()


def test_a_class_of_opacity_zero_is_invisible(stage: Stage) -> None:
    stage.show(two_balls(), [RED, GREEN], [1.0, 0.0])
    shown = stage.picture()
    left, right = stage.at(LEFT, RIGHT)
    assert shown[left].max() > 120
    assert (shown[right] == 0).all()


def test_where_all_classes_are_invisible_the_view_is_as_without_them(stage: Stage) -> None:
    stage.view.set_background_color_from_string("#406080")
    before = stage.picture()
    stage.show(two_balls(), [RED, GREEN], [0.0, 0.0])
    assert np.array_equal(stage.picture(), before)


def test_a_translucent_class_lets_what_it_encloses_shine_through(stage: Stage) -> None:
    centre = (7.5, 9.5, 11.5)
    ((row, column),) = stage.at(MIDDLE)
    inner, outer = ball(SHAPE, centre, 3.0), 0.8 * ball(SHAPE, centre, 7.0)
    contrasts = []
    for opacity in (0.0, 0.3, 0.6, 1.0):
        stage.show([inner, outer], [GREEN, RED], [1.0, opacity])
        # Rays start at random depths: no two are alike.
        red, green, _ = stage.picture()[row - 3 : row + 4, column - 3 : column + 4].mean(axis=(0, 1))
        # Highlights are white: they cancel.
        contrasts.append(green - red)
    # The outer class also shades the inner one.
    assert np.array(contrasts) / contrasts[0] == pytest.approx([1.0, 0.25, -0.35, -1.0], abs=0.2)


def test_a_translucent_class_alone_is_as_strong_as_its_two_walls(stage: Stage) -> None:
    ((row, column),) = stage.at(LEFT)
    brightness = []
    for opacity in (1.0, 0.5, 0.2):
        stage.show(two_balls()[:1], [RED], [opacity])
        brightness.append(stage.picture()[row - 3 : row + 4, column - 3 : column + 4, 0].mean())
    assert np.array(brightness) / brightness[0] == pytest.approx([1.0, 0.75, 0.36], abs=0.15)


def test_a_translucent_class_is_as_strong_whatever_the_size_of_voxels(slicer_app: Any) -> None:
    brightness = []
    for spacing_mm in (0.3, 1.0, 5.0):
        grid = Geometry(SHAPE, np.diag([spacing_mm] * 3 + [1.0]))
        middle = grid.ijk_to_ras_points(np.array([[11.5, 9.5, 7.5]]))[0]
        stage = Stage(slicer_app, grid, middle)
        look_from(stage.view, middle, 60.0 * spacing_mm)
        ((row, column),) = stage.at(middle)
        stage.show([ball(SHAPE, (7.5, 9.5, 11.5), 5.0)], [RED], [0.5])
        brightness.append(stage.picture()[row - 4 : row + 5, column - 4 : column + 5, 0].mean())
    assert np.array(brightness) / brightness[1] == pytest.approx([1.0, 1.0, 1.0], abs=0.05)


def one_ball(radius: float = 6.0) -> np.ndarray:
    return ball(SHAPE, (7.5, 9.5, 11.5), radius)


def test_a_changed_look_is_another_picture_of_the_same_volume(stage: Stage) -> None:
    shown = stage.show_structures(two_balls(), appearances([RED, GREEN]))
    (node,) = nodes_of_class(stage.scene, "vtkMRMLVectorVolumeNode")
    image, changed = node.GetImageData(), node.GetImageData().GetMTime()
    stage.picture()
    picture = stage.change(shown, appearances([BLUE, GREEN], [1.0, 0.0]))
    assert hue(stage.mean(picture, LEFT)) == pytest.approx([0, 0, 1], abs=0.05)
    assert (stage.mean(picture, RIGHT) == 0).all()
    assert node.GetImageData() is image
    assert image.GetMTime() == changed


def test_a_glass_shell_shows_what_it_holds_and_keeps_its_rim(stage: Stage) -> None:
    maps = [ball(SHAPE, (7.5, 9.5, 11.5), 2.5), 0.8 * one_ball(7.0)]
    shown = stage.show_structures(maps, [Appearance(GREEN), Appearance(RED, style="surface")])
    solid = stage.picture()
    glass = stage.change(shown, [Appearance(GREEN), Appearance(RED, 0.8, "glass")])
    red, green, _ = stage.mean(solid, MIDDLE)
    assert red > 3 * green
    red, green, _ = stage.mean(glass, MIDDLE)
    assert green > 3 * red
    # The shell is brightest where it is seen edge-on.
    ((row, column),) = stage.at(MIDDLE)
    profile = glass[row, column:, 0]
    rim = int(profile.argmax())
    assert rim == pytest.approx(np.flatnonzero(solid[row, column:, 0] > 20)[-1], abs=4)
    assert profile[rim] > 2 * profile[rim // 2]


def test_no_pixel_of_a_surface_is_missed(stage: Stage) -> None:
    slab = np.clip(0.5 + (10.0 - np.arange(SHAPE[1], dtype=np.float32)) / 4.0, 0.0, 1.0)[:, None] * np.ones(
        (SHAPE[0], 1, SHAPE[2])
    )
    stage.show([slab.astype(np.float32)], [RED])
    camera = stage.view.get_camera_node()
    camera.SetParallelProjection(True)
    camera.SetParallelScale(12.0)
    assert stage.picture()[..., 0].min() > 100


@pytest.mark.parametrize("style", ["surface", "glass"])
def test_a_known_sphere_is_at_its_place_and_of_its_size(stage: Stage, style: str) -> None:
    stage.show_structures([one_ball(6.0)], [Appearance(RED, 0.9, style)])
    camera = stage.view.get_camera_node()
    camera.SetParallelProjection(True)
    camera.SetParallelScale(30.0)
    shown = stage.picture()[..., 0] > 12
    mm = (np.indices(shown.shape) - (np.array(shown.shape)[:, None, None] - 1) / 2) * 60.0 / shown.shape[0]
    # Voxels are 2 mm wide and 2.5 mm high, and the picture's first row is the lowest.
    expected = (mm[1] / 12.0) ** 2 + (mm[0] / 15.0) ** 2 < 1.0
    assert 2.0 * (shown & expected).sum() / (shown.sum() + expected.sum()) >= 0.97


def test_an_intensity_window_makes_transparent_what_lies_below_it(stage: Stage) -> None:
    intensities = np.where(np.arange(SHAPE[2]) < 12, 60.0, 200.0) * np.ones((*SHAPE[:2], 1))
    look = Appearance(RED, style="as scanned", low=100.0, high=180.0, ramp=0.0)
    stage.show_structures([one_ball(8.0)], [look], intensities=intensities)
    picture = stage.picture()
    dark, bright = (stage.mean(picture, GRID.ijk_to_ras_points(np.array([[i, 9.5, 7.5]]))[0]) for i in (8.0, 15.0))
    assert dark.max() < 10
    assert bright[0] > 60


def test_the_tone_of_a_structure_is_brighter_where_the_scan_is(stage: Stage) -> None:
    intensities = np.where(np.arange(SHAPE[2]) < 12, 60.0, 200.0) * np.ones((*SHAPE[:2], 1))
    stage.show_structures([one_ball(8.0)], [Appearance(RED, low=60.0, high=200.0, tone=0.6)], intensities=intensities)
    picture = stage.picture()
    dark, bright = (stage.mean(picture, GRID.ijk_to_ras_points(np.array([[i, 9.5, 7.5]]))[0])[0] for i in (9.0, 14.0))
    assert dark / bright == pytest.approx(0.4, abs=0.12)


def test_what_is_around_structures_is_seen_as_far_as_it_is_wanted(stage: Stage) -> None:
    bright = ball(SHAPE, RIGHT_KJI, 4.0) > 0.5
    intensities = np.where(bright, 220.0, 20.0)
    around = Surroundings(((100.0, GREEN, 0.0), (200.0, GREEN, 0.9), (255.0, GREEN, 0.9)))
    shown = stage.show_structures(two_balls()[:1], appearances([RED]), intensities=intensities)
    assert (stage.mean(stage.picture(), RIGHT) == 0).all()
    strong = stage.mean(stage.change(shown, appearances([RED]), around), RIGHT)
    faint = stage.mean(stage.change(shown, appearances([RED]), replace(around, strength=0.001)), RIGHT)
    assert hue(strong) == pytest.approx([0, 1, 0], abs=0.1)
    assert strong[1] > 100 > faint[1] > 3


def test_what_belongs_to_a_structure_is_not_shown_as_its_surroundings(stage: Stage) -> None:
    intensities = np.where(one_ball() > 0.5, 220.0, 20.0)
    around = Surroundings(((100.0, GREEN, 0.0), (200.0, GREEN, 0.9), (255.0, GREEN, 0.9)))
    shown = stage.show_structures([one_ball()], appearances([RED]), around, intensities)
    assert hue(stage.mean(stage.picture(), MIDDLE)) == pytest.approx([1, 0, 0], abs=0.1)
    # Nobody's, while its structure is hidden.
    hidden = stage.change(shown, appearances([RED], [0.0]), around)
    assert hue(stage.mean(hidden, MIDDLE)) == pytest.approx([0, 1, 0], abs=0.1)


def test_surroundings_give_way_before_structures_where_that_is_wanted(stage: Stage) -> None:
    # What is in front is anterior, at high j.
    intensities = np.where(np.arange(SHAPE[1])[:, None] > 15, 220.0, 20.0) * np.ones((SHAPE[0], 1, SHAPE[2]))
    around = Surroundings(((100.0, GREEN, 0.0), (200.0, GREEN, 0.9), (255.0, GREEN, 0.9)))
    shown = stage.show_structures([one_ball(4.0)], appearances([RED]), around, intensities)
    assert hue(stage.mean(stage.picture(), MIDDLE)) == pytest.approx([0, 1, 0], abs=0.1)
    cut = stage.change(shown, appearances([RED]), replace(around, cutaway=1.0))
    assert hue(stage.mean(cut, MIDDLE)) == pytest.approx([1, 0, 0], abs=0.1)
    beside = GRID.ijk_to_ras_points(np.array([[3.0, 9.5, 7.5]]))[0]
    assert hue(stage.mean(cut, beside)) == pytest.approx([0, 1, 0], abs=0.1)


def test_a_structure_has_a_smooth_surface_where_the_one_that_touches_it_is_hidden(stage: Stage) -> None:
    left = np.clip(0.5 + (11.5 - np.arange(SHAPE[2], dtype=np.float32)) / 4.0, 0.0, 1.0) * one_ball(8.0)
    right = np.clip(0.5 + (np.arange(SHAPE[2], dtype=np.float32) - 11.5) / 4.0, 0.0, 1.0) * one_ball(8.0)
    shown = stage.show_structures([left, right], appearances([RED, GREEN]))
    look_from(stage.view, MIDDLE, DISTANCE_MM, direction=(1.0, 0.0, 0.0))
    picture = stage.change(shown, appearances([RED, GREEN], [0.0, 1.0]))
    ((row, column),) = stage.at(MIDDLE)
    cut_face = picture[row - 8 : row + 9, column - 8 : column + 9, 1]
    # Flat, and seen at a right angle.
    assert cut_face.min() > 120
    assert np.ptp(cut_face) < 40


def test_a_click_meets_what_lies_behind_a_hidden_structure_and_shown_again_the_structure_itself(
    slicer_app: Any, stage: Stage
) -> None:
    # What is in front is anterior, at high j.
    shown = stage.show_structures(
        [ball(SHAPE, (7.5, 14.0, 11.5), 4.0), ball(SHAPE, (7.5, 5.0, 11.5), 4.0)], appearances([RED, GREEN])
    )
    stage.rendering.remove()
    display = SceneDisplay(stage.scene, slicer_app.app_logic, lambda: [stage.view.render_window()])

    def met_and_seen(opacity: float, rendering: StructureVolume) -> tuple[float, list[float]]:
        display.show_rendering(stage.views.volume, rendering, appearances([RED, GREEN], [opacity, 1.0]), NOTHING, cut=None)
        picture = stage.picture()
        ((row, column),) = stage.at(MIDDLE)
        picker = vtkCellPicker()
        picker.Pick(column, picture.shape[0] - 1 - row, 0.0, stage.view.renderer())
        return picker.GetPickPosition()[1], hue(stage.mean(picture, MIDDLE)).tolist()

    depth_mm = [GRID.ijk_to_ras_points(np.array([[11.5, j, 7.5]]))[0][1] for j in (14.0, 5.0)]
    for opacity, front_mm, color in ((1.0, depth_mm[0], RED), (0.0, depth_mm[1], GREEN), (1.0, depth_mm[0], RED)):
        # As the compute process answers: another volume, in which hidden structures cast no shadows.
        met_mm, seen = met_and_seen(opacity, replace(shown, voxels=shown.voxels.copy()))
        assert met_mm == pytest.approx(front_mm + 8.0, abs=4.0)
        assert seen == pytest.approx(color, abs=0.15)
    hidden = replace(shown, voxels=shown.voxels.copy())
    met_and_seen(0.0, hidden)
    met_mm, seen = met_and_seen(1.0, hidden)
    assert met_mm == pytest.approx(depth_mm[0] + 8.0, abs=4.0)
    assert seen == pytest.approx(RED, abs=0.15)
    display.remove()


def test_a_box_cuts_and_the_cut_is_closed(stage: Stage) -> None:
    stage.show([one_ball(8.0)], [RED])
    box = stage.scene.AddNewNodeByClass("vtkMRMLMarkupsROINode")
    box.CreateDefaultDisplayNodes()
    box.GetDisplayNode().SetVisibility(False)
    left = GRID.ijk_to_ras_points(np.array([[17.0, 9.5, 7.5]]))[0]
    right = GRID.ijk_to_ras_points(np.array([[6.0, 9.5, 7.5]]))[0]
    box.SetXYZ((left - np.array([9.0, 0.0, 0.0])).tolist())
    box.SetRadiusXYZ([20.0, 100.0, 100.0])
    stage.rendering.cut(box)
    cut = stage.picture()
    seen = [stage.mean(cut, point).max() > 40 for point in (left, right)]
    look_from(stage.view, MIDDLE, DISTANCE_MM, direction=(1.0, 0.0, 0.0))
    face = stage.mean(stage.picture(), MIDDLE)
    stage.rendering.cut(None)
    look_from(stage.view, MIDDLE, DISTANCE_MM)
    whole = stage.picture()
    assert seen == [True, False]
    assert hue(face) == pytest.approx([1, 0, 0], abs=0.1)
    assert face.max() > 120
    assert all(stage.mean(whole, point).max() > 40 for point in (left, right))


def test_a_plane_cuts_away_what_lies_before_it_and_moves_with_its_node(stage: Stage) -> None:
    stage.show([one_ball(8.0)], [RED])
    middle = GRID.ijk_to_ras_points(np.array([[11.5, 9.5, 7.5]]))[0]
    plane = stage.scene.AddNewNodeByClass("vtkMRMLMarkupsPlaneNode")
    plane.CreateDefaultDisplayNodes()
    plane.GetDisplayNode().SetVisibility(False)
    plane.SetOrigin(middle.tolist())
    plane.SetNormal([1.0, 0.0, 0.0])
    sides = [middle + np.array([x, 0.0, 0.0]) for x in (-9.0, 9.0)]

    def seen() -> list[bool]:
        picture = stage.picture()
        return [bool(stage.mean(picture, side).max() > 40) for side in sides]

    before = seen()
    stage.rendering.cut(plane)
    cut = seen()
    look_from(stage.view, MIDDLE, DISTANCE_MM, direction=(1.0, 0.0, 0.0))
    face = stage.mean(stage.picture(), MIDDLE)
    look_from(stage.view, MIDDLE, DISTANCE_MM)
    plane.SetNormal([-1.0, 0.0, 0.0])
    turned = seen()
    plane.SetOrigin((middle - np.array([100.0, 0.0, 0.0])).tolist())
    moved = seen()
    stage.rendering.cut(None)
    assert before == [True, True]
    assert cut == [True, False]
    assert hue(face) == pytest.approx([1, 0, 0], abs=0.1)
    assert face.max() > 120
    assert turned == [False, True]
    assert moved == [True, True]
    assert seen() == [True, True]


@pytest.mark.parametrize("technique", ["MaximumIntensityProjection", "MinimumIntensityProjection"])
def test_a_view_that_projects_intensities_of_other_volumes_shows_structures_as_any_view(stage: Stage, technique: str) -> None:
    stage.show(two_balls(), [RED, GREEN])
    expected = stage.picture()
    node = stage.view.get_view_node()
    node.SetRaycastTechnique(getattr(node, technique))
    assert displayed_volume(stage).GetMapper().GetBlendMode() != displayed_volume(stage).GetMapper().COMPOSITE_BLEND
    # Rays start at random depths.
    assert np.abs(stage.picture() - expected).mean() < 1.0


def test_a_slicer_that_cuts_by_no_planes_says_so_and_still_cuts_to_a_box(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rendering_module, "can_be_cut_by_planes", lambda display: False)
    stage.show([one_ball(8.0)], [RED])
    plane, box = (stage.scene.AddNewNodeByClass(f"vtkMRMLMarkups{kind}Node") for kind in ("Plane", "ROI"))
    with pytest.raises(InputError, match="boxes only"):
        stage.rendering.cut(plane)
    stage.rendering.cut(box)
    assert displayed_volume(stage).GetMapper().GetClippingPlanes().GetNumberOfItems() == 6


def displayed_volume(stage: Stage) -> Any:
    """What a view's renderer was given to show the classes."""
    volumes = stage.view.renderer().GetVolumes()
    volumes.InitTraversal()
    return volumes.GetNextVolume()


@pytest.mark.parametrize("spacing_mm", [(2.0, 2.0, 2.0), (0.7, 0.9, 2.5)])
@pytest.mark.parametrize("opacity", [1.0, 0.4])
def test_pictures_of_the_command_line_show_what_the_view_shows(
    slicer_app: Any, spacing_mm: tuple[float, float, float], opacity: float
) -> None:
    grid = Geometry(SHAPE, np.array([[0.8, -0.6, 0, 9], [0.6, 0.8, 0, -20], [0, 0, 1, 5], [0, 0, 0, 1]]) * [*spacing_mm, 1.0])
    middle = grid.ijk_to_ras_points(np.array([[11.5, 9.5, 7.5]]))[0]
    stage = Stage(slicer_app, grid, middle)
    look_from(stage.view, middle, 2.5 * float(grid.extent_mm.max()))
    masks = [ball(SHAPE, centre, 5.0) > 0.5 for centre in (LEFT_KJI, RIGHT_KJI)]
    voxels, fine = mask_volume(grid, masks, [1.0, opacity])
    shown, looks = structures(voxels, 2, fine), appearances([RED, GREEN], [1.0, opacity])
    show(stage.rendering, stage.views.volume, shown, looks)
    in_slicer, theirs = stage.picture(), displayed_volume(stage)
    stage.rendering.hide()
    ours = structure_prop(shown, looks)
    stage.view.renderer().AddVolume(ours)
    in_picture = stage.picture()

    assert in_slicer.max() > 120
    # Rays start at random depths, and their steps differ in length.
    assert np.abs(in_slicer - in_picture).mean() < 2.0
    assert np.percentile(np.abs(in_slicer - in_picture), 98) < 25
    for getter in ("GetAmbient", "GetDiffuse", "GetSpecular", "GetSpecularPower", "GetShade", "GetInterpolationType"):
        assert getattr(ours.GetProperty(), getter)() == getattr(theirs.GetProperty(), getter)()


def test_hiding_brings_back_the_picture_and_the_views_settings(stage: Stage) -> None:
    node = stage.view.get_view_node()
    before = stage.picture()
    stage.show(two_balls(), [RED, GREEN])
    assert node.GetVolumeRenderingSurfaceSmoothing()
    assert (stage.picture() != before).any()
    stage.rendering.hide()
    assert not node.GetVolumeRenderingSurfaceSmoothing()
    assert np.array_equal(stage.picture(), before)


def test_settings_that_the_user_chose_stay(stage: Stage) -> None:
    node = stage.view.get_view_node()
    node.SetVolumeRenderingSurfaceSmoothing(True)
    stage.show(two_balls(), [RED, GREEN])
    stage.rendering.hide()
    assert node.GetVolumeRenderingSurfaceSmoothing()
    node.SetVolumeRenderingSurfaceSmoothing(False)
    stage.show(two_balls(), [RED, GREEN])
    node.SetVolumeRenderingSurfaceSmoothing(False)
    stage.show(two_balls(), [GREEN, RED])
    assert not node.GetVolumeRenderingSurfaceSmoothing()


def test_surfaces_are_smoothed_in_a_view_that_appears_later(stage: Stage) -> None:
    stage.show(two_balls(), [RED, GREEN])
    node = stage.views.view_3d().get_view_node()
    assert node.GetVolumeRenderingSurfaceSmoothing()
    stage.rendering.hide()
    assert not node.GetVolumeRenderingSurfaceSmoothing()
    assert not stage.views.view_3d().get_view_node().GetVolumeRenderingSurfaceSmoothing()


@pytest.mark.parametrize("chosen", [False, True])
def test_a_scene_saved_while_classes_are_shown_opens_with_the_users_own_smoothing(
    slicer_app: Any, stage: Stage, tmp_path: Path, chosen: bool
) -> None:
    node = stage.view.get_view_node()
    node.SetVolumeRenderingSurfaceSmoothing(chosen)
    stage.show(two_balls(), [RED, GREEN])
    assert stage.scene.WriteToMRB(str(tmp_path / "saved.mrb"))
    assert node.GetVolumeRenderingSurfaceSmoothing()
    later = type(slicer_app)()
    assert later.scene.ReadFromMRB(str(tmp_path / "saved.mrb"))
    ClassRendering(later.scene, later.app_logic)
    (opened,) = nodes_of_class(later.scene, "vtkMRMLViewNode")
    assert opened.GetVolumeRenderingSurfaceSmoothing() == chosen
    assert opened.GetAttributeNames() == ()


def test_a_saved_scene_opened_while_classes_are_shown_gets_its_own_smoothing_back(stage: Stage, tmp_path: Path) -> None:
    stage.show(two_balls(), [RED, GREEN])
    assert stage.scene.WriteToMRB(str(tmp_path / "saved.mrb"))
    assert stage.scene.ReadFromMRB(str(tmp_path / "saved.mrb"))
    assert stage.view.get_view_node().GetVolumeRenderingSurfaceSmoothing()
    stage.rendering.hide()
    assert not stage.view.get_view_node().GetVolumeRenderingSurfaceSmoothing()


def test_classes_move_with_the_volume(stage: Stage) -> None:
    matrix = np.array([[0.0, -1.0, 0, 12], [1.0, 0.0, 0, -7], [0, 0, 1, 20], [0, 0, 0, 1]])
    transform = stage.scene.AddNewNodeByClass("vtkMRMLLinearTransformNode")
    transform.SetMatrixTransformToParent(vtk_matrix(matrix))
    stage.views.volume.SetAndObserveTransformNodeID(transform.GetID())
    stage.show(two_balls(), [RED, GREEN])
    left, right, middle = transform_points(matrix, np.stack([LEFT, RIGHT, MIDDLE]))
    look_from(stage.view, middle, DISTANCE_MM, direction=(1.0, 0.0, 0.0))
    shown = stage.picture()
    left_pixel, right_pixel = stage.at(left, right)
    assert hue(shown[left_pixel]) == pytest.approx([1, 0, 0], abs=0.05)
    assert hue(shown[right_pixel]) == pytest.approx([0, 1, 0], abs=0.05)


def test_classes_lie_right_in_an_oblique_anisotropic_volume(slicer_app: Any) -> None:
    ijk_to_ras = np.eye(4)
    ijk_to_ras[:3, :3] = np.array([[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]]) * [1.5, 2.0, 4.0]
    grid = Geometry(SHAPE, ijk_to_ras)
    centres = grid.ijk_to_ras_points(np.array([LEFT_KJI[::-1], RIGHT_KJI[::-1]]))
    stage = Stage(slicer_app, grid, centres.mean(axis=0))
    stage.show(two_balls(), [RED, GREEN])
    look_from(stage.view, centres.mean(axis=0), DISTANCE_MM, direction=(0.0, -1.0, 0.0))
    shown = stage.picture()
    for pixel, color in zip(stage.at(*centres), (RED, GREEN), strict=True):
        assert hue(shown[pixel]) == pytest.approx(color, abs=0.05)


def test_showing_and_removing_again_and_again_leaves_nothing_behind(stage: Stage) -> None:
    before, picture = stage.scene.GetNumberOfNodes(), stage.picture()
    for _ in range(50):
        stage.show(two_balls(), [RED, GREEN])
        stage.rendering.remove()
    assert stage.scene.GetNumberOfNodes() == before
    assert np.array_equal(stage.picture(), picture)


def test_an_update_changes_the_nodes_in_place_and_none_is_saved(stage: Stage) -> None:
    before = {stage.scene.GetNthNode(n).GetID() for n in range(stage.scene.GetNumberOfNodes())}
    stage.show(two_balls(), [RED, GREEN])
    count = stage.scene.GetNumberOfNodes()
    stage.show(two_balls()[:1], [BLUE], [0.5])
    assert stage.scene.GetNumberOfNodes() == count
    (left,) = stage.at(LEFT)
    assert hue(stage.picture()[left]) == pytest.approx([0, 0, 1], abs=0.05)
    added = [stage.scene.GetNthNode(n) for n in range(count) if stage.scene.GetNthNode(n).GetID() not in before]
    assert added
    assert not any(node.GetSaveWithScene() for node in added)


@pytest.mark.parametrize(
    "class_name", ["vtkMRMLVectorVolumeNode", "vtkMRMLVolumePropertyNode", "vtkMRMLGPURayCastVolumeRenderingDisplayNode"]
)
def test_what_the_user_deletes_comes_back_with_the_next_update(stage: Stage, class_name: str) -> None:
    stage.show(two_balls(), [RED, GREEN])
    for node in nodes_of_class(stage.scene, class_name):
        stage.scene.RemoveNode(node)
    stage.show(two_balls(), [RED, GREEN])
    (left,) = stage.at(LEFT)
    assert hue(stage.picture()[left]) == pytest.approx([1, 0, 0], abs=0.05)


@pytest.mark.parametrize("method", ["CPURayCast", "Multi"])
def test_structures_stay_as_they_are_where_the_user_chooses_another_method_of_volume_rendering(
    slicer_app: Any, stage: Stage, method: str
) -> None:
    nothing = stage.picture()
    stage.show([one_ball(8.0)], [RED])
    box = stage.scene.AddNewNodeByClass("vtkMRMLMarkupsROINode")
    stage.rendering.cut(box)
    logic = slicer_app.app_logic.GetModuleLogic("VolumeRendering")
    logic.ChangeVolumeRenderingMethod(f"vtkMRML{method}VolumeRenderingDisplayNode")
    (display,) = nodes_of_class(stage.scene, "vtkMRMLVolumeRenderingDisplayNode")
    assert display.IsA("vtkMRMLGPURayCastVolumeRenderingDisplayNode")
    assert not display.GetSaveWithScene()
    assert display.GetROINode() is box
    assert display.GetCroppingEnabled()
    stage.rendering.cut(None)
    (middle,) = stage.at(MIDDLE)
    assert hue(stage.picture()[middle]) == pytest.approx([1, 0, 0], abs=0.05)
    stage.rendering.hide()
    stage.scene.RemoveNode(box)
    assert np.array_equal(stage.picture(), nothing)


def test_another_method_of_volume_rendering_chosen_while_structures_are_hidden_shows_them_once(
    slicer_app: Any, stage: Stage
) -> None:
    stage.show(two_balls(), [RED, GREEN])
    stage.rendering.hide()
    logic = slicer_app.app_logic.GetModuleLogic("VolumeRendering")
    logic.ChangeVolumeRenderingMethod("vtkMRMLCPURayCastVolumeRenderingDisplayNode")
    stage.show(two_balls(), [RED, GREEN])
    (display,) = nodes_of_class(stage.scene, "vtkMRMLVolumeRenderingDisplayNode")
    assert display.IsA("vtkMRMLGPURayCastVolumeRenderingDisplayNode")


def test_after_the_scene_was_closed_the_next_volume_is_shown_and_removed(stage: Stage) -> None:
    stage.show(two_balls(), [RED, GREEN])
    stage.scene.Clear(False)
    stage.rendering.hide()
    volume = stage.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    set_image(volume, np.zeros(SHAPE, dtype=np.int16), GRID.ijk_to_ras)
    before = stage.scene.GetNumberOfNodes()
    stage.views.volume = volume
    stage.show(two_balls(), [RED, GREEN])
    (display,) = nodes_of_class(stage.scene, "vtkMRMLVolumeRenderingDisplayNode")
    assert display.GetVisibility()
    stage.rendering.remove()
    assert stage.scene.GetNumberOfNodes() == before


def test_the_users_own_volume_rendering_is_left_alone(slicer_app: Any, stage: Stage) -> None:
    theirs = slicer_app.volume_rendering.create_display_node(stage.views.volume)
    points = theirs.GetVolumePropertyNode().GetScalarOpacity().GetSize()
    stage.show(two_balls(), [RED, GREEN])
    stage.rendering.hide()
    stage.rendering.remove()
    assert theirs.GetVisibility()
    assert theirs.GetVolumePropertyNode().GetScalarOpacity().GetSize() == points
    assert stage.views.volume.GetNumberOfDisplayNodes() == 2


def test_a_slicer_without_volume_rendering_is_told_so(stage: Stage) -> None:
    class NoModules:
        def GetModuleLogic(self, name: str) -> None:  # noqa: N802
            return None

    stage.rendering = ClassRendering(stage.scene, NoModules())
    with pytest.raises(InputError, match="Volume Rendering"):
        stage.show(two_balls(), [RED, GREEN])
