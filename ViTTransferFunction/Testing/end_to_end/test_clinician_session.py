"""What a clinician does in an afternoon and the morning after, on a real CT with real features."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import array_from_node
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.scenes import add_parameter_node, add_segment, add_volume, segment_masks

GRID = 20
LIVER, SPLEEN, LEFT_KIDNEY = 5, 1, 3


@pytest.fixture
def torso(real_volume: Callable[[str], Path]) -> tuple[Volume, np.ndarray]:
    """The torso CT and its labels."""
    labels = sitk.ReadImage(str(real_volume("torso_small_labels.nii.gz")))
    return read_volume(real_volume("torso_small_ct.nii.gz")), sitk.GetArrayFromImage(labels)


@pytest.fixture
def session(slicer_app: Any, torso: tuple[Volume, np.ndarray], real_weights: Path) -> Iterator[SceneSession]:
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, add_parameter_node(slicer_app.scene))
    session.parameters.set("grid", GRID)
    session.parameters.set("weightsPath", str(real_weights))
    session.parameters.set("model", "dinov2_vits14_focus")
    yield session
    session.close()


def points_in(torso: tuple[Volume, np.ndarray], label: int, count: int) -> np.ndarray:
    """`count` points well inside a labelled organ and far from each other, RAS millimetres."""
    volume, labels = torso
    distance = sitk.GetArrayFromImage(
        sitk.SignedMaurerDistanceMap(sitk.GetImageFromArray((labels == label).astype(np.uint8)), insideIsPositive=True)
    )
    inside = np.argwhere(distance >= 0.6 * distance.max())
    chosen = [inside[0]]
    while len(chosen) < count:
        nearest = np.min([np.linalg.norm(inside - point, axis=1) for point in chosen], axis=0)
        chosen.append(inside[np.argmax(nearest)])
    return volume.geometry.ijk_to_ras_points(np.array(chosen)[:, ::-1])


def counts(session: SceneSession) -> list[tuple[str, int, int]]:
    return [(state.name, len(state.positive), len(state.negative)) for state in session.classes]


def test_an_afternoon_and_the_morning_after(
    slicer_app: Any, session: SceneSession, torso: tuple[Volume, np.ndarray], real_weights: Path, tmp_path: Path
) -> None:
    volume, labels = torso
    node = add_volume(slicer_app.scene, volume)
    # A segmentation of a colleague, whose two segments overlap each other and what will be segmented.
    segmentation = slicer_app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode", "of a colleague")
    lesion = np.zeros(volume.shape, dtype=bool)
    lesion[tuple(slice(c - 4, c + 4) for c in np.argwhere(labels == LIVER).mean(axis=0).astype(int))] = True
    add_segment(segmentation, "lesion", lesion, volume.geometry.ijk_to_ras)
    add_segment(segmentation, "left kidney", labels == LEFT_KIDNEY, volume.geometry.ijk_to_ras)
    colleague = segment_masks(segmentation, node)

    session.set_volume(node)
    session.wait()
    assert session.phase == "no features"
    assert session.estimate is not None
    assert not session.estimate.cached
    session.start_extraction()
    assert session.phase == "extracting"
    session.wait()
    assert (session.phase, session.take_error()) == ("ready", None)

    liver = session.annotations.add_class("liver").id
    session.annotations.add_points(liver, points_in(torso, LIVER, 3), positive=True)
    session.wait()
    first_iso = session.chosen_iso(liver)
    spleen = session.annotations.add_class("spleen").id
    session.annotations.add_points(spleen, points_in(torso, SPLEEN, 2), positive=True)
    session.annotations.add_points(liver, points_in(torso, LEFT_KIDNEY, 1), positive=False)
    session.wait()
    assert counts(session) == [("liver", 3, 1), ("spleen", 2, 0)]
    assert session.chosen_iso(liver) != first_iso

    session.annotations.points_node(spleen, positive=True).RemoveNthControlPoint(0)
    assert counts(session) == [("liver", 3, 1), ("spleen", 1, 0)]
    session.annotations.undo()
    assert counts(session) == [("liver", 3, 1), ("spleen", 2, 0)]
    session.annotations.undo()
    assert counts(session) == [("liver", 3, 0), ("spleen", 2, 0)]
    session.annotations.redo()
    assert counts(session) == [("liver", 3, 1), ("spleen", 2, 0)]

    session.set_segmentation(segmentation)
    session.segments.write()
    session.wait()
    assert session.take_error() is None
    masks = segment_masks(segmentation, node)
    assert list(masks) == ["lesion", "left kidney", "liver", "spleen"]
    for name in ("lesion", "left kidney"):
        np.testing.assert_array_equal(masks[name], colleague[name])
    assert not (masks["liver"] & lesion).any()
    assert dice(masks["liver"] | (lesion & (labels == LIVER)), labels == LIVER) > 0.65
    assert dice(masks["spleen"], labels == SPLEEN) > 0.6

    scene = tmp_path / "tomorrow.mrb"
    assert slicer_app.scene.WriteToMRB(str(scene))
    opened = the_morning_after(scene, real_weights, points_in(torso, LIVER, 4)[3])
    assert opened["error"] is None
    assert opened["before"] == [["liver", 3, 1], ["spleen", 2, 0]]
    assert opened["after"] == [["liver", 4, 1], ["spleen", 2, 0]]
    assert opened["cached"]
    assert opened["segments"] == ["lesion", "left kidney", "liver", "spleen"]
    assert opened["voxels"]["lesion"] == int(lesion.sum())
    assert opened["voxels"]["left kidney"] == int((labels == LEFT_KIDNEY).sum())
    # Nothing of this has changed the user's volume.
    np.testing.assert_array_equal(array_from_node(node), volume.array)


def test_clicks_are_answered_while_features_still_become_finer(
    slicer_app: Any, session: SceneSession, torso: tuple[Volume, np.ndarray]
) -> None:
    volume, labels = slab_through(torso, LIVER, slices=16)
    liver = session.annotations.add_class("liver").id
    session.annotations.add_points(liver, points_in((volume, labels), LIVER, 6), positive=True)
    session.parameters.set("grid", 32)
    # Without refinement, only other features give another iso value.
    session.parameters.set("refinement", "none")
    session.set_volume(add_volume(slicer_app.scene, volume))
    session.wait()
    session.start_extraction()
    answers = set()
    while session.phase == "extracting":
        session.poll()
        answers.add(session.chosen_iso(liver))
        time.sleep(0.002)
    session.wait()
    assert (session.phase, session.take_error()) == ("ready", None)
    assert answers - {None, session.chosen_iso(liver)}
    session.parameters.set("refinement", "bilateral")
    session.segments.write()
    session.wait()
    (mask,) = segment_masks(session.parameters.segmentation, session.parameters.volume).values()
    assert dice(mask, labels == LIVER) > 0.55


def slab_through(torso: tuple[Volume, np.ndarray], label: int, slices: int) -> tuple[Volume, np.ndarray]:
    """The axial slices around the middle of an organ, and their labels: an extraction of seconds on a real scan."""
    volume, labels = torso
    middle = round(np.argwhere(labels == label)[:, 0].mean())
    _, rows, columns = labels.shape
    box = (slice(middle - slices // 2, middle + slices // 2), slice(0, rows), slice(0, columns))
    return Volume(volume.array[box], volume.geometry.part(box), "slab"), labels[box]


def the_morning_after(scene: Path, weights: Path, point_ras: np.ndarray) -> dict[str, Any]:
    """Open the saved scene in a new process, add a point to the liver, write the segments again; what was found."""
    finished = subprocess.run(
        [
            sys.executable,
            "-m",
            "ViTTransferFunction.Testing.end_to_end.test_clinician_session",
            scene,
            json.dumps(point_ras.tolist()),
        ],
        env={**os.environ, "VITTF_WEIGHTS": str(weights)},
        cwd=Path(__file__).parents[3],
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    return json.loads(finished.stdout.rpartition("RESULT")[2])


def main() -> None:
    """The new process."""
    from trame_slicer.core import SlicerApp

    app = SlicerApp()
    session = SceneSession(app.scene, app.app_logic, add_parameter_node(app.scene))
    assert app.scene.ReadFromMRB(sys.argv[1])
    session.wait()
    assert session.phase == "ready", session.take_error()
    before = counts(session)
    session.annotations.add_points(session.classes[0].id, np.array([json.loads(sys.argv[2])]), positive=True)
    session.segments.write()
    session.wait()
    masks = segment_masks(session.parameters.segmentation, session.parameters.volume)
    found = {
        "error": session.take_error(),
        "cached": session.estimate is not None and session.estimate.cached,
        "before": before,
        "after": counts(session),
        "segments": list(masks),
        "voxels": {name: int(mask.sum()) for name, mask in masks.items()},
    }
    session.close()
    sys.stdout.write(f"RESULT{json.dumps(found)}")


if __name__ == "__main__":
    main()
