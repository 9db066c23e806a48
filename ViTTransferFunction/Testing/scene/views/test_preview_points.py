"""A point that hangs on the mouse is in no picture of a view."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")

import slicer
import vtk

from ViTTransferFunction.Logic.scene.views.filming import Filming
from ViTTransferFunction.Logic.scene.views.preview_points import without_previews
from ViTTransferFunction.Testing.support.views import PIXELS_3D, Views, look_from, pixels

PLACED_RAS, HANGING_RAS = np.array([5.0, 15.0, 15.0]), np.array([25.0, 15.0, 15.0])


@pytest.fixture
def points(slicer_app: Any) -> Any:
    """A list with a point that is placed and one that is not."""
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode")
    node.CreateDefaultDisplayNodes()
    node.GetDisplayNode().SetPointLabelsVisibility(False)
    node.GetDisplayNode().SetGlyphScale(5.0)
    node.AddControlPointWorld(vtk.vtkVector3d(*PLACED_RAS))
    index = node.AddControlPointWorld(vtk.vtkVector3d(*HANGING_RAS))
    node.SetNthControlPointPositionWorld(index, *HANGING_RAS, slicer.vtkMRMLMarkupsNode.PositionPreview)
    return node


def drawn_halves(picture: np.ndarray) -> tuple[bool, bool]:
    """Whether something is drawn in the picture's left half, and in its right one. The patient's right is on the left."""
    left, right = np.split(picture.max(axis=-1) > 50, 2, axis=1)
    return bool(left.any()), bool(right.any())


def test_a_film_does_not_show_the_point_that_is_about_to_be_placed(slicer_app: Any, points: Any) -> None:
    views = Views(slicer_app)
    view = views.view_3d()
    look_from(view, (PLACED_RAS + HANGING_RAS) / 2, 100.0)
    assert drawn_halves(pixels(view)) == (True, True)
    frames = []

    def film(frame: Any) -> Any:
        frames.append(frame(0))
        yield 1

    filming = Filming(views.scene, view.render_window(), (PIXELS_3D, PIXELS_3D), 1, 1, film)
    filming.advance()
    assert drawn_halves(frames[0]) == (False, True)
    assert drawn_halves(pixels(view)) == (True, True)


def test_what_others_hid_stays_hidden(slicer_app: Any, points: Any) -> None:
    points.SetNthControlPointVisibility(1, False)
    with without_previews(slicer_app.scene):
        pass
    assert not points.GetNthControlPointVisibility(1)
    assert points.GetNthControlPointVisibility(0)
