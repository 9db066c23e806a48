"""Cameras: they see all that they should, and several cases alike."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ViTTransferFunction.CommandLine.render_command import VIEW_DEGREES
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.camera import Camera, direction, framing, middle_of
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files.camera_files import read_camera, write_camera
from ViTTransferFunction.Logic.scene.views.view_picture import placed_camera
from ViTTransferFunction.Testing.support.pictures import CENTRE, distance_mm, geometry_about_the_centre

SIZE = 320, 200


def projected(camera: Camera, middle_ras: np.ndarray, points_ras: np.ndarray) -> np.ndarray:
    """Where points (N, 3) are in the camera's picture, (N, 2) from −1 to 1, from the lower left corner."""
    width, height = camera.size
    transform = placed_camera(camera, middle_ras).GetCompositeProjectionTransformMatrix(width / height, -1.0, 1.0)
    matrix = np.array([[transform.GetElement(row, column) for column in range(4)] for row in range(4)])
    clip = np.column_stack([points_ras, np.ones(len(points_ras))]) @ matrix.T
    return clip[:, :2] / clip[:, 3:]


@pytest.mark.parametrize(
    ("side", "azimuth", "elevation", "rightmost", "topmost"),
    [
        ("front", 0.0, 0.0, (-1, 0, 0), (0, 0, 1)),
        ("left", 90.0, 0.0, (0, -1, 0), (0, 0, 1)),
        ("back", 180.0, 0.0, (1, 0, 0), (0, 0, 1)),
        ("right", -90.0, 0.0, (0, 1, 0), (0, 0, 1)),
        ("top", 180.0, 90.0, (1, 0, 0), (0, 1, 0)),
        ("bottom", 0.0, -90.0, (-1, 0, 0), (0, 1, 0)),
    ],
)
def test_each_side_of_the_patient_is_seen_as_a_radiologist_expects(
    side: str, azimuth: float, elevation: float, rightmost: tuple[int, int, int], topmost: tuple[int, int, int]
) -> None:
    assert VIEW_DEGREES[side] == (azimuth, elevation)
    points = CENTRE + 10.0 * np.concatenate([np.eye(3), -np.eye(3)])
    camera = framing(points, CENTRE, direction(azimuth, elevation), size=SIZE)
    x, y = projected(camera, CENTRE, points).T
    np.testing.assert_allclose((points[x.argmax()] - CENTRE) / 10.0, rightmost)
    np.testing.assert_allclose((points[y.argmax()] - CENTRE) / 10.0, topmost)


@pytest.mark.parametrize("elevation", [-90.0, -30.0, 0.0, 8.0, 75.0])
@pytest.mark.parametrize("size", [None, (100, 300), (300, 100)], ids=str)
def test_everything_is_in_the_picture_and_fills_it(elevation: float, size: tuple[int, int] | None) -> None:
    points = CENTRE + np.random.default_rng(0).normal(size=(500, 3)) * (30.0, 60.0, 90.0)
    camera = framing(points, CENTRE, direction(25.0, elevation), size=size)
    assert 0.9 < abs(projected(camera, CENTRE, points)).max() < 1.0


def test_what_is_small_fills_the_picture_as_well() -> None:
    points = CENTRE + 1e-4 * np.random.default_rng(0).normal(size=(500, 3))
    camera = framing(points, CENTRE, direction(25.0, 8.0), size=SIZE)
    assert 0.9 < abs(projected(camera, CENTRE, points)).max() < 1.0


def test_a_turning_camera_sees_everything_from_all_sides() -> None:
    points = CENTRE + np.random.default_rng(1).normal(size=(500, 3)) * (10.0, 90.0, 20.0)
    camera = framing(points, CENTRE, direction(0.0, 8.0), size=SIZE, turning=True)
    reach = [abs(projected(camera.turned(angle), CENTRE, points)).max() for angle in range(0, 360, 10)]
    assert 0.9 < max(reach) < 1.0
    still = framing(points, CENTRE, direction(0.0, 8.0), size=SIZE)
    assert max(abs(projected(still.turned(angle), CENTRE, points)).max() for angle in range(0, 360, 10)) > 1.0


def test_turning_is_a_change_of_azimuth() -> None:
    points = CENTRE + np.array([[5.0, 0, 0], [0, 9.0, 0], [0, 0, 4.0], [-5.0, 0, 0], [0, -9.0, 0], [0, 0, -4.0]])
    turned = framing(points, CENTRE, direction(10.0, 20.0), size=SIZE, turning=True).turned(50.0)
    expected = framing(points, CENTRE, direction(60.0, 20.0), size=SIZE, turning=True)
    np.testing.assert_allclose(turned.position_mm, expected.position_mm, rtol=1e-2)
    np.testing.assert_allclose(turned.view_up, expected.view_up, atol=1e-9)


def test_a_camera_in_a_file_shows_two_cases_alike(tmp_path: Path, geometry: Geometry) -> None:
    """The same body, in another scanner's coordinates and on a finer grid."""
    shift = np.array([300.0, -120.0, 45.0])
    elsewhere = Geometry((70, 70, 70), np.diag([1.5, 1.5, 1.5, 1.0]))
    elsewhere = Geometry(elsewhere.shape, elsewhere.ijk_to_ras + np.outer([*(CENTRE + shift - 51.75), 0.0], [0, 0, 0, 1]))
    first, second = distance_mm(geometry) < 35.0, np.linalg.norm(
        elsewhere.voxel_centres_ras() - CENTRE - shift, axis=1
    ).reshape(elsewhere.shape) < 35.0  # fmt: skip
    middle, other_middle = middle_of(geometry, [first]), middle_of(elsewhere, [second])

    write_camera(
        framing(geometry.ijk_to_ras_points(np.argwhere(first)[:, ::-1]), middle, direction(30.0, 10.0)), tmp_path / "c.json"
    )
    camera = read_camera(tmp_path / "c.json")
    landmark = CENTRE + np.array([[20.0, 10.0, -15.0]])
    ours, theirs = (
        projected(camera, place, point)[0] for place, point in ((middle, landmark), (other_middle, landmark + shift))
    )
    # As far as a voxel is from the other grid's.
    np.testing.assert_allclose(ours, theirs, atol=geometry.spacing_mm.max() / 70.0)


def test_the_middle_is_that_of_all_voxels_in_patient_space(geometry: Geometry) -> None:
    masks = [distance_mm(geometry, offset) < 10.0 for offset in ((30, 0, 0), (0, 20, -10))]
    points = geometry.voxel_centres_ras()[np.logical_or(*masks).ravel()]
    empty = np.zeros(geometry.shape, dtype=bool)
    np.testing.assert_allclose(middle_of(geometry, [*masks, empty]), (points.min(axis=0) + points.max(axis=0)) / 2)


def test_a_camera_is_the_same_after_writing_and_reading(tmp_path: Path) -> None:
    camera = Camera((0.0, 500.5, -20.25), (1.0, 2.0, 3.0), (0.0, 0.0, 1.0), (640, 480), 25.0)
    write_camera(camera, tmp_path / "camera.json")
    assert read_camera(tmp_path / "camera.json") == camera


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"relative_to": "scanner"}, "relative_to"),
        ({"coordinate_system": "LPS"}, "coordinate_system"),
        ({"position_mm": [0, 1]}, "position_mm"),
        ({"position_mm": [0, 1, float("nan")]}, "position_mm"),
        ({"position_mm": [0, 0, 0]}, "view_up"),
        ({"view_up": [0, -5, 0]}, "view_up"),
        ({"view_angle_degrees": 0}, "view_angle_degrees"),
        ({"size_pixels": [100]}, "size_pixels"),
        ({"size_pixels": [100, 1_000_000]}, "size_pixels"),
        ({"size_pixels": [100, True]}, "size_pixels"),
    ],
)
def test_a_file_that_is_no_usable_camera_is_refused(tmp_path: Path, change: dict, says: str) -> None:
    path = tmp_path / "camera.json"
    write_camera(Camera((0.0, 500.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (100, 100)), path)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=says):
        read_camera(path)


def test_another_json_file_is_no_camera(tmp_path: Path) -> None:
    path = tmp_path / "clicks.json"
    path.write_text('{"classes": []}')
    with pytest.raises(
        InputError, match=r"not a camera\. Save beside Camera, in panel and app, and `vittf render --save-camera` write one"
    ):
        read_camera(path)


def test_a_single_place_can_be_framed() -> None:
    camera = framing(CENTRE[None], CENTRE, direction(0.0, 0.0))
    assert np.isfinite(camera.position_mm).all()
    assert geometry_about_the_centre((2, 2, 2), np.eye(3)).contains(CENTRE[None]).all()
