"""The table of pretrained models."""

from __future__ import annotations

import re

import pytest

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS, PretrainedModel, pretrained_model

every_model = pytest.mark.parametrize("model", PRETRAINED_MODELS.values(), ids=PRETRAINED_MODELS.keys())


def test_a_model_is_found_by_its_name() -> None:
    assert pretrained_model("dino_vits8").patch_size == 8


def test_an_unknown_name_is_answered_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"'dino_vits9'.*dino_vits8, dino_vits16,.*dinov2_vits14_focus"):
        pretrained_model("dino_vits9")


@every_model
def test_heads_share_the_channels_evenly(model: PretrainedModel) -> None:
    assert model.embed_dim == 64 * model.num_heads


@every_model
def test_the_position_table_is_that_of_the_training_images(model: PretrainedModel) -> None:
    if model.position_grid is not None:
        trained_on_pixels = 224 if model.name.startswith("dino_") else 518
        assert model.position_grid * model.patch_size == trained_on_pixels


@every_model
def test_the_address_is_the_official_site_and_ends_in_the_file_name(model: PretrainedModel) -> None:
    if model.url is not None:
        assert model.url.startswith("https://dl.fbaipublicfiles.com/")
        assert model.url.endswith(f"/{model.file_name}")


@every_model
def test_a_model_whose_licence_has_to_be_agreed_to_is_never_downloaded(model: PretrainedModel) -> None:
    assert (model.request_page is not None) == model.name.startswith("dinov3_")
    if model.request_page is not None:
        assert model.url is None
        assert "DINOv3 License" in model.licence
        assert model.request_page.startswith("https://ai.meta.com/")


@every_model
def test_terms_and_origin_are_named(model: PretrainedModel) -> None:
    assert model.licence
    assert model.citation
    assert model.homepage.startswith("https://") or "Python package index" in model.homepage


def test_hashes_are_sha256_and_tell_the_models_apart() -> None:
    hashes = [model.sha256 for model in PRETRAINED_MODELS.values() if model.sha256 is not None]
    assert all(re.fullmatch("[0-9a-f]{64}", sha256) for sha256 in hashes)
    assert len(set(hashes)) == len(hashes)
    starts = [model.sha256_start for model in PRETRAINED_MODELS.values() if model.sha256_start is not None]
    assert all(re.fullmatch("[0-9a-f]{8}", start) for start in starts)
    assert len(set(starts)) == len(starts) == 3
