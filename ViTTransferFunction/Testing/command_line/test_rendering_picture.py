"""3D pictures: what is drawn is what is saved, from the front, in any orientation of the voxel grid."""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from ViTTransferFunction.CommandLine import offscreen_window
from ViTTransferFunction.CommandLine.canvas import Canvas, PictureSegment
from ViTTransferFunction.CommandLine.rendering_picture import Rendering, render_3d
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.bounding_box import bounding_box
from ViTTransferFunction.Logic.core.volumes.camera import direction
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.scene.views.view_picture import placed_camera
from ViTTransferFunction.Testing.support.pictures import (
    BLUE,
    CENTRE,
    GREEN,
    RED,
    ball,
    dark_volume,
    distance_mm,
    geometry_about_the_centre,
    landmarks,
    pixels_of,
    place_of,
)

HEIGHT = 240


@pytest.fixture(scope="module")
def opengl() -> None:
    """Skip where nothing can be rendered."""
    geometry = geometry_about_the_centre((50, 50, 50), np.diag([2.0, 2.0, 2.0]))
    try:
        render_3d(dark_volume(geometry), [ball(geometry, "any", RED)], height=16)
    except InputError as error:
        pytest.skip(str(error))


def test_3d_view_is_from_the_front(opengl: None, geometry: Geometry) -> None:
    picture = render_3d(dark_volume(geometry), landmarks(geometry), height=HEIGHT)[:HEIGHT]

    right, front, top = (place_of(picture, color) for color in (RED, GREEN, BLUE))
    assert right[0] < front[0] - 0.1
    assert right[0] < top[0] - 0.1
    assert top[0] == pytest.approx(front[0], abs=0.06)
    assert top[1] < right[1] - 0.1
    # Seen from above, what is in front is lower.
    assert right[1] < front[1]


def test_letters_say_which_side_of_the_patient_is_where(
    opengl: None, aligned: Geometry, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: dict[str, str] = {}

    def label(canvas: Canvas, x: float, y: float, text: str, *_: object, **__: object) -> None:
        from_middle = x / canvas.pixels.shape[1] - 0.5, y / canvas.pixels.shape[0] - 0.5
        along = int(np.argmax(np.abs(from_middle)))
        written[(("left", "right"), ("top", "bottom"))[along][from_middle[along] > 0.0]] = text

    monkeypatch.setattr(Canvas, "label", label)
    with Rendering(dark_volume(aligned), landmarks(aligned)) as rendering:
        for azimuth, elevation, letters in (
            (0.0, 8.0, "RLSI"),  # From the front,
            (90.0, 0.0, "APSI"),  # the patient's left,
            (180.0, 0.0, "LRSI"),  # the back,
            (-90.0, 0.0, "PASI"),  # the right,
            (180.0, 90.0, "LRAP"),  # above,
            (0.0, -90.0, "RLAP"),  # and below.
        ):
            written.clear()
            rendering.labelled_picture(rendering.framing(direction(azimuth, elevation), height=48))
            assert written == dict(zip(("left", "right", "top", "bottom"), letters, strict=True))
        written.clear()
        # Halfway between two sides, neither is named.
        rendering.labelled_picture(rendering.framing(direction(45.0, 0.0), height=48))
        assert written == {"top": "S", "bottom": "I"}


def test_3d_view_shows_more_than_nine_classes(opengl: None, aligned: Geometry) -> None:
    colors = [colorsys.hsv_to_rgb(n / 12, 0.9, 0.9) for n in range(12)]
    segments = [
        ball(aligned, str(n), color, (30 - 20 * (n % 4), 0, 25 - 25 * (n // 4)), radius_mm=8.0)
        for n, color in enumerate(colors)
    ]
    picture = render_3d(dark_volume(aligned), segments, height=HEIGHT)[:HEIGHT]

    places = np.array([place_of(picture, color) for color in colors]).reshape(3, 4, 2)
    assert (np.diff(places[..., 0], axis=1) > 0.1).all()
    assert (np.diff(places[..., 1], axis=0) > 0.1).all()


def test_translucent_class_lets_the_class_inside_show(opengl: None, aligned: Geometry) -> None:
    def visible_inner(outer_opacity: float) -> int:
        outer = ball(aligned, "outer", GREEN, radius_mm=35.0, opacity=outer_opacity)
        inner = ball(aligned, "inner", RED, radius_mm=15.0)
        picture = render_3d(dark_volume(aligned), [outer, inner], height=HEIGHT)[:HEIGHT].astype(int)
        return int((picture[..., 0] > picture[..., 1]).sum())

    assert visible_inner(outer_opacity=0.2) > 500
    assert visible_inner(outer_opacity=1.0) == 0


def test_surface_follows_the_similarity_map_at_iso(opengl: None, aligned: Geometry) -> None:
    volume = dark_volume(aligned)
    distance = distance_mm(aligned)
    similarity = np.exp(-distance / 20.0).astype(np.float32)
    frame = ball(aligned, "frame", BLUE, (0, 0, 45), radius_mm=5.0)

    def area(radius_mm: float) -> int:
        iso = float(np.exp(-radius_mm / 20.0))
        segment = PictureSegment("ball", RED, 1.0, similarity > iso, similarity=similarity, iso=iso)
        return int(pixels_of(render_3d(volume, [segment, frame], height=HEIGHT)[:HEIGHT], RED).sum())

    # Smaller by half a voxel in radius: the surface lies between voxels.
    assert 0.85 < area(19.0) / area(20.0) < 0.97


def test_parts_of_the_similarity_map_outside_the_mask_are_not_shown(opengl: None, aligned: Geometry) -> None:
    left, right = (distance_mm(aligned, (r, 0, 0)) for r in (-30, 30))
    similarity = np.maximum(1 - left / 20.0, 1 - right / 20.0).clip(0)
    kept = PictureSegment("kept", RED, 1.0, right < 10.0, similarity=similarity, iso=0.5)
    frame = ball(aligned, "frame", BLUE, (-30, 0, 30), radius_mm=5.0)
    picture = render_3d(dark_volume(aligned), [kept, frame], height=HEIGHT)[:HEIGHT]

    assert np.nonzero(pixels_of(picture, RED))[1].max() < 0.5 * picture.shape[1]


def test_an_empty_segment_keeps_its_place_in_the_legend(opengl: None, aligned: Geometry) -> None:
    empty = PictureSegment("empty", GREEN, 1.0, np.zeros(aligned.shape, dtype=bool))

    assert pixels_of(render_3d(dark_volume(aligned), [empty], height=HEIGHT), GREEN).sum() > 50


def test_segments_of_opacity_zero_leave_the_picture_empty(opengl: None, aligned: Geometry) -> None:
    picture = render_3d(dark_volume(aligned), [ball(aligned, "clear", RED, opacity=0.0)], height=HEIGHT)[:HEIGHT]

    assert not pixels_of(picture, RED).any()


def test_a_single_voxel_is_visible(opengl: None, geometry: Geometry) -> None:
    mask = np.zeros(geometry.shape, dtype=bool)
    mask[tuple(n // 2 for n in geometry.shape)] = True
    picture = render_3d(dark_volume(geometry), [PictureSegment("voxel", RED, 1.0, mask)], height=HEIGHT)[:HEIGHT]

    assert place_of(picture, RED) == pytest.approx([0.5, 0.5], abs=0.2)


@pytest.mark.parametrize("size", [1.0, 0.1])
def test_bright_surroundings_appear_only_when_asked_for(opengl: None, aligned: Geometry, size: float) -> None:
    bone = distance_mm(aligned, (0, 0, 25)) < 18.0
    # A body, or a small animal.
    scanned = Geometry(aligned.shape, np.diag([size, size, size, 1.0]) @ aligned.ijk_to_ras)
    volume = Volume(np.where(bone, 1000.0, 0.0), scanned)
    segments = [ball(aligned, "organ", RED, (0, 0, -25))]

    alone = render_3d(volume, segments, height=HEIGHT)[:HEIGHT]
    among = render_3d(volume, segments, context_above=250.0, height=HEIGHT)[:HEIGHT]
    assert place_of(alone, RED)[1] == pytest.approx(0.5, abs=0.05)
    assert place_of(among, RED)[1] > 0.6
    # Above the organ there is now more than the background's grey.
    assert (among[40 : HEIGHT // 2].max(axis=2) > 80).sum() > 1000


def test_a_context_is_in_the_picture_and_gives_way_to_segments(opengl: None, aligned: Geometry) -> None:
    array = np.full(aligned.shape, -1000.0)
    array[distance_mm(aligned, (0, 0, -25)) < 12.0] = 40.0
    array[distance_mm(aligned, (0, 0, 25)) < 15.0] = 1000.0
    # Before the organ, seen from the front.
    array[distance_mm(aligned, (0, 25, -25)) < 10.0] = 1000.0
    organ = ball(aligned, "organ", RED, (0, 0, -25))

    def taken(context: str | None) -> np.ndarray:
        with Rendering(Volume(array, aligned), [organ], context=context) as rendering:
            return rendering.picture(rendering.framing(size=(HEIGHT, HEIGHT)))

    assert place_of(taken(None), RED) == pytest.approx([0.5, 0.5], abs=0.05)
    among = taken("bones and vessels")
    assert place_of(among, RED)[1] > 0.6
    assert (among[40 : HEIGHT // 2].max(axis=2) > 80).sum() > 1000


def test_glass_shows_what_it_holds_and_a_surface_does_not(opengl: None, aligned: Geometry) -> None:
    segments = [ball(aligned, "outer", GREEN, radius_mm=35.0, opacity=0.95), ball(aligned, "inner", RED, radius_mm=15.0)]

    def redness(style: str) -> int:
        with Rendering(dark_volume(aligned), segments, style=style) as rendering:
            picture = rendering.picture(rendering.framing(size=(HEIGHT, HEIGHT))).astype(int)
        return int((picture[..., 0] > picture[..., 1] + 20).sum())

    assert redness("surface") == 0
    assert redness("glass") > 500


def _spiked_ellipsoid(geometry: Geometry) -> np.ndarray:
    """An ellipsoid with a thin spike to the patient's right and one upwards, as a mask (K, J, I)."""
    x, y, z = np.moveaxis(geometry.voxel_centres_ras().reshape(*geometry.shape, 3) - CENTRE, -1, 0)
    spacing = geometry.spacing_mm
    right = (x > 0) & (abs(y) < spacing[1]) & (abs(z) < spacing[2])
    up = (z > 0) & (abs(x) < spacing[0]) & (abs(y) < spacing[1])
    return ((x / 24.0) ** 2 + (y / 15.0) ** 2 + (z / 30.0) ** 2 < 1.0) | ((right | up) & (abs(x) < 45.0) & (abs(z) < 45.0))


def _silhouette(geometry: Geometry, mask: np.ndarray, height: int, part: np.ndarray) -> np.ndarray:
    """Which pixels of a 3D picture of the mask the voxels of a part of it cover, as boxes, (height, W) bool."""
    with Rendering(dark_volume(geometry), [PictureSegment("any", RED, 1.0, mask)]) as rendering:
        framed = rendering.framing(height=height)
        camera, width = placed_camera(framed, rendering.middle_ras), framed.size[0]
    steps = (np.arange(6) - 2.5) / 6
    within = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    ijk = (np.argwhere(part)[:, None, ::-1] + within).reshape(-1, 3)
    projection = camera.GetCompositeProjectionTransformMatrix(width / height, -1.0, 1.0)
    matrix = np.array([[projection.GetElement(row, column) for column in range(4)] for row in range(4)])
    clip = np.column_stack([geometry.ijk_to_ras_points(ijk), np.ones(len(ijk))]) @ matrix.T
    x, y = (0.5 + 0.5 * clip[:, :2] / clip[:, 3:]).T * np.array([[width], [height]])
    covered = np.zeros((height, width), dtype=bool)
    covered[height - 1 - y.astype(int), x.astype(int)] = True
    return covered


@pytest.mark.parametrize("spacing_mm", [(2.0, 2.0, 2.0), (-1.0, -1.0, 2.5), (1.2, 3.0, 2.5)], ids=str)
def test_the_picture_shows_all_of_a_mask_and_nothing_else(opengl: None, spacing_mm: tuple[float, float, float]) -> None:
    geometry = geometry_about_the_centre(np.ceil(100.0 / abs(np.array(spacing_mm))).astype(int), np.diag(spacing_mm))
    mask = _spiked_ellipsoid(geometry)
    shown = pixels_of(render_3d(dark_volume(geometry), [PictureSegment("any", RED, 1.0, mask)], height=300)[:300], RED)
    expected = _silhouette(geometry, mask, 300, mask)

    assert 2.0 * (shown & expected).sum() / (shown.sum() + expected.sum()) >= 0.97
    # The spikes are a small part of the whole; they are drawn rounder than the boxes of their voxels.
    x, _, z = np.moveaxis(geometry.voxel_centres_ras().reshape(*geometry.shape, 3) - CENTRE, -1, 0)
    spikes = _silhouette(geometry, mask, 300, mask & (np.maximum(abs(x) / 24.0, abs(z) / 30.0) > 1.1))
    assert (shown & spikes).sum() > 0.7 * spikes.sum()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scan", "label"),
    [("torso_small_labels.nii.gz", 5), ("amos_0336_labels.nii.gz", 6), ("brain_labels.nii.gz", 46)],
    ids=["liver of the torso", "liver of amos_0336", "cerebellum"],
)
def test_the_picture_of_an_organ_agrees_with_its_segment(
    opengl: None, real_volume: Callable[[str], Path], scan: str, label: int
) -> None:
    labels = read_volume(real_volume(scan))
    box = bounding_box(labels.array == label, margin=3)
    assert box is not None
    geometry, mask = labels.geometry.part(box), labels.array[box] == label
    shown = pixels_of(render_3d(dark_volume(geometry), [PictureSegment("any", RED, 1.0, mask)], height=300)[:300], RED)
    expected = _silhouette(geometry, mask, 300, mask & ~binary_erosion(mask))
    assert 2.0 * (shown & expected).sum() / (shown.sum() + expected.sum()) >= 0.97


def test_missing_opengl_is_an_input_error(monkeypatch: pytest.MonkeyPatch, aligned: Geometry) -> None:
    class NoWindow:
        def SetOffScreenRendering(self, _): ...  # noqa: N802
        def SetAlphaBitPlanes(self, _): ...  # noqa: N802
        def Initialize(self): ...  # noqa: N802
        def IsCurrent(self):  # noqa: N802
            return False

    monkeypatch.setattr(offscreen_window, "vtkRenderWindow", NoWindow)
    with pytest.raises(InputError, match="OpenGL"):
        render_3d(dark_volume(aligned), [ball(aligned, "ball", RED)], height=HEIGHT)
