"""Faint outlines of the proposals that are not shown: which there are, where they lie, and how they look."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.iso_proposals import IsoProposals
from ViTTransferFunction.Logic.core.volumes import stepped_work
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.stepped_work import finished
from ViTTransferFunction.Logic.scene.views import proposal_outlines
from ViTTransferFunction.Logic.scene.views.proposal_outlines import Made, ProposalOutlines, Proposals, outlines
from ViTTransferFunction.Testing.support.scenes import put_under
from ViTTransferFunction.Testing.support.views import Views, ball, pixels, slice_pixel

GREEN, BLUE = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
GEOMETRY = Geometry((32, 32, 32), np.eye(4))
CENTRE = np.array([16.0, 16.0, 16.0])
RADIUS, WIDTH = 8.0, 10.0
"""The map is 0.5 at this distance from the centre, and falls by 0.1 each millimetre."""
CONE = ball(GEOMETRY.shape, (16.0, 16.0, 16.0), RADIUS, WIDTH)
PROPOSALS = IsoProposals(smaller=0.8, chosen=0.5, larger=0.2)


def radius_of(iso: float) -> float:
    return RADIUS + WIDTH * (0.5 - iso)


def proposals(
    array: np.ndarray = CONE,
    isos: IsoProposals = PROPOSALS,
    size: float = 0.0,
    others: tuple[ClassMap, ...] = (),
    only_annotated_components: bool = True,
) -> Proposals:
    shown = ClassMap(array, GEOMETRY, isos.at(size), isos)
    return Proposals("liver", GREEN, shown, others, CENTRE[None], only_annotated_components)


def distances(surface: Any) -> np.ndarray:
    """Of all points of the surfaces from the centre, millimetres."""
    points = [vtk_to_numpy(part.GetPoints().GetData()) for part in surface if part.GetNumberOfPoints()]
    return np.linalg.norm(np.concatenate([*points, np.empty((0, 3))]) - CENTRE, axis=1)


def radii(of: Proposals) -> list[float]:
    """Of the spheres that are outlined, one for each proposal, in order."""
    found = distances(finished(outlines(of)))
    return [radius for radius in map(radius_of, (0.8, 0.5, 0.2)) if (np.abs(found - radius) < 0.6).any()]


@pytest.mark.parametrize(("size", "drawn"), [(0.0, [0.8, 0.2]), (1.0, [0.8, 0.5]), (-1.0, [0.5, 0.2]), (0.5, [0.8, 0.5, 0.2])])
def test_the_proposals_that_are_not_shown_are_outlined(size: float, drawn: list[float]) -> None:
    assert radii(proposals(size=size)) == [radius_of(iso) for iso in drawn]


def test_what_is_about_as_large_as_what_is_shown_or_outlined_already_is_not_outlined() -> None:
    almost_alike = IsoProposals(smaller=0.51, chosen=0.5, larger=0.49)
    assert not len(distances(finished(outlines(proposals(isos=almost_alike)))))
    found = distances(finished(outlines(proposals(isos=replace(almost_alike, larger=0.2)))))
    assert found.min() > radius_of(0.2) - 0.6


def test_parts_without_a_point_are_outlined_only_where_they_are_kept() -> None:
    twice = np.maximum(ball(GEOMETRY.shape, (16.0, 16.0, 16.0), 4.0, WIDTH), ball(GEOMETRY.shape, (4.0, 4.0, 4.0), 2.0, WIDTH))
    far = np.linalg.norm(CENTRE - 4.0) - 6.0
    assert distances(finished(outlines(proposals(twice)))).max() < far
    assert distances(finished(outlines(proposals(twice, only_annotated_components=False)))).max() > far


def test_what_another_class_claims_more_is_not_outlined() -> None:
    neighbour = np.zeros(GEOMETRY.shape, dtype=np.float32)
    neighbour[:, :, 20:] = 1.0
    surface = finished(outlines(proposals(others=(ClassMap(neighbour, GEOMETRY, 0.1),))))
    assert max(vtk_to_numpy(part.GetPoints().GetData())[:, 0].max() for part in surface) < 21.0


def greenness(view: Any, ras: np.ndarray) -> int:
    """Of the strongest pixel around where the view shows a point."""
    row, column = slice_pixel(view, ras)
    around = pixels(view)[row - 3 : row + 4, column - 3 : column + 4].astype(int)
    return int((around[..., 1] - around[..., 0]).max())


def finish(shown: ProposalOutlines) -> None:
    while shown.pending:
        shown.advance()


def test_outlines_are_seen_but_faintly_and_move_with_the_volume(slicer_app: Any) -> None:
    views = Views(slicer_app)
    view, shown = views.slice_view(), ProposalOutlines(views.scene)
    larger = CENTRE + radius_of(0.2) * np.array([0.0, 1.0, 0.0])
    assert greenness(view, larger) == 0
    shown.show(views.volume, proposals())
    finish(shown)
    assert 40 < greenness(view, larger) < 180
    matrix = np.eye(4)
    matrix[:3, 3] = (0.0, 0.0, 5.0)
    put_under(views.volume, matrix)
    shown.show(views.volume, proposals())
    finish(shown)
    assert greenness(view, larger + matrix[:3, 3]) > 40
    shown.hide()
    assert greenness(view, larger) == 0


def test_the_same_proposals_are_not_outlined_anew_and_others_are(slicer_app: Any) -> None:
    views = Views(slicer_app)
    shown = ProposalOutlines(views.scene)
    neighbour = ClassMap(0.5 * CONE, GEOMETRY, 0.1)
    first = proposals(others=(neighbour,))
    shown.show(views.volume, first)
    finish(shown)
    shown.show(views.volume, proposals(CONE.copy(), others=(replace(neighbour, array=0.5 * CONE),)))
    assert not shown.pending
    for other in (
        proposals(size=1.0, others=(neighbour,)),
        proposals(0.9 * CONE, others=(neighbour,)),
        proposals(others=(replace(neighbour, array=0.6 * CONE),)),
        proposals(others=(replace(neighbour, iso=0.2),)),
        proposals(),
        replace(first, points_ras=first.points_ras + 1.0),
        replace(first, color=BLUE),
    ):
        for changed in (other, first):
            shown.show(views.volume, changed)
            assert shown.pending
            finish(shown)


def test_scrolling_through_sizes_makes_each_surface_once(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = (0.0, 0.2, 0.5, 0.8, 1.0)
    anew = [distances(finished(outlines(proposals(size=size)))) for size in sizes]
    made_of: list[float] = []
    original = proposal_outlines.iso_surface

    def counted(of: ClassMap) -> Any:
        made_of.append(of.iso)
        return original(of)

    monkeypatch.setattr(proposal_outlines, "iso_surface", counted)
    made = Made()
    for size, expected in zip(sizes, anew, strict=True):
        np.testing.assert_array_equal(distances(finished(outlines(proposals(size=size), made))), expected)
    assert sorted(made_of) == [0.2, 0.5, 0.8]


def test_a_notch_of_the_wheel_does_not_begin_anew_what_is_under_way(slicer_app: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    views = Views(slicer_app)
    view, shown = views.slice_view(), ProposalOutlines(views.scene)
    monkeypatch.setattr(stepped_work, "ADVANCE_S", 0.0)
    notches = 0
    # A notch at each step of the work.
    while notches < 50 and not greenness(view, CENTRE + radius_of(0.8) * np.array([0.0, 1.0, 0.0])):
        shown.show(views.volume, proposals(size=0.5 + 0.001 * notches))
        shown.advance()
        notches += 1
    assert notches < 50


def test_another_class_s_outlines_are_gone_at_once_and_all_nodes_in_the_end(slicer_app: Any) -> None:
    views = Views(slicer_app)
    view, shown = views.slice_view(), ProposalOutlines(views.scene)
    larger = CENTRE + radius_of(0.2) * np.array([0.0, 1.0, 0.0])
    before = views.scene.GetNumberOfNodes()
    shown.show(views.volume, proposals())
    finish(shown)
    shown.show(views.volume, replace(proposals(), class_id="spleen"))
    assert greenness(view, larger) == 0
    shown.remove()
    assert views.scene.GetNumberOfNodes() == before
