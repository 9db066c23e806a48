"""What is drawn in a scan of a small specimen means what it means in one of a body that looks the same."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ViTTransferFunction.CommandLine.close_ups import requests_with_close_ups
from ViTTransferFunction.CommandLine.segmenting import segment_classes
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.volumes.geometry import SMALL_SCAN_MM, Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.annotation_files import classes_from_markups, write_annotations
from ViTTransferFunction.Logic.files.segmentation_files import write_image
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


def shrunk(volume: Volume, scale: float) -> Volume:
    """The same voxels, so much smaller."""
    return replace(volume, geometry=Geometry(volume.shape, np.diag([scale, scale, scale, 1.0]) @ volume.geometry.ijk_to_ras))


def drawn(path: Path, kind: str, middle_ras: np.ndarray, radius_mm: float, scale: float) -> Path:
    """A markup of Slicer's around a structure, or across it, in all so much smaller."""
    angles = np.linspace(0.0, 2.0 * np.pi, 12 if kind == "ClosedCurve" else 2, endpoint=False)
    points = middle_ras + radius_mm * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    placed = [{"position": point} for point in (scale * points).tolist()]
    path.write_text(json.dumps({"markups": [{"type": kind, "coordinateSystem": "RAS", "controlPoints": placed}]}))
    return path


def _body(spheres: Spheres) -> float:
    """The scale at which the volume is the smallest one in which lengths are those of bodies."""
    return SMALL_SCAN_MM / float(spheres[0].geometry.extent_mm.max())


def _session(spheres: Spheres, scale: float) -> SegmentationSession:
    volume, labels = spheres
    smaller = shrunk(volume, scale)
    cache_known_features(smaller, labels)
    return open_session(smaller, SessionSettings(grid=GRID))


def _drawn_classes(spheres: Spheres, folder: Path, kind: str, radius_mm: float, scale: float) -> list[AnnotatedClass]:
    """What is drawn of the first and of the third sphere."""
    middles = {str(label): centre_ras(spheres, label) for label in (1, 3)}
    paths = {name: drawn(folder / f"{name}.mrk.json", kind, middle, radius_mm, scale) for name, middle in middles.items()}
    return classes_from_markups(paths, {}, shrunk(spheres[0], scale).geometry)


@pytest.mark.parametrize(("kind", "radius_mm"), [("ClosedCurve", 15.0), ("Line", 15.0), ("Line", 4.0)])
@pytest.mark.parametrize("scale", [0.1, 0.03])
def test_the_same_drawing_gives_the_same_segments_in_a_scan_that_is_many_times_smaller(
    spheres: Spheres, tmp_path: Path, kind: str, radius_mm: float, scale: float
) -> None:
    body, specimen = (
        segment_classes(
            _session(spheres, size),
            _drawn_classes(spheres, tmp_path, kind, radius_mm, size),
            "bilateral",
            only_annotated_components=True,
        ).labels
        for size in (_body(spheres), scale * _body(spheres))
    )
    assert np.count_nonzero(body) > 1000
    # Voxels that are as likely either may turn over by rounding.
    assert np.count_nonzero(body != specimen) <= 2


def test_a_small_outline_is_looked_at_as_closely_in_a_scan_that_is_many_times_smaller(spheres: Spheres, tmp_path: Path) -> None:
    sizes: list[list[tuple[float, float, float]]] = []
    warnings: list[str] = []
    for scale in (_body(spheres), 0.03 * _body(spheres)):
        session = _session(spheres, scale)
        session.load_features()
        classes = _drawn_classes(spheres, tmp_path, "ClosedCurve", 4.0, scale)
        requests = requests_with_close_ups(session, classes, "bilateral", True, warnings.append)
        sizes.append([request.close_up.size_mm for request in requests if request.close_up is not None])
    body, specimen = sizes
    assert len(body) == 2
    np.testing.assert_allclose(specimen, 0.03 * np.array(body))
    assert warnings[0].endswith("in a box of 23 × 23 × 34 mm.")
    assert warnings[2].endswith("in a box of 0.68 × 0.68 × 1.0 mm.")


def test_the_report_and_what_is_printed_say_how_large_a_small_structure_is(
    spheres: Spheres, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    volume = shrunk(spheres[0], 0.03)
    cache_known_features(volume, spheres[1])
    scan, points, report = (tmp_path / name for name in ("scan.nrrd", "a.json", "report.json"))
    write_image(scan, volume.array, volume.geometry)
    request = ClassRequest("eye", 0.03 * centre_ras(spheres, 1))
    write_annotations([AnnotatedClass(request, (1.0, 0.0, 0.0))], points)
    arguments = ["segment", str(scan), "--annotations", str(points), "--grid", str(GRID), "--refine", "none"]
    assert main([*arguments, "-o", str(tmp_path / "out.seg.nrrd"), "--report", str(report)]) == 0
    (entry,) = json.loads(report.read_text())["classes"]
    assert entry["millilitres"] == pytest.approx(entry["voxels"] * volume.geometry.voxel_volume_mm3 / 1000.0, rel=1e-3)
    assert f"  eye: {1000.0 * entry['millilitres']:.2f} mm³, " in capsys.readouterr().out
