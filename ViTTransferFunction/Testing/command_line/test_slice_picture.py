"""Pictures of slices: everything in its place, in its colour, in any orientation of the voxel grid."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.CommandLine.canvas import BACKGROUND, Canvas, PictureSegment
from ViTTransferFunction.CommandLine.slice_picture import PicturePoint, draw_slices
from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Testing.support.allocation import peak_bytes
from ViTTransferFunction.Testing.support.pictures import (
    BLUE,
    CENTRE,
    GREEN,
    RED,
    ball,
    dark_volume,
    distance_mm,
    landmarks,
    pixels_of,
    place_of,
)

WINDOW = (0.0, 1000.0)


def panels(picture: np.ndarray) -> list[np.ndarray]:
    """The three planes of a slice picture, told by the strips of background between them."""
    background = (picture == np.rint(np.array(BACKGROUND) * 255).astype(np.uint8)).all(axis=2)
    rows = np.flatnonzero(~background.all(axis=1))
    bottom = rows[0] + np.argmax(np.diff(rows) > 1) + 1
    panel_rows = slice(rows[0], bottom)
    columns = np.flatnonzero(~background[panel_rows].all(axis=0))
    return [
        picture[panel_rows, group[0] : group[-1] + 1] for group in np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
    ]


@pytest.mark.parametrize(
    ("plane", "ball_on_the_left", "ball_at_the_top"),
    [(0, RED, GREEN), (1, RED, BLUE), (2, GREEN, BLUE)],
    ids=["axial: right, anterior", "coronal: right, superior", "sagittal: anterior, superior"],
)
def test_the_patients_directions_lie_in_each_plane_as_radiology_has_them(
    geometry: Geometry, plane: int, ball_on_the_left: Color, ball_at_the_top: Color
) -> None:
    panel = panels(draw_slices(dark_volume(geometry), landmarks(geometry), window=WINDOW, width=600))[plane]

    left, top = place_of(panel, ball_on_the_left), place_of(panel, ball_at_the_top)
    assert left[0] < 0.4
    assert left[1] == pytest.approx(0.5, abs=0.06)
    assert top[1] < 0.4
    assert top[0] == pytest.approx(0.5, abs=0.06)


def test_each_plane_is_lettered_as_radiology_has_it_and_says_where_it_cuts_the_patient(
    geometry: Geometry, monkeypatch: pytest.MonkeyPatch
) -> None:
    panels: dict[Canvas, dict[str, tuple[float, float]]] = {}

    def label(canvas: Canvas, x: float, y: float, text: str, *_: object, **__: object) -> None:
        height, width = canvas.pixels.shape[:2]
        panels.setdefault(canvas, {})[text] = x / width, y / height

    monkeypatch.setattr(Canvas, "label", label)
    draw_slices(dark_volume(geometry), [ball(geometry, "middle", RED)], window=WINDOW, width=600)

    for labels, (plane, letters, side, distance) in zip(
        panels.values(),
        # At the left, right, upper and lower edge; and where the middle of the volume lies, RAS (12, -40, 300).
        [("Axial", "RLAP", "S", 300), ("Coronal", "RLSI", "P", 40), ("Sagittal", "APSI", "R", 12)],
        strict=True,
    ):
        *edges, name, where = labels
        assert sorted(edges) == sorted(letters)
        left, right, top, bottom = (labels[letter] for letter in letters)
        assert left[0] < 0.2 < 0.8 < right[0]
        assert top[1] < 0.2 < 0.8 < bottom[1]
        assert (left[1], right[1], top[0], bottom[0]) == (0.5, 0.5, 0.5, 0.5)
        assert name == plane
        assert where.startswith(f"{side} ")
        assert where.endswith(" mm")
        assert float(where[2:-3]) == pytest.approx(distance, abs=max(4.0, geometry.spacing_mm.max()))


def test_intensities_lie_under_their_segment(geometry: Geometry) -> None:
    array = (distance_mm(geometry, (0, 0, 30)) < 12.0).astype(np.float32) * 1000.0
    picture = draw_slices(Volume(array, geometry), [ball(geometry, "middle", RED, radius_mm=3.0)], window=WINDOW, width=600)

    for panel in panels(picture)[1:]:
        # The letter S at the edge is as white, so look at the ball's own place.
        bright = panel[round(0.12 * panel.shape[0]) : round(0.28 * panel.shape[0]), :, 0] > 200
        assert np.nonzero(bright)[1].mean() / panel.shape[1] == pytest.approx(0.5, abs=0.06)


def test_a_ball_is_round_in_every_plane_of_an_anisotropic_volume(geometry: Geometry) -> None:
    picture = draw_slices(dark_volume(geometry), [ball(geometry, "ball", RED, radius_mm=25.0)], window=WINDOW, width=900)

    for panel in panels(picture):
        rows, columns = (np.flatnonzero(pixels_of(panel, RED).any(axis=axis)) for axis in (1, 0))
        assert np.ptp(rows) / np.ptp(columns) == pytest.approx(1.0, abs=0.2)


def test_nothing_is_coloured_where_no_segment_is(aligned: Geometry) -> None:
    picture = draw_slices(dark_volume(aligned), [ball(aligned, "ball", RED, radius_mm=20.0)], window=WINDOW, width=600)

    for panel in panels(picture):
        y, x = np.indices(panel.shape[:2]) / panel.shape[0] - 0.5
        coloured = pixels_of(panel, RED)
        assert coloured[np.hypot(x, y) < 0.17].all()
        assert not coloured[np.hypot(x, y) > 0.23].any()


def test_positive_and_negative_points_differ_by_shape(aligned: Geometry) -> None:
    segment = ball(aligned, "ball", RED, radius_mm=40.0)
    volume = dark_volume(aligned)

    def marker(positive: bool) -> np.ndarray:
        points = [PicturePoint(CENTRE, 0, positive)]
        axial = panels(draw_slices(volume, [segment], window=WINDOW, points=points, width=1200))[0]
        middle = axial.shape[0] // 2
        return axial[middle - 3 : middle + 4, middle - 3 : middle + 4].sum(axis=2) > 100

    assert marker(positive=True).all()
    assert not marker(positive=False)[0].any()
    assert marker(positive=False)[3, 1:6].all()


def test_points_far_from_the_planes_are_not_marked(aligned: Geometry) -> None:
    segment = ball(aligned, "ball", RED)
    volume = dark_volume(aligned)
    far = [PicturePoint(CENTRE + 40.0, 0)]

    without = draw_slices(volume, [segment], window=WINDOW, width=600)
    assert np.array_equal(draw_slices(volume, [segment], window=WINDOW, points=far, width=600), without)


def test_slices_without_any_segment_show_the_volume(aligned: Geometry) -> None:
    array = np.full(aligned.shape, 500.0)
    array[0, 0, 0] = np.nan
    array[0, 0, 1] = 0.0
    planes = panels(draw_slices(Volume(array, aligned), [], window=WINDOW, width=600))

    assert len(planes) == 3
    assert all(abs(int(np.median(panel)) - 128) <= 1 for panel in planes)


def test_legend_of_many_classes_takes_several_rows(aligned: Geometry) -> None:
    segments = [PictureSegment(f"a rather long name {n}", RED, 1.0, np.zeros(aligned.shape, dtype=bool)) for n in range(20)]
    one = draw_slices(dark_volume(aligned), segments[:1], window=WINDOW, width=600)
    many = draw_slices(dark_volume(aligned), segments, window=WINDOW, width=600)

    assert many.shape[0] > one.shape[0] + 50


def test_a_name_that_is_too_long_for_the_legend_is_shortened_beside_its_colour(aligned: Geometry) -> None:
    empty = np.zeros(aligned.shape, dtype=bool)
    short, long = (
        draw_slices(dark_volume(aligned), [PictureSegment(name, GREEN, 1.0, empty)], window=WINDOW, width=600)
        for name in ("w", 300 * "w")
    )

    assert long.shape == short.shape
    assert pixels_of(long, GREEN).sum() == pixels_of(short, GREEN).sum()
    legend = long[pixels_of(long, GREEN).any(axis=1)]
    assert (legend[:, [*range(5), *range(-5, 0)]] == legend[0, 0]).all()


def test_an_empty_segment_keeps_its_place_in_the_legend(aligned: Geometry) -> None:
    empty = PictureSegment("empty", GREEN, 1.0, np.zeros(aligned.shape, dtype=bool))

    assert pixels_of(draw_slices(dark_volume(aligned), [empty], window=WINDOW, width=600), GREEN).sum() > 50


def test_a_mask_of_another_shape_is_refused(aligned: Geometry) -> None:
    segment = PictureSegment("odd", RED, 1.0, np.zeros((3, 3, 3), dtype=bool))
    with pytest.raises(ValueError, match="odd"):
        draw_slices(dark_volume(aligned), [segment], window=WINDOW)


def test_a_segment_that_fills_the_scan_takes_little_memory_beside_it() -> None:
    shape = (96, 96, 96)
    volume = Volume(np.arange(96**3, dtype=np.int16).reshape(shape), Geometry(shape, np.eye(4)))
    body = PictureSegment("body", (1.0, 0.0, 0.0), 1.0, np.ones(shape, dtype=bool))
    assert peak_bytes(lambda: draw_slices(volume, [body], window=(0.0, 100.0), width=300)) < 20 * 96**3
