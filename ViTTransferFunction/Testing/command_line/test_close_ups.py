"""Close-ups that an annotation file asks for, boxes that it names or that are chosen from maps; and those that come unasked."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
import torch

from ViTTransferFunction.CommandLine.close_ups import requests_with_close_ups
from ViTTransferFunction.CommandLine.cohort.case_work import segment_case
from ViTTransferFunction.CommandLine.cohort.cases import Case
from ViTTransferFunction.CommandLine.cohort.job import CaseJob, CohortSettings
from ViTTransferFunction.CommandLine.segmenting import segment_classes
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.bounding_box import bounding_box
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.segmentation import ClassResult, Segmentation
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.download import sha256_of
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras, requests_of
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict

RED = (1.0, 0.0, 0.0)


class Listener:
    """A session on the spheres that remembers what it is asked to look at closely, and to segment, and does neither."""

    def __init__(self, spheres: Spheres, monkeypatch: pytest.MonkeyPatch) -> None:
        cache_known_features(*spheres)
        self.session = open_session(spheres[0], SessionSettings(grid=GRID))
        self.looked_at: list[ClassRequest] = []
        self.requests: list[ClassRequest] = []
        self.warnings: list[str] = []
        monkeypatch.setattr(self.session, "look_closer", lambda requests, *_: self.looked_at.extend(requests))
        monkeypatch.setattr(self.session, "segment", self._segment)

    def ask(self, classes: Sequence[AnnotatedClass]) -> list[CloseUp | None]:
        """The close-ups of the classes as they come to the session."""
        segment_classes(self.session, classes, "none", True, on_warning=self.warnings.append)
        return [request.close_up for request in self.requests]

    def _segment(self, requests: Sequence[ClassRequest], *_: Any) -> Segmentation:
        assert self.looked_at == requests, "segmented without its close-ups"
        self.requests.extend(requests)
        results = tuple(ClassResult(request.name, 0.5, 1, 0.1, True) for request in requests)
        return Segmentation(np.ones((1, 1, 1), np.uint8), results)


@pytest.fixture
def listener(spheres: Spheres, monkeypatch: pytest.MonkeyPatch) -> Listener:
    return Listener(spheres, monkeypatch)


def annotated(requests: Sequence[ClassRequest], *from_map: int) -> list[AnnotatedClass]:
    return [AnnotatedClass(request, RED, close_up_from_map=index in from_map) for index, request in enumerate(requests)]


def test_a_close_up_that_is_to_be_chosen_holds_the_structure_and_no_other_class_gets_one(
    listener: Listener, spheres: Spheres
) -> None:
    volume, labels = spheres
    none, chosen, _ = listener.ask(annotated(requests_of(spheres), 1))
    assert none is None
    assert chosen is not None
    assert not listener.warnings
    box, sphere = chosen.box_in(volume.geometry, centre_ras(spheres, 2)), bounding_box(labels == 2)
    assert sphere is not None
    for extent, inner in zip(box, sphere, strict=True):
        assert extent.start < inner.start < inner.stop < extent.stop
    assert np.linalg.norm(chosen.centre_ras - centre_ras(spheres, 2)) < 6.0, "a cell is as wide"


def test_a_box_that_a_file_names_reaches_the_session_as_it_is_and_a_chosen_one_does_not_depend_on_it(
    listener: Listener, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    (_, alone, _) = listener.ask(annotated(requests_of(spheres), 1))
    first, *others = requests_of(spheres)
    given = CloseUp(tuple(first.positive[0]), (40.0, 41.0, 42.0))
    beside = Listener(spheres, monkeypatch)
    assert beside.ask(annotated([replace(first, close_up=given), *others], 1)) == [given, alone, None]


def test_a_structure_whose_box_would_be_too_large_is_looked_at_in_the_whole_volume_with_a_warning(
    listener: Listener, spheres: Spheres
) -> None:
    points = np.concatenate([centre_ras(spheres, label) for label in (1, 2, 3)])
    assert listener.ask(annotated([ClassRequest("all of them", points)], 0)) == [None]
    (warning,) = listener.warnings
    assert warning.startswith("all of them: This structure's box fills ")
    assert warning.endswith("It is looked at in the whole scan.")


def test_a_box_away_from_all_points_of_its_class_is_refused_before_any_work(
    listener: Listener, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(SegmentationSession, "load_features", lambda *_: pytest.fail("features were loaded"))
    first, *others = requests_of(spheres)
    misplaced = replace(first, close_up=CloseUp(tuple(centre_ras(spheres, 3)[0]), (30.0, 30.0, 30.0)))
    with pytest.raises(
        InputError, match=r"close-up of class 'sphere 1' holds none of the class's 1 positive points: its centre"
    ):
        listener.ask(annotated([misplaced, *others]))


def test_a_box_that_holds_one_of_the_points_is_accepted(listener: Listener, spheres: Spheres) -> None:
    points = np.concatenate([centre_ras(spheres, 1), centre_ras(spheres, 3)])
    given = CloseUp(tuple(points[0]), (30.0, 30.0, 30.0))
    assert listener.ask(annotated([ClassRequest("two", points, close_up=given)])) == [given]


def outlined(spheres: Spheres, share: float) -> AnnotatedClass:
    """A class of what a circle around the middle of the second sphere encloses, so much as wide as that."""
    (volume, labels), middle = spheres, centre_ras(spheres, 2)
    radius_mm = (0.75 / np.pi * np.count_nonzero(labels == 2) * volume.geometry.voxel_volume_mm3) ** (1.0 / 3.0)
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    in_slice = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1) * share * radius_mm / volume.geometry.spacing_mm
    outline = volume.geometry.ijk_to_ras_points(volume.geometry.ras_to_ijk(middle) + in_slice)
    return AnnotatedClass(ClassRequest("outlined", *points_of_outline(outline, 1.0)), RED, outline_ras=outline)


@pytest.mark.parametrize(
    ("share", "method", "unasked"), [(0.5, "bilateral", True), (1.0, "bilateral", False), (0.5, "none", False)]
)
def test_what_is_small_and_unlike_its_outline_in_the_whole_is_looked_at_closely_with_a_warning(
    spheres: Spheres, monkeypatch: pytest.MonkeyPatch, share: float, method: RefinementMethod, unasked: bool
) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.core.classes.close_up_choice.LARGEST_SHARE", 1.0)
    cache_known_features(*spheres)
    session = open_session(spheres[0], SessionSettings(grid=GRID))
    session.load_features()
    warnings: list[str] = []
    first, *_ = requests_of(spheres)
    classes = [AnnotatedClass(first, RED), outlined(spheres, share)]
    clicked, drawn = requests_with_close_ups(session, classes, method, True, warnings.append)
    assert (clicked.close_up, drawn.close_up is not None) == (None, unasked)
    said = [warning.startswith("outlined: small, and in the whole scan unlike its outline") for warning in warnings]
    assert said == [True] * unasked


@pytest.fixture
def scan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """`vittf`'s arguments for a scan with one large structure, which its annotations ask to look at closely."""
    array = np.zeros((12, 16, 20), dtype=np.float32)
    array[3:9, 4:12, 4:17] = 100.0
    sitk.WriteImage(sitk.GetImageFromArray(array), str(tmp_path / "scan.nrrd"))
    entry: dict[str, Any] = {"name": "block", "positive": [[6, 8, 6], [14, 8, 6]], "close_up": True}
    (tmp_path / "scan.annotations.json").write_text(json.dumps({"coordinate_system": "IJK", "classes": [entry]}))
    monkeypatch.setitem(PRETRAINED_MODELS, "tiny", TINY_MODEL)
    torch.save(random_state_dict(TINY_MODEL), tmp_path / "tiny.pth")
    options = ["--model", "tiny", "--weights", str(tmp_path / "tiny.pth"), "--grid", "8", "--device", "cpu"]
    return [str(tmp_path / "scan.nrrd"), "--annotations", str(tmp_path / "scan.annotations.json"), *options]


def test_the_warning_is_for_whoever_called_vittf_and_the_segmentation_is_written(
    tmp_path: Path, scan: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    assert main(["segment", *scan, "-o", str(tmp_path / "out.nii.gz")]) == 0
    assert caplog.messages[-1].startswith("block: This structure's box fills ")
    assert (tmp_path / "out.nii.gz").exists()


def test_the_warning_stands_in_the_table_of_a_cohort(tmp_path: Path, scan: list[str]) -> None:
    weights = tmp_path / "tiny.pth"
    settings = SessionSettings(model="tiny", weights_path=str(weights), grid=8, device="cpu")
    case = Case("scan", Path(scan[0]), tmp_path / "scan.annotations.json")
    job = CaseJob(case, CohortSettings(settings, sha256_of(weights)), tmp_path)
    outcome = segment_case(job)
    assert outcome.status == "done"
    assert "block: This structure's box fills " in outcome.message
    again = job.finished()
    assert again is not None
    assert again.message == outcome.message
