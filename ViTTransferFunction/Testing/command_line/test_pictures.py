"""Slice pictures and 3D pictures: everything in its place, in its colour, in any orientation of the voxel grid."""

import colorsys

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.CommandLine import rendering_picture as volume_rendering_picture
from ViTTransferFunction.CommandLine.canvas import BACKGROUND, PictureSegment, save_png
from ViTTransferFunction.CommandLine.rendering_picture import framing, render_3d
from ViTTransferFunction.CommandLine.slice_picture import PicturePoint, draw_slices
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.rendering.mask_volume import mask_rgba

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
CENTRE = np.array([12.0, -40.0, 300.0])
"""Middle of all test volumes in RAS millimetres; each is about 100 mm wide, deep and high."""
WINDOW = (0.0, 1000.0)
HEIGHT = 240


def _geometry(shape_ijk, matrix) -> Geometry:
    ijk_to_ras = np.eye(4)
    ijk_to_ras[:3, :3] = matrix
    ijk_to_ras[:3, 3] = CENTRE - np.array(matrix) @ ((np.array(shape_ijk) - 1) / 2)
    return Geometry(tuple(shape_ijk[::-1]), ijk_to_ras)


def _oblique_left_handed() -> Geometry:
    turn = np.radians(20.0)
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    tilt = np.array([[1, 0, 0], [0, np.cos(0.2), -np.sin(0.2)], [0, np.sin(0.2), np.cos(0.2)]])
    # Columns: i runs down, j to the right, k to the front.
    axes = np.array([[0, 1, 0], [0, 0, 1], [-1, 0, 0]])
    assert np.linalg.det(axes) < 0
    return _geometry((60, 50, 24), rotation @ tilt @ axes @ np.diag([1.7, 2.0, 4.2]))


GEOMETRIES = {
    "RAS": lambda: _geometry((50, 50, 50), np.diag([2.0, 2.0, 2.0])),
    "LPS": lambda: _geometry((50, 50, 50), np.diag([-2.0, -2.0, 2.0])),
    "thick slices": lambda: _geometry((64, 64, 10), np.diag([-1.6, -1.6, 10.0])),
    "oblique, left-handed, anisotropic": _oblique_left_handed,
}


@pytest.fixture(params=GEOMETRIES)
def geometry(request) -> Geometry:
    return GEOMETRIES[request.param]()


@pytest.fixture
def upright() -> Geometry:
    return GEOMETRIES["RAS"]()


@pytest.fixture(scope="module")
def opengl() -> None:
    """Skip where nothing can be rendered."""
    geometry = GEOMETRIES["RAS"]()
    try:
        render_3d(_dark_volume(geometry), [_ball(geometry, "any", RED)], height=16)
    except InputError as error:
        pytest.skip(str(error))


def _dark_volume(geometry: Geometry) -> Volume:
    array = np.zeros(geometry.shape, dtype=np.int16)
    array[0, 0, 0] = -1
    return Volume(array, geometry)


def _distance_mm(geometry: Geometry, offset_ras=(0, 0, 0)) -> np.ndarray:
    """Distance of every voxel from the volume's middle, or from a place beside it; (K, J, I)."""
    ijk = np.argwhere(np.ones(geometry.shape, dtype=bool))[:, ::-1]
    ras = geometry.ijk_to_ras_points(ijk) - CENTRE - np.array(offset_ras)
    return np.linalg.norm(ras, axis=1).reshape(geometry.shape)


def _ball(geometry, name, color, offset_ras=(0, 0, 0), radius_mm=12.0, opacity=1.0) -> PictureSegment:
    return PictureSegment(name, color, opacity, _distance_mm(geometry, offset_ras) < radius_mm)


def _landmarks(geometry: Geometry) -> list[PictureSegment]:
    """A red ball to the patient's right, a green one in front, a blue one on top."""
    return [
        _ball(geometry, "right", RED, (30, 0, 0)),
        _ball(geometry, "front", GREEN, (0, 30, 0)),
        _ball(geometry, "top", BLUE, (0, 0, 30)),
    ]


def _panels(picture: np.ndarray) -> list[np.ndarray]:
    """The three planes of a slice picture, told by the strips of background between them."""
    background = (picture == np.rint(np.array(BACKGROUND) * 255).astype(np.uint8)).all(axis=2)
    rows = np.flatnonzero(~background.all(axis=1))
    bottom = rows[0] + np.argmax(np.diff(rows) > 1) + 1
    panel_rows = slice(rows[0], bottom)
    columns = np.flatnonzero(~background[panel_rows].all(axis=0))
    return [
        picture[panel_rows, group[0] : group[-1] + 1] for group in np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
    ]


def _pixels_of(picture: np.ndarray, color) -> np.ndarray:
    """(H, W) bool: pixels that clearly have the hue of `color`, bright or dark."""
    rgb = picture.astype(float)
    strength = rgb.max(axis=2) - rgb.min(axis=2)
    difference_degrees = (_hue_degrees(rgb) - _hue_degrees(np.array(color)) + 180.0) % 360.0 - 180.0
    return (strength > 40) & (abs(difference_degrees) < 14.0)


def _hue_degrees(rgb: np.ndarray) -> np.ndarray:
    red, green, blue = np.moveaxis(rgb, -1, 0)
    return np.degrees(np.arctan2(np.sqrt(3.0) * (green - blue), 2 * red - green - blue))


def _place_of(picture: np.ndarray, color) -> np.ndarray:
    """Mean (x, y) of the pixels of a colour, as a share of the picture's size, from the top left."""
    y, x = np.nonzero(_pixels_of(picture, color))
    assert len(x) > 20, f"colour {color} is not in the picture"
    return np.array([x.mean() / picture.shape[1], y.mean() / picture.shape[0]])


def test_axial_plane_has_patient_right_on_the_left_and_anterior_up(geometry):
    axial, _, _ = _panels(draw_slices(_dark_volume(geometry), _landmarks(geometry), window=WINDOW, width=600))

    right, front = _place_of(axial, RED), _place_of(axial, GREEN)
    assert right[0] < 0.4
    assert right[1] == pytest.approx(0.5, abs=0.06)
    assert front[1] < 0.4
    assert front[0] == pytest.approx(0.5, abs=0.06)


def test_coronal_plane_has_patient_right_on_the_left_and_superior_up(geometry):
    _, coronal, _ = _panels(draw_slices(_dark_volume(geometry), _landmarks(geometry), window=WINDOW, width=600))

    right, top = _place_of(coronal, RED), _place_of(coronal, BLUE)
    assert right[0] < 0.4
    assert right[1] == pytest.approx(0.5, abs=0.06)
    assert top[1] < 0.4
    assert top[0] == pytest.approx(0.5, abs=0.06)


def test_sagittal_plane_has_anterior_on_the_left_and_superior_up(geometry):
    _, _, sagittal = _panels(draw_slices(_dark_volume(geometry), _landmarks(geometry), window=WINDOW, width=600))

    front, top = _place_of(sagittal, GREEN), _place_of(sagittal, BLUE)
    assert front[0] < 0.4
    assert front[1] == pytest.approx(0.5, abs=0.06)
    assert top[1] < 0.4
    assert top[0] == pytest.approx(0.5, abs=0.06)


def test_intensities_lie_under_their_segment(geometry):
    array = (_distance_mm(geometry, (0, 0, 30)) < 12.0).astype(np.float32) * 1000.0
    picture = draw_slices(Volume(array, geometry), [_ball(geometry, "middle", RED, radius_mm=3.0)], window=WINDOW, width=600)

    for panel in _panels(picture)[1:]:
        # The letter S at the edge is as white, so look at the ball's own place.
        ball = panel[round(0.12 * panel.shape[0]) : round(0.28 * panel.shape[0]), :, 0] > 200
        assert np.nonzero(ball)[1].mean() / panel.shape[1] == pytest.approx(0.5, abs=0.06)


def test_a_ball_is_round_in_every_plane_of_an_anisotropic_volume(geometry):
    picture = draw_slices(_dark_volume(geometry), [_ball(geometry, "ball", RED, radius_mm=25.0)], window=WINDOW, width=900)

    for panel in _panels(picture):
        rows, columns = (np.flatnonzero(_pixels_of(panel, RED).any(axis=axis)) for axis in (1, 0))
        assert np.ptp(rows) / np.ptp(columns) == pytest.approx(1.0, abs=0.2)


def test_nothing_is_coloured_where_no_segment_is(upright):
    picture = draw_slices(_dark_volume(upright), [_ball(upright, "ball", RED, radius_mm=20.0)], window=WINDOW, width=600)

    for panel in _panels(picture):
        y, x = np.indices(panel.shape[:2]) / panel.shape[0] - 0.5
        coloured = _pixels_of(panel, RED)
        assert coloured[np.hypot(x, y) < 0.17].all()
        assert not coloured[np.hypot(x, y) > 0.23].any()


def test_positive_and_negative_points_differ_by_shape(upright):
    segment = _ball(upright, "ball", RED, radius_mm=40.0)
    volume = _dark_volume(upright)

    def marker(positive: bool) -> np.ndarray:
        points = [PicturePoint(CENTRE, 0, positive)]
        axial = _panels(draw_slices(volume, [segment], window=WINDOW, points=points, width=1200))[0]
        middle = axial.shape[0] // 2
        return axial[middle - 3 : middle + 4, middle - 3 : middle + 4].sum(axis=2) > 100

    assert marker(positive=True).all()
    assert not marker(positive=False)[0].any()
    assert marker(positive=False)[3, 1:6].all()


def test_points_far_from_the_planes_are_not_marked(upright):
    segment = _ball(upright, "ball", RED)
    volume = _dark_volume(upright)
    far = [PicturePoint(CENTRE + 40.0, 0)]

    without = draw_slices(volume, [segment], window=WINDOW, width=600)
    assert np.array_equal(draw_slices(volume, [segment], window=WINDOW, points=far, width=600), without)


def test_slices_without_any_segment_show_the_volume(upright):
    array = np.full(upright.shape, 500.0)
    array[0, 0, 0] = np.nan
    array[0, 0, 1] = 0.0
    panels = _panels(draw_slices(Volume(array, upright), [], window=WINDOW, width=600))

    assert len(panels) == 3
    assert all(abs(int(np.median(panel)) - 128) <= 1 for panel in panels)


def test_empty_segments_keep_their_place_in_the_legend(upright):
    empty = PictureSegment("empty", GREEN, 1.0, np.zeros(upright.shape, dtype=bool))
    volume = _dark_volume(upright)

    for picture in (draw_slices(volume, [empty], window=WINDOW, width=600), render_3d(volume, [empty], height=HEIGHT)):
        assert _pixels_of(picture, GREEN).sum() > 50


def test_legend_of_many_classes_takes_several_rows(upright):
    segments = [PictureSegment(f"a rather long name {n}", RED, 1.0, np.zeros(upright.shape, dtype=bool)) for n in range(20)]
    one = draw_slices(_dark_volume(upright), segments[:1], window=WINDOW, width=600)
    many = draw_slices(_dark_volume(upright), segments, window=WINDOW, width=600)

    assert many.shape[0] > one.shape[0] + 50


def test_3d_view_is_from_the_front(opengl, geometry):
    picture = render_3d(_dark_volume(geometry), _landmarks(geometry), height=HEIGHT)[:HEIGHT]

    right, front, top = (_place_of(picture, color) for color in (RED, GREEN, BLUE))
    assert right[0] < front[0] - 0.1
    assert right[0] < top[0] - 0.1
    assert top[0] == pytest.approx(front[0], abs=0.06)
    assert top[1] < right[1] - 0.1
    # Seen from above, what is in front is lower.
    assert right[1] < front[1]


def test_3d_view_shows_more_than_nine_classes(opengl, upright):
    colors = [colorsys.hsv_to_rgb(n / 12, 0.9, 0.9) for n in range(12)]
    segments = [
        _ball(upright, str(n), color, (30 - 20 * (n % 4), 0, 25 - 25 * (n // 4)), radius_mm=8.0)
        for n, color in enumerate(colors)
    ]
    picture = render_3d(_dark_volume(upright), segments, height=HEIGHT)[:HEIGHT]

    places = np.array([_place_of(picture, color) for color in colors]).reshape(3, 4, 2)
    assert (np.diff(places[..., 0], axis=1) > 0.1).all()
    assert (np.diff(places[..., 1], axis=0) > 0.1).all()


def test_translucent_class_lets_the_class_inside_show(opengl, upright):
    def visible_inner(outer_opacity: float) -> int:
        outer = _ball(upright, "outer", GREEN, radius_mm=35.0, opacity=outer_opacity)
        inner = _ball(upright, "inner", RED, radius_mm=15.0)
        picture = render_3d(_dark_volume(upright), [outer, inner], height=HEIGHT)[:HEIGHT].astype(int)
        return int((picture[..., 0] > picture[..., 1]).sum())

    assert visible_inner(outer_opacity=0.2) > 500
    assert visible_inner(outer_opacity=1.0) == 0


def test_surface_follows_the_similarity_map_at_iso(opengl, upright):
    volume = _dark_volume(upright)
    distance = _distance_mm(upright)
    similarity = np.exp(-distance / 20.0).astype(np.float32)
    frame = _ball(upright, "frame", BLUE, (0, 0, 45), radius_mm=5.0)

    def area(radius_mm: float) -> int:
        iso = float(np.exp(-radius_mm / 20.0))
        segment = PictureSegment("ball", RED, 1.0, similarity > iso, similarity=similarity, iso=iso)
        return int(_pixels_of(render_3d(volume, [segment, frame], height=HEIGHT)[:HEIGHT], RED).sum())

    # Smaller by half a voxel in radius: the surface lies between voxels.
    assert 0.85 < area(19.0) / area(20.0) < 0.97


def test_parts_of_the_similarity_map_outside_the_mask_are_not_shown(opengl, upright):
    left, right = (_distance_mm(upright, (r, 0, 0)) for r in (-30, 30))
    similarity = np.maximum(1 - left / 20.0, 1 - right / 20.0).clip(0)
    kept = PictureSegment("kept", RED, 1.0, right < 10.0, similarity=similarity, iso=0.5)
    frame = _ball(upright, "frame", BLUE, (-30, 0, 30), radius_mm=5.0)
    picture = render_3d(_dark_volume(upright), [kept, frame], height=HEIGHT)[:HEIGHT]

    assert np.nonzero(_pixels_of(picture, RED))[1].max() < 0.5 * picture.shape[1]


def test_segments_of_opacity_zero_leave_the_picture_empty(opengl, upright):
    picture = render_3d(_dark_volume(upright), [_ball(upright, "clear", RED, opacity=0.0)], height=HEIGHT)[:HEIGHT]

    assert not _pixels_of(picture, RED).any()


def test_a_single_voxel_is_visible(opengl, geometry):
    mask = np.zeros(geometry.shape, dtype=bool)
    mask[tuple(n // 2 for n in geometry.shape)] = True
    picture = render_3d(_dark_volume(geometry), [PictureSegment("voxel", RED, 1.0, mask)], height=HEIGHT)[:HEIGHT]

    assert _place_of(picture, RED) == pytest.approx([0.5, 0.5], abs=0.2)


def test_bright_surroundings_appear_only_when_asked_for(opengl, upright):
    bone = _distance_mm(upright, (0, 0, 25)) < 15.0
    volume = Volume(np.where(bone, 1000.0, 0.0), upright)
    segments = [_ball(upright, "organ", RED, (0, 0, -25))]

    alone = render_3d(volume, segments, height=HEIGHT)[:HEIGHT]
    among = render_3d(volume, segments, context_above=250.0, height=HEIGHT)[:HEIGHT]
    assert _place_of(alone, RED)[1] == pytest.approx(0.5, abs=0.05)
    assert _place_of(among, RED)[1] > 0.6
    # Above the organ there is now more than the background's grey.
    assert (among[40 : HEIGHT // 2].max(axis=2) > 80).sum() > 1000


def _spiked_ellipsoid(geometry: Geometry) -> np.ndarray:
    """An ellipsoid with a thin spike to the patient's right and one upwards, as a mask (K, J, I)."""
    x, y, z = np.moveaxis(geometry.voxel_centres_ras().reshape(*geometry.shape, 3) - CENTRE, -1, 0)
    spacing = geometry.spacing_mm
    right = (x > 0) & (abs(y) < spacing[1]) & (abs(z) < spacing[2])
    up = (z > 0) & (abs(x) < spacing[0]) & (abs(y) < spacing[1])
    return ((x / 24.0) ** 2 + (y / 15.0) ** 2 + (z / 30.0) ** 2 < 1.0) | ((right | up) & (abs(x) < 45.0) & (abs(z) < 45.0))


def _silhouette(geometry: Geometry, mask: np.ndarray, height: int, part: np.ndarray) -> np.ndarray:
    """Which pixels of a 3D picture of the mask the voxels of a part of it cover, as boxes, (height, W) bool."""
    camera, width = framing(*mask_rgba(geometry, [mask], [RED], [1.0]), height)
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
def test_the_picture_shows_all_of_a_mask_and_nothing_else(opengl, spacing_mm):
    geometry = _geometry(np.ceil(100.0 / abs(np.array(spacing_mm))).astype(int), np.diag(spacing_mm))
    mask = _spiked_ellipsoid(geometry)
    shown = _pixels_of(render_3d(_dark_volume(geometry), [PictureSegment("any", RED, 1.0, mask)], height=300)[:300], RED)
    expected = _silhouette(geometry, mask, 300, mask)

    assert 2.0 * (shown & expected).sum() / (shown.sum() + expected.sum()) >= 0.97
    # The spikes are a small part of the whole; they are drawn rounder than the boxes of their voxels.
    x, _, z = np.moveaxis(geometry.voxel_centres_ras().reshape(*geometry.shape, 3) - CENTRE, -1, 0)
    spikes = _silhouette(geometry, mask, 300, mask & (np.maximum(abs(x) / 24.0, abs(z) / 30.0) > 1.1))
    assert (shown & spikes).sum() > 0.7 * spikes.sum()


def test_missing_opengl_is_an_input_error(monkeypatch, upright):
    class NoWindow:
        def SetOffScreenRendering(self, _): ...  # noqa: N802
        def SetSize(self, *_): ...  # noqa: N802
        def Initialize(self): ...  # noqa: N802
        def IsCurrent(self):  # noqa: N802
            return False

    monkeypatch.setattr(volume_rendering_picture, "vtkRenderWindow", NoWindow)
    with pytest.raises(InputError, match="OpenGL"):
        render_3d(_dark_volume(upright), [_ball(upright, "ball", RED)], height=HEIGHT)


def test_a_mask_of_another_shape_is_refused(upright):
    segment = PictureSegment("odd", RED, 1.0, np.zeros((3, 3, 3), dtype=bool))
    with pytest.raises(ValueError, match="odd"):
        draw_slices(_dark_volume(upright), [segment], window=WINDOW)


def test_similarity_needs_an_iso_value():
    mask = np.zeros((3, 3, 3), dtype=bool)
    with pytest.raises(ValueError, match="iso"):
        PictureSegment("any", RED, 1.0, mask, similarity=mask.astype(float))


def test_png_holds_the_picture_the_right_way_up(tmp_path):
    picture = np.zeros((5, 7, 3), dtype=np.uint8)
    picture[0, 6] = 255, 128, 3
    save_png(picture, tmp_path / "new folder" / "picture.png")

    read = sitk.GetArrayFromImage(sitk.ReadImage(str(tmp_path / "new folder" / "picture.png")))
    assert np.array_equal(read, picture)


def test_unwritable_png_is_an_input_error_and_leaves_nothing(tmp_path):
    (tmp_path / "a folder.png").mkdir()
    with pytest.raises(InputError, match="write"):
        save_png(np.zeros((5, 7, 3), dtype=np.uint8), tmp_path / "a folder.png")

    assert [path.name for path in tmp_path.iterdir()] == ["a folder.png"]
