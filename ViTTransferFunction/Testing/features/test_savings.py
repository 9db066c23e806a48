"""What each saving changes, on a real volume and with real weights: no more than its bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.volumes.resampling import sample_at
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.background_tokens import TokenSelection
from ViTTransferFunction.Logic.features.extraction import extract_features
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.packed_slices import PatchTokens
from ViTTransferFunction.Logic.features.progressive import progressive_features
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.slice_patches import SlicePatches
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.features.whitening import normalised_features, unit_vectors
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.weights.models import pretrained_model
from ViTTransferFunction.Logic.weights.state_dict import load_state_dict

FULL = FeatureSettings(grid=16, merge_background=False, precision="float32")
MERGED = replace(FULL, merge_background=True)


@pytest.fixture(scope="module")
def kept() -> dict[FeatureSettings, np.ndarray]:
    """Features that were extracted, which no test can write to; each is extracted by the first test that asks for it."""
    return {}


@pytest.fixture
def torso(real_volume: Callable[[str], Path]) -> Volume:
    return read_volume(real_volume("torso_small_ct.nii.gz"))


@pytest.fixture
def network(real_weights: Path) -> VisionTransformer:
    return VisionTransformer(pretrained_model("dinov2_vits14_focus"), load_state_dict(real_weights), "real")


@pytest.fixture
def extracted(
    torso: Volume, network: VisionTransformer, kept: dict[FeatureSettings, np.ndarray]
) -> Callable[[FeatureSettings], FeatureVolume]:
    """Gives the torso's features by their settings."""

    def of(settings: FeatureSettings) -> FeatureVolume:
        if settings not in kept:
            kept[settings] = extract_features(torso, network, settings).array
            kept[settings].setflags(write=False)
        return FeatureVolume(kept[settings], torso.geometry.resized(kept[settings].shape[:3]), "kept")

    return of


@pytest.fixture
def full(extracted: Callable[[FeatureSettings], FeatureVolume]) -> FeatureVolume:
    """The features without any saving."""
    return extracted(FULL)


def whitened_error(features: FeatureVolume, full: FeatureVolume, inside: np.ndarray) -> float:
    """Mean 1 − cosine over the cells `inside`, after whitening by the full features' statistics."""
    normalised = normalised_features(full, "whitened")
    centres = full.geometry.voxel_centres_ras()[inside.ravel()]
    vectors = unit_vectors(normalised.transform.apply(sample_at(features.array, features.geometry, centres)))
    return float((1.0 - (vectors * normalised.array[inside]).sum(axis=1)).mean())


def body(torso: Volume, full: FeatureVolume) -> np.ndarray:
    """Cells brighter than fat, (K', J', I') bool."""
    intensities = sample_at(torso.array[..., None], torso.geometry, full.geometry.voxel_centres_ras())
    return intensities.reshape(full.geometry.shape) > -150


@pytest.mark.parametrize(
    ("change", "bound"),
    [
        ({"merge_background": True}, 0.003),
        ({"precision": "bfloat16"}, 0.003),
        ({"layer_step": 2}, 0.35),
        ({"most_patches": 3 * 12**3}, 0.5),
    ],
    ids=["background merged", "bfloat16", "every 2nd layer", "fewer patches"],
)
def test_a_saving_changes_the_bodys_features_by_no_more_than_its_bound(
    torso: Volume,
    extracted: Callable[[FeatureSettings], FeatureVolume],
    full: FeatureVolume,
    change: dict[str, object],
    bound: float,
) -> None:
    saving = extracted(replace(FULL, **change))  # type: ignore[arg-type]
    assert 0.0 < whitened_error(saving, full, body(torso, full)) < bound


def tokens_that_count_once(
    patches: SlicePatches, position: float, chosen: TokenSelection, tokens: Any = SlicePatches.tokens
) -> PatchTokens:
    """In the place of `SlicePatches.tokens`: patches that represent background count for themselves alone."""
    of_slice = tokens(patches, position, chosen)
    return of_slice if of_slice.multiplicity is None else replace(of_slice, multiplicity=torch.ones_like(of_slice.multiplicity))


def test_leaving_background_out_without_a_count_changes_far_more(
    torso: Volume,
    network: VisionTransformer,
    extracted: Callable[[FeatureSettings], FeatureVolume],
    full: FeatureVolume,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What the weights of the patches that represent background are for."""
    counted = extracted(MERGED)
    monkeypatch.setattr(SlicePatches, "tokens", tokens_that_count_once)
    uncounted = extract_features(torso, network, MERGED)
    inside = body(torso, full)
    assert whitened_error(uncounted, full, inside) > 3.0 * whitened_error(counted, full, inside)


def test_coarse_features_are_followed_by_better_ones_and_the_last_are_the_direct_ones(
    torso: Volume, network: VisionTransformer, full: FeatureVolume, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.features.progressive.COARSE_PATCHES", 3 * 10**3)
    coarse, last = progressive_features(torso, network, FULL)
    assert 0.0 < whitened_error(coarse, full, body(torso, full)) < 0.6
    np.testing.assert_array_equal(last.array, full.array)


def test_features_are_exact_from_run_to_run(torso: Volume, network: VisionTransformer) -> None:
    settings = FeatureSettings(grid=20, most_patches=3 * 14**3)
    first, second = (extract_features(torso, network, settings).array for _ in range(2))
    np.testing.assert_array_equal(first, second)
