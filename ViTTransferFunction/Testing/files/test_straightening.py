"""Scans whose slices are shifted against each other, or at uneven distances: everything comes out where it was."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files.straightening import straightened, warn_of_gaps

SCAN = Path("scan")
AIR, TISSUE = -1000.0, 1000.0
CENTRE_RAS = np.array([4.0, -7.0, 30.0])
RADIUS_MM = 14.0


class Scanner:
    """Takes slices of a patient at a tilted gantry, whose table moves along the patient.

    Args:
        heights_mm: of the slices, along the table.
        tilt: of the gantry, degrees.
        pixel_mm: along I and J.
        size: pixels along J and I.
    """

    def __init__(
        self,
        heights_mm: Sequence[float] | np.ndarray,
        tilt: float = 0.0,
        pixel_mm: tuple[float, float] = (1.0, 1.0),
        size: tuple[int, int] = (52, 50),
    ) -> None:
        angle = np.radians(tilt)
        self.axes = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(angle), np.sin(angle)]]) * np.array(pixel_mm)[:, None]
        middles = np.array([[*CENTRE_RAS[:2], height] for height in heights_mm])
        self.positions = middles - (np.array(size[::-1]) - 1) / 2 @ self.axes
        self.size = size

    @property
    def pixels_ras(self) -> np.ndarray:
        """Where the pixels are, (K, J, I, 3)."""
        j, i = np.indices(self.size)
        return self.positions[:, None, None] + i[..., None] * self.axes[0] + j[..., None] * self.axes[1]

    @property
    def as_read(self) -> Geometry:
        """Where a reader puts them that takes slices for straight above each other."""
        step = (self.positions[-1] - self.positions[0]) / (len(self.positions) - 1)
        normal = np.cross(*self.axes) * np.sign(step[2])
        matrix = np.eye(4)
        matrix[:3, :2], matrix[:3, 2] = self.axes.T, np.linalg.norm(step) * normal / np.linalg.norm(normal)
        matrix[:3, 3] = self.positions[0]
        return Geometry((len(self.positions), *self.size), matrix)

    def straightened(self, array: np.ndarray) -> tuple[np.ndarray, Geometry]:
        return straightened(SCAN, array, self.as_read, self.positions, lambda _: None)


def ball(points_ras: np.ndarray) -> np.ndarray:
    """A ball of tissue in air, its border a millimetre wide; int16."""
    depth_mm = RADIUS_MM - np.linalg.norm(points_ras - CENTRE_RAS, axis=-1)
    return np.rint(AIR + (TISSUE - AIR) * np.clip(depth_mm + 0.5, 0.0, 1.0)).astype(np.int16)


def centre_and_ml(array: np.ndarray, geometry: Geometry) -> tuple[np.ndarray, float]:
    """The middle of what is brighter than air, RAS millimetres, and how large it is."""
    weights = (array.ravel() - AIR) / (TISSUE - AIR)
    centre = weights @ geometry.voxel_centres_ras() / weights.sum()
    return centre, float(weights.sum() * geometry.voxel_volume_mm3 / 1000.0)


BALL_ML = 4.0 / 3.0 * np.pi * RADIUS_MM**3 / 1000.0
EVEN = np.arange(0.0, 61.0, 2.0)
FINE_BELOW = np.concatenate([np.arange(0.0, 30.0, 1.5), np.arange(30.0, 61.0, 3.0)])


@pytest.mark.parametrize("heights", [EVEN, FINE_BELOW, np.delete(EVEN, 12)], ids=["even", "fine below", "one missing"])
@pytest.mark.parametrize("tilt", [0.0, 20.0, -25.0])
def test_what_was_scanned_is_in_its_place_and_of_its_size(heights: np.ndarray, tilt: float) -> None:
    scanner = Scanner(heights, tilt)
    array, geometry = scanner.straightened(ball(scanner.pixels_ras))
    centre, ml = centre_and_ml(array, geometry)
    assert np.linalg.norm(centre - CENTRE_RAS) < 0.1
    assert ml == pytest.approx(BALL_ML, rel=0.01)


def test_as_it_is_read_a_tilted_scan_lies_elsewhere() -> None:
    """What the test before this one is about."""
    scanner = Scanner(EVEN, 20.0)
    centre, _ = centre_and_ml(ball(scanner.pixels_ras), scanner.as_read)
    assert np.linalg.norm(centre - CENTRE_RAS) > 5.0


@st.composite
def scanners(draw: st.DrawFn) -> Scanner:
    distances = draw(st.lists(st.floats(0.8, 4.0), min_size=2, max_size=14))
    pixel_mm = draw(st.tuples(st.floats(0.4, 2.0), st.floats(0.4, 2.0)))
    heights = np.cumsum([0.0, *distances]) * draw(st.sampled_from([1.0, -1.0]))
    return Scanner(heights, draw(st.floats(-30.0, 30.0)), pixel_mm, (5, 6))


@given(scanners())
@settings(max_examples=60, deadline=None)
def test_intensities_that_grow_evenly_along_the_patient_still_do_and_nothing_is_beyond(scanner: Scanner) -> None:
    gradient = np.array([3.0, -5.0, 2.0])
    array, geometry = scanner.straightened(scanner.pixels_ras @ gradient)
    true = (geometry.voxel_centres_ras() @ gradient).reshape(array.shape)
    lowest = (scanner.pixels_ras @ gradient).min()
    measured = ~np.isclose(array, lowest)
    # Each is off by what a slice may be, and at a plane's border by half a pixel.
    allowed_mm = 0.25 + 0.5 * np.linalg.norm(scanner.axes, axis=1).sum()
    assert np.abs(array - true)[measured].max() <= allowed_mm * np.linalg.norm(gradient)
    assert array.max() <= (scanner.pixels_ras @ gradient).max() + 1e-9


@given(scanners())
@settings(max_examples=60, deadline=None)
def test_the_straight_grid_holds_every_pixel(scanner: Scanner) -> None:
    array, geometry = scanner.straightened(np.ones((len(scanner.positions), *scanner.size), np.float32))
    off_mm = 0.25 * min(geometry.spacing_mm)
    ijk = geometry.ras_to_ijk(scanner.pixels_ras.reshape(-1, 3))
    beyond_mm = (np.maximum(-0.5 - ijk, ijk - np.array(array.shape[::-1]) + 0.5)) * geometry.spacing_mm
    assert beyond_mm.max() <= off_mm + 1e-6


def test_a_slice_keeps_as_many_pixels_as_it_had() -> None:
    scanner = Scanner(EVEN, 20.0)
    rising = np.ones((len(EVEN), *scanner.size), np.int16)
    rising[0, 0, 0] = 0
    array, _ = scanner.straightened(rising)
    assert array.sum(axis=(1, 2))[1:].tolist() == [scanner.size[0] * scanner.size[1]] * (len(EVEN) - 1)


def test_slices_at_even_distances_are_only_moved() -> None:
    """By whole pixels here: each is as it was."""
    scanner = Scanner(EVEN)
    scanner.positions = scanner.positions + np.arange(len(EVEN))[:, None] * [0.0, -1.0, 0.0]
    taken = np.random.default_rng(0).integers(-1000, 1000, (len(EVEN), *scanner.size)).astype(np.int16)
    array, geometry = scanner.straightened(taken)
    rows = len(EVEN) - 1
    assert array.shape == (len(EVEN), scanner.size[0] + rows, scanner.size[1])
    for k in range(len(EVEN)):
        np.testing.assert_array_equal(array[k, rows - k : rows - k + scanner.size[0]], taken[k])
    np.testing.assert_allclose(geometry.spacing_mm, [1.0, 1.0, 2.0])


@pytest.mark.parametrize("shear", [0.2, -0.2])
def test_slices_whose_pixels_are_no_rectangles_are_left_as_they_are(shear: float) -> None:
    scanner = Scanner(EVEN, 20.0)
    matrix = scanner.as_read.ijk_to_ras.copy()
    matrix[:3, 1] += shear * matrix[:3, 0]
    geometry = Geometry(scanner.as_read.shape, matrix)
    taken = ball(scanner.pixels_ras)
    array, read = straightened(SCAN, taken, geometry, scanner.positions, pytest.fail)
    assert array is taken
    assert read is geometry


def test_where_nothing_was_measured_is_the_lowest_value() -> None:
    scanner = Scanner(EVEN, 20.0)
    bright = np.full((len(EVEN), *scanner.size), 40, np.int16)
    bright[15, 20, 20] = -1024
    array, geometry = scanner.straightened(bright)
    middle_of_first, middle_of_last = scanner.pixels_ras[[0, -1], 26, 25]
    for there, k in ((middle_of_first, 0), (middle_of_last, -1)):
        at = geometry.nearest_voxels(there[None])[0]
        assert array[tuple(at)] == 40
        assert sorted({array[k, 0, 0], array[k, -1, 0]}) == [-1024, 40]


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.int32, np.float32, np.float64])
def test_voxels_stay_of_their_kind_and_within_what_was_measured(dtype: type) -> None:
    kind: np.dtype[Any] = np.dtype(dtype)
    low, high = (np.iinfo(kind).min, np.iinfo(kind).max) if kind.kind in "iu" else (-1e30, 1e30)
    scanner = Scanner(FINE_BELOW, 20.0)
    taken = np.where(np.random.default_rng(0).random((len(FINE_BELOW), *scanner.size)) < 0.5, low, high).astype(kind)
    array, _ = scanner.straightened(taken)
    assert array.dtype == kind
    assert array.min() == taken.min()
    assert array.max() == taken.max()


def test_a_straight_stack_is_left_as_it_is() -> None:
    scanner = Scanner(EVEN)
    scanner.positions = scanner.positions + np.random.default_rng(0).uniform(-0.05, 0.05, scanner.positions.shape)
    taken = np.zeros((len(EVEN), *scanner.size), np.int16)
    array, _ = straightened(SCAN, taken, scanner.as_read, scanner.positions, pytest.fail)
    assert array is taken


def test_a_part_that_was_scanned_more_finely_decides_the_spacing_and_one_short_distance_does_not() -> None:
    heights = np.cumsum([0.0] + [4.0] * 13 + [1.08] + [7.0] * 13)
    scanner = Scanner(heights, size=(3, 4))
    array, geometry = scanner.straightened(np.ones((len(heights), 3, 4), np.int16))
    assert geometry.spacing_mm[2] == pytest.approx(4.0, abs=0.01)
    assert array.shape == (37, 3, 4)


def test_the_first_and_the_last_slice_stay_what_they_were() -> None:
    heights = [0.0, 2.0, 4.0, 9.0, 13.7]
    scanner = Scanner(heights, size=(3, 4))
    taken = np.random.default_rng(0).integers(0, 100, (5, 3, 4)).astype(np.int16)
    array, geometry = scanner.straightened(taken)
    np.testing.assert_array_equal(array[[0, -1]], taken[[0, -1]])
    np.testing.assert_allclose(geometry.ijk_to_ras_points(np.array([[0, 0, len(array) - 1]]))[0], scanner.positions[-1])


def test_the_note_says_what_was_irregular_and_what_was_done() -> None:
    scanner = Scanner(FINE_BELOW, 20.0)
    notes: list[str] = []
    straightened(SCAN, ball(scanner.pixels_ras), scanner.as_read, scanner.positions, notes.append)
    # 60 mm of the table, by the sine and the cosine of 20°.
    (note,) = notes
    assert "lie 1.41 to 2.82 mm apart and are shifted against each other by up to 20.5 mm, as with a tilted gantry" in note
    assert "straight grid of 1 × 1 × 1.41 mm" in note


@pytest.mark.parametrize(
    ("far_mm", "told"), [(503.0, "they lie 1 to 503 mm apart"), (1e12, "would have"), (1e100, "would have")]
)
def test_slices_that_are_no_one_stack_are_refused(far_mm: float, told: str) -> None:
    """Before anything of the size of their grid is made: damaged headers have them anywhere."""
    scanner = Scanner([0.0, 1.0, 2.0, far_mm, far_mm * 2, far_mm * 3], tilt=20.0 if far_mm > 1e6 else 0.0, size=(3, 4))
    with pytest.raises(InputError, match="no one stack of slices") as refusal:
        scanner.straightened(np.ones((6, 3, 4), np.int16))
    assert told in str(refusal.value)


@pytest.mark.parametrize("along", ["I", "J"])
def test_a_slice_that_is_shifted_far_beside_the_others_is_none_of_their_stack(along: str) -> None:
    scanner = Scanner(EVEN, size=(3, 4))
    scanner.positions[-1, "IJ".index(along)] += 1e6
    with pytest.raises(InputError, match=r"shifted against each other by up to 1e\+06 mm.* would have"):
        scanner.straightened(np.ones((len(EVEN), 3, 4), np.int16))


def test_a_grid_that_memory_has_no_room_for_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.core.system.available_memory.available_memory_bytes", lambda: 1000)
    scanner = Scanner(EVEN, 20.0)
    with pytest.raises(InputError, match="Straightening the slices of scan takes"):
        scanner.straightened(ball(scanner.pixels_ras))


@pytest.mark.parametrize(
    ("heights", "told"),
    [
        ([0.0, 3.0, 6.0, 12.0, 15.0], "between c and d, which are 6 mm apart"),
        ([15.0, 12.0, 9.0, 3.0, 0.0], "between c and d, which are 6 mm apart"),
        ([0.0, 3.0, 9.0, 12.0, 15.0, 27.0], "in 2 places, the widest between e and f, which are 12 mm apart"),
        ([0.0, 3.0, 6.0, 11.0, 16.0], None),
        ([0.0, 3.0, 6.0, 6.5, 11.0, 16.0], None),
        ([0.0, 3.0], None),
    ],
    ids=["one", "one, downwards", "two", "coarser above", "where two parts meet", "two slices"],
)
def test_slices_that_are_farther_apart_than_those_beside_them_are_told_of(heights: list[float], told: str | None) -> None:
    warnings: list[str] = []
    warn_of_gaps(SCAN, np.array(heights), "abcdef"[: len(heights)], warnings.append)
    assert len(warnings) == (told is not None)
    assert told is None or told in warnings[0]
