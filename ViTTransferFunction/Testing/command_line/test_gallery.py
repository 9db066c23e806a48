"""The gallery's plain side: a 1D transfer function shows the intensities that it should, where they are."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.camera import direction, framing
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Logic.scene.views.view_picture import placed_camera
from ViTTransferFunction.Testing.support.pictures import BLUE, CENTRE, GREEN, RED, distance_mm, pixels_of, place_of
from ViTTransferFunction.Testing.support.readme_pictures.exhibits import ANNOTATIONS, EXHIBITS
from ViTTransferFunction.Testing.support.readme_pictures.intensity_rendering import IntensityStop, intensity_picture

SIZE = 160, 120


def test_each_intensity_shows_in_its_colour_and_at_its_place(geometry: Geometry) -> None:
    array = np.zeros(geometry.shape, dtype=np.int16)
    array[distance_mm(geometry, (30, 0, 0)) < 14.0] = 100
    array[distance_mm(geometry, (-30, 0, 0)) < 14.0] = -100
    # Nothing between the two, or the brighter one would have a rim of the darker one's colour.
    stops = [IntensityStop(-90.0, 1.0, BLUE), IntensityStop(-60.0, 0.0, BLUE)]
    stops += [IntensityStop(60.0, 0.0, RED), IntensityStop(90.0, 1.0, RED)]
    camera = framing(CENTRE + np.array([[60.0, 0, 0], [-60.0, 0, 0]]), CENTRE, direction(0.0, 0.0), size=SIZE)
    try:
        picture = intensity_picture(Volume(array, geometry), stops, placed_camera(camera, CENTRE), SIZE)
    except InputError as error:
        pytest.skip(str(error))
    # The patient's right is on the left.
    assert place_of(picture, RED) == pytest.approx([0.5 - 0.25 / 1.05, 0.5], abs=0.06)
    assert place_of(picture, BLUE) == pytest.approx([0.5 + 0.25 / 1.05, 0.5], abs=0.06)
    assert not pixels_of(picture, GREEN).any()


@pytest.mark.parametrize("name", list(EXHIBITS))
def test_each_exhibit_has_its_points_and_a_transfer_function_in_order(name: str) -> None:
    exhibit = EXHIBITS[name]
    classes = read_annotations(ANNOTATIONS / exhibit.annotations, Geometry((1, 1, 1), np.eye(4)))
    assert len(classes) >= 3
    intensities = [stop.intensity for stop in exhibit.stops]
    assert intensities == sorted(set(intensities))
    assert np.dot(exhibit.seen_from.towards, exhibit.seen_from.up) == pytest.approx(0.0, abs=2e-3)
    np.testing.assert_allclose(np.linalg.norm([exhibit.seen_from.towards, exhibit.seen_from.up], axis=1), 1.0, atol=2e-3)
