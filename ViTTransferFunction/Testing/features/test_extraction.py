"""Slices through the network, and their keys into one volume."""

from __future__ import annotations

import math
import threading
import time
import weakref
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.system.errors import Cancelled, InputError
from ViTTransferFunction.Logic.core.system.progress import Between, nothing_between
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.orientation import Orientation, canonical_orientation
from ViTTransferFunction.Logic.core.volumes.resampling import sample_at
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features import extraction
from ViTTransferFunction.Logic.features.buffer_pool import BufferPool
from ViTTransferFunction.Logic.features.extraction import extract_features, features_size_bytes
from ViTTransferFunction.Logic.features.extraction_plan import ExtractionPlan
from ViTTransferFunction.Logic.features.packed_slices import PatchTokens
from ViTTransferFunction.Logic.features.settings import FeatureSettings, feature_key, grid_shape
from ViTTransferFunction.Logic.features.slice_sampling import slice_samples
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.session.presets import PRESETS
from ViTTransferFunction.Testing.support.cancelling import cancel_at_once
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, TINY_ROTARY_MODEL, random_state_dict
from ViTTransferFunction.Testing.support.torch_threads import torch_threads
from ViTTransferFunction.Testing.support.volumes import stored_as, volume_of

CPU = torch.device("cpu")
WINDOW = IntensityWindow(0.0, 1.0)


class MeanIntensityNetwork(VisionTransformer):
    """In the network's place: a patch's key is the mean of its pixels, so that pooling has a known answer."""

    def __init__(self) -> None:
        self.model = TINY_MODEL
        self.device = torch.device("cpu")
        self.weights_digest = "mean"

    def converted(self, device: torch.device | str, dtype: torch.dtype) -> VisionTransformer:
        return self

    def keys_of_tokens(
        self, slices: Sequence[PatchTokens], workspace: BufferPool | None = None, between: Between = nothing_between
    ) -> torch.Tensor:
        channels = torch.cat([of_slice.patches for of_slice in slices]).unflatten(1, (3, -1)).mean(dim=2)
        means = (channels * torch.tensor([0.229, 0.224, 0.225]) + torch.tensor([0.485, 0.456, 0.406])).mean(dim=1)
        return means[:, None].expand(-1, self.model.embed_dim)


def block_means(array: np.ndarray, size: int) -> np.ndarray:
    k, j, i = (n // size for n in array.shape)
    return array.reshape(k, size, j, size, i, size).mean(axis=(1, 3, 5))


def test_pooling_every_slice_gives_the_mean_of_each_cell() -> None:
    array = np.random.default_rng(0).random((16, 24, 32)).astype(np.float32)
    settings = FeatureSettings(grid=8, isotropic=False, every_slice=True, window=WINDOW)
    features = extract_features(volume_of(array), MeanIntensityNetwork(), settings)
    assert features.array.shape == (4, 6, 8, TINY_MODEL.embed_dim)
    np.testing.assert_allclose(features.array[..., 0], block_means(array, 4), atol=1e-3)


def test_features_follow_the_axes_of_the_volume() -> None:
    ramps = np.meshgrid(*[np.linspace(0.0, 1.0, n) for n in (16, 24, 32)], indexing="ij")
    for axis, ramp in enumerate(ramps):
        settings = FeatureSettings(grid=8, window=WINDOW)
        features = extract_features(volume_of(ramp.astype(np.float32)), MeanIntensityNetwork(), settings).array[..., 0]
        across = np.moveaxis(features, axis, 0).reshape(features.shape[axis], -1)
        assert (np.diff(across[:, 0].astype(float)) > 0.05).all()
        np.testing.assert_allclose(across.max(axis=1), across.min(axis=1), atol=1e-3)


@given(st.integers(1, 300), st.integers(1, 80), st.sampled_from([(True, 1), (False, 1), (False, 2), (False, 3)]))
def test_slice_weights_of_every_layer_add_up_to_one(slices: int, layers: int, sampling: tuple[bool, int]) -> None:
    samples = slice_samples(slices, layers, *sampling)
    totals = np.zeros(layers)
    for sample in samples:
        assert 0.0 <= sample.position <= slices - 1
        for layer, weight in sample.layers:
            totals[layer] += weight
    np.testing.assert_allclose(totals, 1.0)


def test_every_slice_pools_as_adaptive_average_pooling_does() -> None:
    values = torch.rand(1, 1, 157, dtype=torch.float64)
    pooled = torch.zeros(64, dtype=torch.float64)
    for sample in slice_samples(157, 64, every_slice=True):
        for layer, weight in sample.layers:
            pooled[layer] += weight * values[0, 0, int(sample.position)]
    torch.testing.assert_close(pooled, torch.nn.functional.adaptive_avg_pool1d(values, 64)[0, 0])


def test_one_slice_a_layer_runs_through_the_layers_centres() -> None:
    assert [sample.position for sample in slice_samples(8, 4, every_slice=False)] == [0.5, 2.5, 4.5, 6.5]


def test_skipped_layers_are_interpolated_and_the_last_is_always_run() -> None:
    samples = slice_samples(8, 8, every_slice=False, layer_step=3)
    assert [sample.position for sample in samples] == [0.0, 3.0, 6.0, 7.0]
    third = 1.0 / 3.0
    assert dict(samples[1].layers) == pytest.approx({1: third, 2: 2 * third, 3: 1.0, 4: 2 * third, 5: third})


def test_fewer_patches_than_cells_give_the_same_features_on_the_same_cells() -> None:
    ramp = np.broadcast_to(np.linspace(0.0, 1.0, 48, dtype=np.float32), (48, 48, 48))
    settings = FeatureSettings(grid=24, window=WINDOW, merge_background=False)
    fine = extract_features(volume_of(ramp), MeanIntensityNetwork(), settings)
    half = replace(settings, most_patches=3 * 12**3)
    assert ExtractionPlan(volume_of(ramp), half).shape == (12, 12, 12)
    coarse = extract_features(volume_of(ramp), MeanIntensityNetwork(), half)
    assert coarse.array.shape[:3] == (12, 12, 12)
    assert coarse.cells.shape == fine.cells.shape
    found = sample_at(coarse.array, coarse.geometry, fine.geometry.voxel_centres_ras()).reshape(fine.array.shape)
    np.testing.assert_allclose(found[:, :, 1:-1], fine.array[:, :, 1:-1].astype(float), atol=5e-3)


def test_cells_are_cubes_in_millimetres() -> None:
    geometry = Geometry((40, 100, 200), np.diag([1.0, 1.0, 5.0, 1.0]))
    assert grid_shape(geometry, FeatureSettings(grid=20)) == (20, 10, 20)
    assert grid_shape(geometry, FeatureSettings(grid=20, isotropic=False)) == (4, 10, 20)


def test_a_long_volume_has_smaller_cells_but_no_more_than_a_cube() -> None:
    settings = FeatureSettings(grid=64, largest_cell_mm=8.0)

    def cells(*edges_mm: float) -> tuple[int, int, int]:
        return grid_shape(Geometry((100, 100, 100), np.diag([edge / 100.0 for edge in edges_mm[::-1]] + [1.0])), settings)

    assert cells(512.0, 100.0, 200.0) == (64, 12, 25), "they are small enough"
    assert cells(628.0, 406.0, 406.0) == (79, 51, 51)
    assert cells(1000.0, 1000.0, 1000.0) == (64, 64, 64), "a cube has them all"
    in_long = cells(1000.0, 400.0, 500.0)
    assert 64 < in_long[0] < 1000.0 / 8.0
    assert 0.9 * 64**3 < math.prod(in_long) <= 64**3
    assert cells(2000.0, 100.0, 100.0) == (128, 6, 6), "a grid has no more along an edge"
    settings = settings.with_grid(32)
    assert cells(1000.0, 500.0, 400.0) == (32, 16, 13), "as many as the user asks for"


def test_a_volume_that_is_stored_turned_has_the_same_cells() -> None:
    settings = FeatureSettings(grid=64, largest_cell_mm=8.0)
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]]
    straight = Geometry((90, 110, 520), np.diag([1.0, 1.0, 1.0, 1.0]))
    for turns in range(1, 8):
        turned = Geometry(straight.shape, np.linalg.matrix_power(turn, turns) @ straight.ijk_to_ras)
        assert grid_shape(turned, settings) == grid_shape(straight, settings)


@pytest.mark.parametrize("shape", [(170, 256, 256), (99, 128, 128), (100, 400, 512), (48, 64, 512)])
def test_an_edge_that_is_half_a_cell_longer_has_the_same_cells_however_it_is_turned_and_rounded(
    shape: tuple[int, int, int],
) -> None:
    straight = Geometry(shape, np.diag([0.78125, 0.78125, 0.78125, 1.0]))
    for settings in (FeatureSettings(grid=64), FeatureSettings(grid=32, largest_cell_mm=4.0)):
        for angle in np.linspace(0.1, 1.5, 20):
            turn = np.eye(4)
            turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            turned = turn[[1, 2, 0, 3]] @ turn @ straight.ijk_to_ras
            for matrix in (turned, turned.astype(np.float32)):
                assert grid_shape(Geometry(shape, matrix), settings) == grid_shape(straight, settings)


def test_the_papers_preset_is_repeatable_bit_for_bit(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer
) -> None:
    settings = replace(PRESETS["paper"].features, grid=8)
    first = extract_features(spheres[0], tiny_network, settings)
    second = extract_features(spheres[0], tiny_network, settings)
    np.testing.assert_array_equal(first.array, second.array)
    assert len(first.array) == round(32 / 48 * 8)


def test_one_slice_a_layer_is_close_to_every_slice(spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer) -> None:
    settings = FeatureSettings(grid=12)
    sampled = extract_features(spheres[0], tiny_network, settings).array.astype(float)
    pooled = extract_features(spheres[0], tiny_network, replace(settings, every_slice=True)).array.astype(float)
    cosine = (sampled * pooled).sum(-1) / np.linalg.norm(sampled, axis=-1) / np.linalg.norm(pooled, axis=-1)
    assert cosine.mean() > 0.99


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_between_infinities_of_either_sign_features_are_finite_and_nobody_is_warned(tiny_network: VisionTransformer) -> None:
    """As in a scan of ratios or logarithms, which has both where there is next to no signal."""
    random = np.random.default_rng(0)
    array = random.normal(0.0, 100.0, (16, 16, 16)).astype(np.float32)
    array[8:] = random.choice([-np.inf, np.inf], (8, 16, 16))
    features = extract_features(volume_of(array), tiny_network, FeatureSettings(grid=5))
    assert np.isfinite(features.array).all()


def test_voxels_that_are_not_finite_or_metal_leave_the_rest_as_it_is(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer
) -> None:
    volume, _ = spheres
    damaged = volume.array.copy()
    damaged[16, 20, 24], damaged[16, 20, 25], damaged[16, 20, 26] = np.nan, np.inf, 30_000.0
    settings = FeatureSettings(grid=8)
    clean = extract_features(volume, tiny_network, settings).array.astype(float)
    features = extract_features(Volume(damaged, volume.geometry), tiny_network, settings).array.astype(float)
    assert np.isfinite(features).all()
    far = np.ones(clean.shape[:3], dtype=bool)
    far[clean.shape[0] // 2 - 1 : clean.shape[0] // 2 + 1, 2:6, 2:6] = False
    cosine = (clean * features).sum(-1) / np.linalg.norm(clean, axis=-1) / np.linalg.norm(features, axis=-1)
    assert cosine[far].min() > 0.98


def test_progress_reaches_its_total_and_can_cancel(spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer) -> None:
    reports: list[tuple[int, int]] = []
    extract_features(spheres[0], tiny_network, FeatureSettings(grid=8), lambda done, total, _: reports.append((done, total)))
    assert reports[0][0] == 0
    assert reports[-1][0] == reports[-1][1] == sum((8, 7, 8))

    with pytest.raises(Cancelled):
        extract_features(spheres[0], tiny_network, FeatureSettings(grid=8), cancel_at_once)


@pytest.mark.parametrize("rotary", [False, True], ids=["position table", "rotary positions"])
def test_features_are_the_same_bits_with_any_number_of_threads(spheres: tuple[Volume, np.ndarray], rotary: bool) -> None:
    model = TINY_ROTARY_MODEL if rotary else TINY_MODEL
    network = VisionTransformer(model, random_state_dict(model), "tiny")

    def features(threads: int) -> np.ndarray:
        with torch_threads(threads):
            return extract_features(spheres[0], network, FeatureSettings(grid=24)).array

    expected = features(1)
    for threads in (2, 5):
        np.testing.assert_array_equal(features(threads), expected)


@pytest.mark.parametrize("threads", [1, 3])
def test_what_is_cancelled_ends_while_a_slice_is_run(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, threads: int
) -> None:
    told: list[int] = []

    def cancel_before_a_slice_is_done(done: int, total: int, what: str) -> None:
        told.append(done)
        if len(told) > 1:
            raise Cancelled

    with torch_threads(threads), pytest.raises(Cancelled):
        extract_features(spheres[0], tiny_network, FeatureSettings(grid=24), cancel_before_a_slice_is_done)
    assert set(told) == {0}


def test_after_cancelling_no_thread_goes_on(spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer) -> None:
    def cancel_after_a_batch(done: int, total: int, what: str) -> None:
        if done:
            raise Cancelled

    before = set(threading.enumerate())
    with torch_threads(2):
        with pytest.raises(Cancelled):
            extract_features(spheres[0], tiny_network, FeatureSettings(grid=24), cancel_after_a_batch)
        assert torch.get_num_threads() == 2
    assert set(threading.enumerate()) == before


class FailingNetwork(MeanIntensityNetwork):
    """Fails on one slice when another batch has been begun, which goes on until it is cancelled."""

    def __init__(self, fails_on: torch.Tensor) -> None:
        super().__init__()
        self.fails_on = fails_on
        self.begun, self.cancelled = threading.Event(), False

    def keys_of_tokens(
        self, slices: Sequence[PatchTokens], workspace: BufferPool | None = None, between: Between = nothing_between
    ) -> torch.Tensor:
        if torch.equal(slices[0].patches, self.fails_on):
            assert self.begun.wait(LONGEST_WAIT_S)
            raise InputError("This cannot be computed.")
        self.begun.set()
        ends = time.monotonic() + LONGEST_WAIT_S
        while time.monotonic() < ends:
            try:
                between()
            except Cancelled:
                self.cancelled = True
                raise
            time.sleep(0.001)
        raise AssertionError("nobody cancelled it")


def test_after_an_error_other_threads_do_not_go_on_with_their_slices(spheres: tuple[Volume, np.ndarray]) -> None:
    settings = FeatureSettings(grid=24)
    plan = ExtractionPlan(spheres[0], settings)
    first, patches = plan.slices[0], plan.patches(TINY_MODEL.patch_size, CPU)[0]
    network = FailingNetwork(patches.tokens(first.sample.position, first.chosen).patches)
    with torch_threads(2), pytest.raises(InputError, match="cannot be computed"):
        extract_features(spheres[0], network, settings)
    assert network.cancelled


@given(st.permutations(range(3)), st.tuples(*[st.booleans()] * 3))
def test_features_do_not_depend_on_how_the_voxels_are_stored(order: list[int], mirrored: tuple[bool, bool, bool]) -> None:
    array = np.random.default_rng(0).random((8, 10, 12)).astype(np.float32)
    network = VisionTransformer(TINY_MODEL, random_state_dict(TINY_MODEL), "tiny")
    settings = FeatureSettings(grid=4, window=WINDOW)
    geometry = Geometry(array.shape, np.diag([1.0, 1.0, 1.0, 1.0]))
    expected = extract_features(Volume(array, geometry), network, settings).array

    stored = Orientation((order[0], order[1], order[2]), mirrored)
    features = extract_features(stored_as(Volume(array, geometry), stored), network, settings).array

    restored = np.empty(expected.shape, expected.dtype)
    stored.to_canonical(restored)[...] = features
    np.testing.assert_array_equal(restored, expected)


def test_canonical_axes_point_to_inferior_posterior_and_left() -> None:
    lps = Geometry((4, 5, 6), np.diag([-1.0, -1.0, 1.0, 1.0]))
    assert canonical_orientation(lps) == Orientation((0, 1, 2), (True, False, False))
    turned = np.array([[0.1, 0.0, -1.0, 0.0], [1.0, 0.0, 0.1, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    assert canonical_orientation(Geometry((4, 5, 6), turned)) == Orientation((1, 2, 0), (False, True, False))


def test_the_announced_size_is_the_size(spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer) -> None:
    settings = FeatureSettings(grid=8)
    features = extract_features(spheres[0], tiny_network, settings)
    assert features.array.nbytes == features_size_bytes(spheres[0].geometry, settings, TINY_MODEL)


OTHER_SETTINGS: list[dict[str, Any]] = [
    {"grid": 65},
    {"most_patches": 500},
    {"layer_step": 2},
    {"isotropic": False},
    {"canonical": False},
    {"every_slice": True},
    {"merge_background": False},
    {"window": WINDOW},
    {"precision": "float16"},
]


def test_the_key_changes_with_everything_that_the_features_depend_on(spheres: tuple[Volume, np.ndarray]) -> None:
    volume, _ = spheres
    settings = FeatureSettings()
    base = feature_key(volume, "model", "weights", settings, CPU)
    other_array = volume.array.copy()
    other_array[0, 0, 0] += 1
    moved = Geometry(volume.shape, volume.geometry.ijk_to_ras + np.diag([0.1, 0.0, 0.0, 0.0]))
    others = {
        feature_key(Volume(other_array, volume.geometry), "model", "weights", settings, CPU),
        feature_key(Volume(volume.array, moved), "model", "weights", settings, CPU),
        feature_key(volume, "other", "weights", settings, CPU),
        feature_key(volume, "model", "other", settings, CPU),
        *(feature_key(volume, "model", "weights", replace(settings, **change), CPU) for change in OTHER_SETTINGS),
    }
    assert len(others) == 4 + len(OTHER_SETTINGS)
    assert base not in others
    assert base == feature_key(Volume(volume.array.copy(), volume.geometry, "renamed"), "model", "weights", settings, CPU)


def turned(geometry: Geometry, degrees: float) -> Geometry:
    """A grid turned about the axis from head to feet, and shifted, as by a registration."""
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.array([[cos, -sin, 0.0, 12.3], [sin, cos, 0.0, -45.6], [0.0, 0.0, 1.0, 7.8], [0.0, 0.0, 0.0, 1.0]])
    return Geometry(geometry.shape, matrix @ geometry.ijk_to_ras)


def test_a_volume_that_was_moved_has_the_same_features_and_key() -> None:
    volume = volume_of(np.random.default_rng(0).random((12, 16, 20)).astype(np.float32), (0.8, 0.7, 2.5))
    moved = Volume(volume.array, turned(volume.geometry, 20.0))
    settings = FeatureSettings(grid=8, window=WINDOW)
    before, after = (extract_features(of, MeanIntensityNetwork(), settings) for of in (volume, moved))
    np.testing.assert_array_equal(before.array, after.array)
    assert before.key == after.key
    placed = before.placed_in(moved.geometry)
    np.testing.assert_array_equal(placed.geometry.ijk_to_ras, after.geometry.ijk_to_ras)
    np.testing.assert_array_equal(placed.cells.ijk_to_ras, after.cells.ijk_to_ras)


def test_a_volume_that_lies_on_its_side_has_another_key() -> None:
    volume = volume_of(np.random.default_rng(0).random((12, 16, 20)).astype(np.float32))
    upright, side, upside_down = (
        feature_key(Volume(volume.array, turned(volume.geometry, degrees)), "model", "weights", FeatureSettings(), CPU)
        for degrees in (40.0, 50.0, 180.0)
    )
    assert len({upright, side, upside_down}) == 3


@given(st.integers(50, 600), st.sampled_from([256, 320, 512, 768, 1024]), st.floats(-40.0, 40.0))
def test_spacings_of_usual_scans_are_not_rounded_apart(field_of_view_mm: int, pixels: int, degrees: float) -> None:
    spacing = field_of_view_mm / pixels
    volume = volume_of(np.arange(8.0).reshape(2, 2, 2), (spacing, spacing, 3.0))
    moved = Volume(volume.array, turned(volume.geometry, degrees))
    keys = {feature_key(of, "model", "weights", FeatureSettings(), CPU) for of in (volume, moved)}
    assert len(keys) == 1


@pytest.mark.parametrize("scale", [1e-9, 1e-6, 1e-4, 1e-2, 1.0])
def test_the_proportions_of_voxels_are_told_apart_however_small_they_are(scale: float) -> None:
    array = np.arange(8.0).reshape(2, 2, 2)
    cubes, slabs, again = (
        feature_key(volume_of(array, (scale, scale, k * scale)), "model", "weights", FeatureSettings(), CPU)
        for k in (1.0, 1.1, 1.0 + 1e-12)
    )
    assert cubes == again != slabs


@pytest.mark.parametrize("grid", [3, 129, -1])
def test_a_grid_out_of_range_is_refused(grid: int) -> None:
    with pytest.raises(InputError, match=f"4 to 128 cells; got {grid}"):
        FeatureSettings(grid=grid)


def test_no_patches_at_all_are_refused() -> None:
    with pytest.raises(InputError, match="1 patch or more; got 0"):
        FeatureSettings(most_patches=0)


@pytest.mark.parametrize("fields", [{"layer_step": 0}, {"layer_step": 2, "every_slice": True}])
def test_layers_are_skipped_or_pooled(fields: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="layer_step must be 1 or more"):
        FeatureSettings(**fields)


@pytest.mark.parametrize("threads", [1, 2])
def test_memory_is_given_back_when_no_thread_has_any_left(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch, threads: int
) -> None:
    in_use, begin, left = weakref.WeakSet[BufferPool](), BufferPool.__init__, list[int]()

    def buffers_begin(pool: BufferPool) -> None:
        begin(pool)
        in_use.add(pool)

    monkeypatch.setattr(BufferPool, "__init__", buffers_begin)
    monkeypatch.setattr(extraction, "give_back_freed_memory", lambda: left.append(len(in_use)))
    with torch_threads(threads):
        extract_features(spheres[0], tiny_network, FeatureSettings(grid=8))
    assert left == [0]
