"""From an opened volume and its classes to labels: what whoever called `vittf` is told of them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ViTTransferFunction.CommandLine.segmenting import segment_classes
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.volumes.thumbnail import Thumbnail
from ViTTransferFunction.Logic.files.annotation_files import read_annotations, write_annotations
from ViTTransferFunction.Logic.files.segmentation_files import read_segmentation, write_image
from ViTTransferFunction.Logic.refinement.refinement_methods import RefinementMethod
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras, requests_of


def warnings_of(spheres: Spheres, requests: list[ClassRequest], method: RefinementMethod = "none") -> list[str]:
    cache_known_features(*spheres)
    warnings: list[str] = []
    classes = [AnnotatedClass(request, (1.0, 0.0, 0.0)) for request in requests]
    session = open_session(spheres[0], SessionSettings(grid=GRID))
    segment_classes(session, classes, method, True, on_warning=warnings.append)
    return warnings


def test_of_classes_that_all_have_voxels_there_is_nothing_to_say(spheres: Spheres) -> None:
    assert warnings_of(spheres, list(requests_of(spheres))) == []


def test_a_class_that_loses_all_its_voxels_to_another_is_warned_of_with_its_name(spheres: Spheres) -> None:
    (warning,) = warnings_of(spheres, [*requests_of(spheres), ClassRequest("copy", centre_ras(spheres, 2))])
    assert warning.startswith("Class 'copy' has no voxel: whatever is similar")
    assert "its points lie in 'sphere 2'" in warning


@pytest.mark.parametrize("method", ["none", "bilateral"])
def test_a_class_whose_iso_value_is_reached_nowhere_is_warned_of(spheres: Spheres, method: RefinementMethod) -> None:
    first, *others = requests_of(spheres)
    (warning,) = warnings_of(spheres, [replace(first, iso=1.0, negative=centre_ras(spheres, 3)), *others], method)
    assert warning.startswith("Class 'sphere 1' has no voxel: nothing is as similar to its points as its threshold, iso 1.00")
    assert "Lower its 'iso'" in warning


def test_a_point_that_is_positive_and_negative_is_warned_of(spheres: Spheres) -> None:
    first, *others = requests_of(spheres)
    (warning,) = warnings_of(spheres, [replace(first, negative=np.concatenate([first.positive, others[0].positive])), *others])
    assert warning.startswith("Class 'sphere 1': of 1 positive points, 1 stand among the negative ones as well")


def test_a_point_where_the_scan_has_no_intensity_is_warned_of(spheres: Spheres) -> None:
    volume, labels = spheres
    array = volume.array.astype(np.float32)
    k, j, i = volume.geometry.nearest_voxels(centre_ras(spheres, 1)).T
    array[k, j, i] = np.nan
    (warning,) = warnings_of((replace(volume, array=array), labels), list(requests_of(spheres)))
    assert warning == (
        "Class 'sphere 1': 1 point inside lies where the scan has no intensity (NaN or infinite). Move it onto the structure."
    )


def test_points_that_were_placed_on_another_scan_are_warned_of(spheres: Spheres, tmp_path: Path) -> None:
    cache_known_features(*spheres)
    volume = spheres[0]

    def warnings_of_points_on(array: np.ndarray) -> list[str]:
        placed_on = Thumbnail.of(array, volume.geometry)
        classes = [AnnotatedClass(request, (1.0, 0.0, 0.0), placed_on=placed_on) for request in requests_of(spheres)]
        write_annotations(classes, tmp_path / "a.json")
        warnings: list[str] = []
        session = open_session(volume, SessionSettings(grid=GRID))
        classes = read_annotations(tmp_path / "a.json", volume.geometry)
        segment_classes(session, classes, "none", True, on_warning=warnings.append)
        return warnings

    assert warnings_of_points_on(1000.0 + 2.0 * volume.array) == []
    assert warnings_of_points_on(volume.array[::-1]) == [
        "The points were placed on a scan that looks different from 'spheres', perhaps another patient's. Check whether they "
        "belong to it."
    ]


@pytest.mark.parametrize("ending", [".nii.gz", ".seg.nrrd"])
def test_which_number_of_a_label_map_is_which_class_is_printed_and_reported(
    spheres: Spheres, tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str
) -> None:
    cache_known_features(*spheres)
    scan, points, output, report = (tmp_path / name for name in ("scan.nrrd", "a.json", f"out{ending}", "report.json"))
    write_image(scan, spheres[0].array, spheres[0].geometry)
    write_annotations([AnnotatedClass(request, (1.0, 0.0, 0.0)) for request in requests_of(spheres)], points)
    arguments = ["segment", str(scan), "--annotations", str(points), "--grid", str(GRID), "--refine", "none"]
    assert main([*arguments, "-o", str(output), "--report", str(report)]) == 0
    labels, printed = read_segmentation(output)[0], capsys.readouterr().out
    for label, entry in enumerate(json.loads(report.read_text())["classes"], start=1):
        assert (entry["name"], entry["label"], entry["voxels"]) == (f"sphere {label}", label, np.sum(labels == label))
        of_label_map = f"label {label}, " if ending == ".nii.gz" else ""
        assert f"  sphere {label}: {of_label_map}{entry['millilitres']:.1f} ml, " in printed
