"""Where voxels lie."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry

finite = st.floats(-500.0, 500.0)


@st.composite
def geometries(draw: st.DrawFn) -> Geometry:
    """Any orientation, handedness and anisotropy."""
    axes = draw(arrays(np.float64, (3, 3), elements=st.floats(-1.0, 1.0)))
    rotation, _ = np.linalg.qr(axes + 2.0 * np.eye(3))
    spacing = draw(st.lists(st.floats(0.1, 10.0), min_size=3, max_size=3))
    flips = draw(st.lists(st.sampled_from([-1.0, 1.0]), min_size=3, max_size=3))
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * spacing * flips
    matrix[:3, 3] = draw(st.lists(finite, min_size=3, max_size=3))
    shape = draw(st.tuples(*[st.integers(1, 60)] * 3))
    return Geometry(shape, matrix)


@given(geometries(), arrays(np.float64, (4, 3), elements=finite))
def test_points_are_the_same_after_conversion_to_voxels_and_back(geometry: Geometry, points: np.ndarray) -> None:
    np.testing.assert_allclose(geometry.ijk_to_ras_points(geometry.ras_to_ijk(points)), points, atol=1e-6)


@given(geometries())
def test_every_voxel_centre_lies_inside_and_no_voxel_beyond_does(geometry: Geometry) -> None:
    last = np.array(geometry.shape[::-1]) - 1
    corners = np.array([[0, 0, 0], last])
    assert geometry.contains(geometry.ijk_to_ras_points(corners)).all()
    assert not geometry.contains(geometry.ijk_to_ras_points(np.array([last + 1, [-1, 0, 0]]))).any()


@given(geometries(), st.data())
def test_each_point_is_given_the_voxel_and_the_part_of_it_that_it_lies_in(geometry: Geometry, data: st.DataObject) -> None:
    indices = np.array([data.draw(st.integers(0, count - 1)) for count in geometry.shape])
    # Beside the middle of a voxel, well within it.
    beside = np.array(data.draw(st.tuples(*[st.sampled_from([-0.4, -0.1, 0.1, 0.4])] * 3)))
    point = geometry.ijk_to_ras_points((indices + beside)[None, ::-1])
    np.testing.assert_array_equal(geometry.nearest_voxels(point), [indices])
    np.testing.assert_array_equal(geometry.nearest_voxels(point, 2), [2 * indices + (beside > 0.0)])


@given(geometries(), st.data())
def test_a_point_on_the_border_of_two_voxels_is_given_the_same_one_however_rounded_and_stored(
    geometry: Geometry, data: st.DataObject
) -> None:
    last = np.array(geometry.shape) - 1
    border = np.array([data.draw(st.integers(1, count - 1)) - 0.5 if count > 1 else 0.0 for count in geometry.shape])
    rounded = border + data.draw(st.sampled_from([-1e-4, 0.0, 1e-4]))
    from_the_other_end = np.diag([-1.0, -1.0, -1.0, 1.0])
    from_the_other_end[:3, 3] = last[::-1]
    mirrored = Geometry(geometry.shape, geometry.ijk_to_ras @ from_the_other_end)
    points = geometry.ijk_to_ras_points(np.stack([border, rounded])[:, ::-1])
    (voxel, of_rounded), (of_mirrored, _) = geometry.nearest_voxels(points), mirrored.nearest_voxels(points)
    np.testing.assert_array_equal(of_rounded, voxel)
    np.testing.assert_array_equal(last - of_mirrored, voxel)


@given(geometries(), arrays(np.float64, (4, 3), elements=st.floats(-1e4, 1e4)))
def test_a_point_beyond_the_grid_is_given_the_border_voxel(geometry: Geometry, points: np.ndarray) -> None:
    inside = np.clip(geometry.ras_to_ijk(points)[:, ::-1], 0, np.array(geometry.shape) - 1)
    assert (np.abs(geometry.nearest_voxels(points) - inside) <= 0.5 + 1.1e-3).all()


@given(geometries(), st.tuples(*[st.integers(1, 20)] * 3))
def test_a_resized_grid_fills_the_same_box(geometry: Geometry, shape: tuple[int, int, int]) -> None:
    resized = geometry.resized(shape)
    low, high = np.full(3, -0.5), np.array(geometry.shape[::-1]) - 0.5
    corners = geometry.ijk_to_ras_points(np.array([low, high]))
    resized_corners = resized.ijk_to_ras_points(np.array([low, np.array(shape[::-1]) - 0.5]))
    np.testing.assert_allclose(resized_corners, corners, atol=1e-6)
    np.testing.assert_allclose(resized.extent_mm, geometry.extent_mm)


def test_spacing_and_volume_are_those_of_the_axes() -> None:
    matrix = np.array([[0.0, -3.0, 0.0, 7.0], [2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 5.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
    geometry = Geometry((4, 6, 8), matrix)
    np.testing.assert_allclose(geometry.spacing_mm, [2.0, 3.0, 5.0])
    np.testing.assert_allclose(geometry.extent_mm, [16.0, 18.0, 20.0])
    assert geometry.voxel_volume_mm3 == pytest.approx(30.0)


@pytest.mark.parametrize("matrix", [np.zeros((4, 4)), np.diag([2.0, 1.0, 0.0, 1.0]), np.full((4, 4), np.nan), np.eye(3)])
def test_a_matrix_that_maps_nowhere_is_refused(matrix: np.ndarray) -> None:
    with pytest.raises(ValueError, match="invertible"):
        Geometry((2, 2, 2), matrix)


SCALES = [1e-9, 1e-5, 1.0, 1e6]
"""Of lengths in millimetres: microscopes have voxels of nanometres."""


@pytest.mark.parametrize("scale", SCALES)
def test_voxels_may_have_any_size(scale: float) -> None:
    geometry = Geometry((4, 6, 8), np.diag([scale, scale, 20.0 * scale, 1.0]))
    np.testing.assert_allclose(geometry.extent_mm, np.array([8.0, 6.0, 80.0]) * scale)
    np.testing.assert_allclose(geometry.ras_to_ijk(np.array([[scale, 2.0 * scale, 60.0 * scale]])), [[1.0, 2.0, 3.0]])


@pytest.mark.parametrize("scale", SCALES)
def test_axes_in_one_plane_are_refused_whatever_their_lengths(scale: float) -> None:
    matrix = np.eye(4)
    first, second = np.random.default_rng(1).normal(size=(2, 3))
    # In one plane but for rounding.
    matrix[:3, :3] = scale * np.stack([first, second, 0.3 * first - 0.7 * second], axis=1)
    with pytest.raises(ValueError, match="invertible"):
        Geometry((2, 2, 2), matrix)


@pytest.mark.parametrize(("longest_mm", "scale"), [(400.0, 1.0), (64.0, 1.0), (32.0, 0.5), (3.2, 0.05)])
def test_lengths_that_are_meant_for_bodies_shrink_with_scans_that_are_smaller(longest_mm: float, scale: float) -> None:
    assert Geometry((10, 20, 30), np.diag([longest_mm / 30.0] * 3 + [1.0])).body_scale == pytest.approx(scale)
