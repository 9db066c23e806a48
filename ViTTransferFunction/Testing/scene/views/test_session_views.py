"""What a session shows in slice and 3D views, as its parameters say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.scenes import annotate
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.views import Views, look_from, pixel_3d, pixels, slice_pixel

DISTANCE_MM = 250.0


@pytest.fixture
def on_spheres(session: SceneSession, spheres: Spheres) -> SceneSession:
    """A session with a structure for each of the three spheres."""
    annotate(session, spheres)
    return session


@pytest.fixture
def view_3d(slicer_app: Any, on_spheres: SceneSession, spheres: Spheres) -> Any:
    """A view in 3D, in which no sphere hides another."""
    view = Views(slicer_app).view_3d()
    look_from(view, np.mean([centre_ras(spheres, label)[0] for label in (1, 2, 3)], axis=0), DISTANCE_MM)
    return view


@pytest.fixture
def slice_view(slicer_app: Any, on_spheres: SceneSession) -> Any:
    """A view of slices of the scan."""
    view = Views(slicer_app).slice_view()
    view.set_background_volume_id(on_spheres.parameters.volume.GetID())
    view.fit_view_to_content()
    return view


def within(spheres: Spheres) -> list[np.ndarray]:
    """A place in each of the spheres, beside its point and where this has its name."""
    return [centre_ras(spheres, label)[0] - 7.0 for label in (1, 2, 3)]


def seen_in_3d(view: Any, spheres: Spheres) -> list[bool]:
    """Whether something is seen where each of the spheres is."""
    picture = pixels(view)
    return [bool(picture[pixel_3d(view, ras)].any()) for ras in within(spheres)]


def overlaid(view: Any, spheres: Spheres) -> list[bool]:
    """Whether slices are coloured in each of the spheres."""
    return [is_coloured(view, ras) for ras in within(spheres)]


def is_coloured(view: Any, ras: np.ndarray) -> bool:
    """Whether a place has a colour in its slice, not a grey."""
    place = slice_pixel(view, ras)
    return bool(np.ptp(pixels(view)[place]))


def outlined(scene: Any) -> list[tuple[int, ...]]:
    """The colours of the outlines in slices, of 255."""
    model = scene.GetFirstNodeByName("Similarity contours")
    table = model.GetDisplayNode().GetColorNode().GetLookupTable()
    indices = np.unique(vtk_to_numpy(model.GetPolyData().GetPointData().GetScalars()))
    return sorted(of_255(table.GetTableValue(index)[:3]) for index in indices)


def of_255(color: Sequence[float]) -> tuple[int, ...]:
    return tuple(round(255 * share) for share in color)


def test_the_selected_structure_is_alone_in_3d_where_that_is_wanted(
    on_spheres: SceneSession, view_3d: Any, spheres: Spheres
) -> None:
    assert seen_in_3d(view_3d, spheres) == [True, True, True]
    on_spheres.parameters.set("renderingSolo", True)
    on_spheres.select_class(on_spheres.classes[1].id)
    on_spheres.wait()
    assert seen_in_3d(view_3d, spheres) == [False, True, False]
    on_spheres.select_class(on_spheres.classes[0].id)
    on_spheres.wait()
    assert seen_in_3d(view_3d, spheres) == [True, False, False]


def test_a_hidden_structure_is_in_no_view(
    slicer_app: Any, on_spheres: SceneSession, view_3d: Any, slice_view: Any, spheres: Spheres
) -> None:
    first, second, third = on_spheres.classes
    on_spheres.select_class(first.id)
    on_spheres.wait()
    assert outlined(slicer_app.scene) == sorted(of_255(state.color) for state in (first, second, third))
    assert overlaid(slice_view, spheres) == [True, False, False]
    on_spheres.annotations.set_class(first.id, visible=False)
    on_spheres.wait()
    assert outlined(slicer_app.scene) == sorted(of_255(state.color) for state in (second, third))
    assert overlaid(slice_view, spheres) == [False, False, False]
    assert seen_in_3d(view_3d, spheres) == [False, True, True]


def test_the_overlay_is_of_the_selected_structure_and_shown_where_it_is_wanted(
    on_spheres: SceneSession, slice_view: Any, spheres: Spheres
) -> None:
    on_spheres.select_class(on_spheres.classes[1].id)
    on_spheres.wait()
    assert overlaid(slice_view, spheres) == [False, True, False]
    on_spheres.parameters.set("overlayVisible", False)
    on_spheres.wait()
    assert overlaid(slice_view, spheres) == [False, False, False]


def test_what_is_around_structures_is_in_3d_where_it_is_wanted(on_spheres: SceneSession, view_3d: Any) -> None:
    before = pixels(view_3d).any(axis=-1)
    on_spheres.parameters.set("context", "skin")
    on_spheres.wait()
    assert pixels(view_3d).any(axis=-1).sum() > 2 * before.sum()
    on_spheres.parameters.set("contextStrength", 0.0)
    on_spheres.wait()
    assert pixels(view_3d).any(axis=-1).sum() == pytest.approx(before.sum(), rel=0.05)


def test_what_is_known_of_other_voxels_is_not_shown(slicer_app: Any, on_spheres: SceneSession, spheres: Spheres) -> None:
    outlines = slicer_app.scene.GetFirstNodeByName("Similarity contours")
    assert outlines.GetDisplayNode().GetVisibility()
    volume, _ = spheres
    set_image(on_spheres.parameters.volume, volume.array[::-1].copy(), volume.geometry.ijk_to_ras)
    on_spheres.poll()
    assert on_spheres.volume_changed
    assert not outlines.GetDisplayNode().GetVisibility()


def test_what_is_exported_from_3d_is_named_after_the_scan_and_stays_in_place_of_what_follows_clicks(
    slicer_app: Any, on_spheres: SceneSession, view_3d: Any, spheres: Spheres
) -> None:
    told: list[bool] = []
    on_spheres.add_observer(lambda: told.append(True))
    on_spheres.views.export_rendering()
    assert told
    assert slicer_app.scene.GetFirstNodeByName("spheres structures").IsA("vtkMRMLVectorVolumeNode")
    assert on_spheres.parameters.get("rendering") == "off"
    assert on_spheres.errors == ()
    on_spheres.annotations.set_class(on_spheres.classes[0].id, visible=False)
    on_spheres.wait()
    assert seen_in_3d(view_3d, spheres) == [True, True, True]
