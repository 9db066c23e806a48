"""Counts of parts, tunnels and cavities, on shapes where they are known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from Benchmarks.shared.machine import machine
from Benchmarks.shared.shape_phantoms import sphere, torus
from Benchmarks.topology.topology import Topology, euler_number, topology_of
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS


def test_a_ball_is_one_part_and_nothing_else() -> None:
    assert topology_of(sphere(24)) == Topology(components=1, tunnels=0, cavities=0)
    assert topology_of(sphere(24)).euler == 1


def test_a_torus_has_one_tunnel() -> None:
    assert topology_of(torus(32)) == Topology(components=1, tunnels=1, cavities=0)
    assert topology_of(torus(32)).euler == 0


def test_a_hollow_ball_has_a_cavity() -> None:
    hollow = sphere(24) & ~sphere(24, radius=0.1)
    assert topology_of(hollow) == Topology(components=1, tunnels=0, cavities=1)
    assert topology_of(hollow).euler == 2


def test_two_balls_are_two_parts() -> None:
    two = sphere(32, (0.5, 0.5, 0.25), 0.15) | sphere(32, (0.5, 0.5, 0.75), 0.15)
    assert topology_of(two) == Topology(components=2, tunnels=0, cavities=0)


def test_voxels_that_share_a_corner_are_one_part() -> None:
    mask = np.zeros((4, 4, 4), dtype=bool)
    mask[1, 1, 1] = mask[2, 2, 2] = True
    assert topology_of(mask) == Topology(components=1, tunnels=0, cavities=0)


def test_a_mask_up_to_the_border_is_no_different() -> None:
    assert topology_of(np.ones((3, 4, 5), dtype=bool)) == Topology(components=1, tunnels=0, cavities=0)


def test_nothing_has_no_parts() -> None:
    assert topology_of(np.zeros((3, 3, 3), dtype=bool)) == Topology(0, 0, 0)


def test_the_euler_number_is_that_of_an_independent_count() -> None:
    measure = pytest.importorskip("skimage.measure")
    mask = np.random.default_rng(0).random((9, 10, 11)) < 0.3
    assert euler_number(mask) == measure.euler_number(mask, connectivity=3)


def test_the_features_of_all_axes_are_the_mean_of_those_of_one(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch
) -> None:
    from Benchmarks.topology import run as bench_topology

    monkeypatch.setitem(PRESETS, DEFAULT_PRESET, replace(PRESETS[DEFAULT_PRESET], features=FeatureSettings(grid=6)))
    volume, _ = spheres
    alone = [bench_topology.features_of_axes(volume, tiny_network, (axis,)).array.astype(np.float32) for axis in range(3)]
    together = bench_topology.features_of_axes(volume, tiny_network, (0, 1, 2))
    np.testing.assert_allclose(sum(alone), together.array, atol=2e-3 * np.abs(together.array).max())
    assert np.abs(alone[0] - alone[1]).max() > 0.01


def test_a_shape_is_measured_refined_and_not(tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch) -> None:
    from Benchmarks.topology.run import REFINEMENTS, measure_shape

    monkeypatch.setitem(PRESETS, DEFAULT_PRESET, replace(PRESETS[DEFAULT_PRESET], features=FeatureSettings(grid=6)))
    measured = json.loads(json.dumps(measure_shape("sphere", 24, 0.0, 2, tiny_network, (0,))))
    assert [row["refinement"] for row in measured["rows"]] == list(REFINEMENTS)
    assert {row["true_euler"] for row in measured["rows"]} == {1}
    assert np.shape(measured["middle_slices"]) == (len(REFINEMENTS), 24, 24)


def test_boundaries_are_measured_in_voxels_where_anything_was_found() -> None:
    from Benchmarks.topology.run import boundary_figures

    ball = sphere(24)
    assert boundary_figures(ball, ball) == {"dice": 1.0, "mean_voxels": 0.0, "p95_voxels": 0.0, "within_one_voxel": 1.0}
    assert boundary_figures(np.zeros_like(ball), ball) == {"dice": 0.0}


def test_a_transfer_function_shows_what_is_bright_large_and_in_its_box(tmp_path: Path) -> None:
    from Benchmarks.topology.run import FineStructure

    array = np.zeros((20, 20, 20), dtype=np.uint8)
    array[4:10, 4:10, 4:10] = 200
    array[15, 4, 4] = 200
    array[4:10, 4:10, 14:20] = 200
    sitk.WriteImage(sitk.GetImageFromArray(array), tmp_path / "volume.nrrd")
    structure = FineStructure("cube", "volume.nrrd", 150.0, ((0.0, 1.0), (0.0, 1.0), (0.0, 0.6)), smallest_part=10)
    expected = np.zeros(array.shape, dtype=bool)
    expected[4:10, 4:10, 4:10] = True
    np.testing.assert_array_equal(structure.read(tmp_path).truth == 1, expected)


def test_the_report_names_what_was_found_and_what_is_true(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    from Benchmarks.topology.report import COLUMNS, write_report

    row = {"shape": "torus", "noise": 0.0, "features": "three axes", "refinement": "bilateral", "dice": 0.99}
    row |= {"euler": 1, "true_euler": 0, "components": 1, "tunnels": 0, "cavities": 0, "feature_seconds": 5.0}
    detail = {"structure": "enamel", "clicks": 5, "refinement": "bilateral", "dice": 0.9, "mean_voxels": 0.4}
    detail |= {"p95_voxels": 1.0, "within_one_voxel": 0.96}
    ring = torus(16)[:, :, 8]
    pictures = {("torus", features, refinement): ring for features, refinement, _ in COLUMNS}
    write_report(
        {"model": "m", "machine": machine("cpu"), "size": 16, "clicks": 5, "shapes": [row], "details": [detail]},
        pictures,
        tmp_path,
    )
    text = (tmp_path / "topology.md").read_text(encoding="utf-8")
    assert "| torus | 0 | three axes | bilateral | 0.9900 | 1 (0) | 1 | 0 | 0 | 5.0 |" in text
    summary = json.loads((tmp_path / "topology.json").read_text(encoding="utf-8"))["summary"]
    assert summary["euler"] == {"torus, noise 0": 1}
    assert summary["boundary_distance_voxels"] == {"enamel": 0.4}
    assert (tmp_path / "topology.webp").stat().st_size > 0
