"""One way to open a volume: settings are checked at once, the network is opened once, volume and weights are hashed once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.progress import Progress
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features import networks as networks_module
from ViTTransferFunction.Logic.features import progressive, whitening
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.features.networks import Networks
from ViTTransferFunction.Logic.features.precision import precision_name
from ViTTransferFunction.Logic.session import model_weights
from ViTTransferFunction.Logic.session.opening import chosen_model, open_session
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights import sources
from ViTTransferFunction.Logic.weights.download import DownloadFailed
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS, PretrainedModel
from ViTTransferFunction.Logic.weights.sources import WeightsUnavailable
from ViTTransferFunction.Testing.support.calls import Calls
from ViTTransferFunction.Testing.support.disks import set_free_space
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"preset": "published"}, "Unknown preset 'published'"),
        ({"grid": 3}, "4 to 128 cells; got 3"),
        ({"window": (5.0, 5.0)}, "the lower first"),
        ({"window": (5000.0, 6000.0)}, "shows nothing of"),
        ({"model": "dino_vits9"}, "Unknown model 'dino_vits9'"),
        ({"device": "tpu"}, "Unknown device 'tpu'"),
        ({"weights_path": "/not/there.pth"}, "no weights file"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_a_setting_that_cannot_be_used_is_refused_as_the_volume_is_opened(
    spheres: Spheres, change: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        open_session(spheres[0], replace(SessionSettings(), **change))  # type: ignore[arg-type]


def test_settings_replace_those_of_the_preset_and_no_others() -> None:
    settings = SessionSettings(grid=20, window=(0.0, 100.0)).feature_settings()
    assert settings.grid == 20
    assert settings.window == IntensityWindow(0.0, 100.0)
    assert SessionSettings().feature_settings() == PRESETS[DEFAULT_PRESET].features


def test_the_network_is_opened_once_for_estimate_extraction_and_the_next_session(
    spheres: Spheres, tiny_weights: SessionSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = Calls(monkeypatch, networks_module, "open_network")
    calibrated = Calls(monkeypatch, networks_module, "calibrate")
    networks = Networks()
    for grid in (8, 10):
        session = open_session(spheres[0], replace(tiny_weights, grid=grid), networks=networks)
        estimate = session.estimate()
        assert not estimate.cached
        assert estimate.seconds is not None
        session.load_features()
    assert (opened.count, calibrated.count) == (1, 1)


def test_a_network_is_not_taken_for_another_model_because_the_file_is_the_same(
    spheres: Spheres, tiny_weights: SessionSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(PRETRAINED_MODELS, "other", replace(TINY_MODEL, name="other", position_grid=7))
    networks = Networks()
    open_session(spheres[0], tiny_weights, networks=networks).estimate()
    with pytest.raises(InputError, match=r"not those of 'other'.*the file belongs to, by its shapes 'tiny' \("):
        open_session(spheres[0], replace(tiny_weights, model="other"), networks=networks).estimate()


def test_the_weights_are_hashed_once_for_estimate_and_extraction(
    spheres: Spheres, tiny_weights: SessionSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = Calls(monkeypatch, model_weights, "find_weights")
    session = open_session(spheres[0], tiny_weights)
    session.estimate()
    session.load_features()
    assert found.count == 1


def test_an_estimate_says_what_clicks_on_coarse_features_take_as_well(spheres: Spheres, tiny_weights: SessionSettings) -> None:
    session = open_session(spheres[0], tiny_weights)
    alone, with_clicks = session.estimate(), session.estimate(coarse_first=True)
    session.load_features()
    assert with_clicks.memory_bytes > alone.memory_bytes + 2 * session.features.array.nbytes
    assert with_clicks.model == alone.model == "tiny"


def test_coarse_features_can_be_used_before_the_final_ones(
    spheres: Spheres, tiny_weights: SessionSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progressive, "COARSE_PATCHES", 4**3)
    session, used = open_session(spheres[0], tiny_weights), list[np.ndarray]()
    session.load_features(on_coarse=lambda: used.append(session.features.array))
    assert used[-1] is session.features.array
    assert not np.array_equal(used[0], used[-1])


def test_weights_that_are_not_here_are_told_of_and_not_fetched_by_an_estimate(
    spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sources, "_download", lambda *_: pytest.fail("fetched without being asked for"))
    model = PRETRAINED_MODELS[PRESETS[DEFAULT_PRESET].model]
    estimate = open_session(spheres[0], SessionSettings(grid=GRID)).estimate()
    assert (estimate.cached, estimate.seconds, estimate.model) == (False, None, model.name)
    assert estimate.download is not None
    assert (estimate.download.url, estimate.download.sha256) == (model.url, model.sha256)
    assert Path(estimate.download.target).name == model.file_name
    with_clicks = open_session(spheres[0], SessionSettings(grid=GRID)).estimate(coarse_first=True)
    assert with_clicks.memory_bytes > estimate.memory_bytes
    cache_known_features(*spheres)
    estimate = open_session(spheres[0], SessionSettings(grid=GRID)).estimate()
    assert (estimate.cached, estimate.download) == (True, None)


def test_of_features_in_the_cache_an_estimate_opens_no_network_and_says_no_time(
    spheres: Spheres, tiny_weights: SessionSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_session(spheres[0], tiny_weights).load_features()
    opened = Calls(monkeypatch, networks_module, "open_network")
    estimate = open_session(spheres[0], tiny_weights).estimate()
    assert (estimate.cached, estimate.seconds, estimate.model, opened.count) == (True, None, "tiny", 0)


@pytest.mark.parametrize("name", [name for name, model in PRETRAINED_MODELS.items() if model.sha256 is None])
def test_weights_that_are_not_here_and_whose_hash_nobody_publishes_are_told_of_and_asked_for(
    spheres: Spheres, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise DownloadFailed("no network")

    monkeypatch.setattr(sources, "download", fail)
    session = open_session(spheres[0], SessionSettings(grid=GRID, model=name), trust=lambda *_: True)
    estimate = session.estimate()
    assert (estimate.cached, estimate.seconds, estimate.model) == (False, None, name)
    with pytest.raises(WeightsUnavailable):
        session.load_features()


def test_a_download_of_weights_is_followed_and_the_user_is_asked_whether_to_trust_them(
    spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[tuple[object, ...]] = []

    def download(*_: object, accept: Callable[[str], bool], progress: Progress, **__: object) -> None:
        progress(1, 2, "Downloading")
        accept("0" * 64)
        raise DownloadFailed("not trusted")

    def trust(model: PretrainedModel, sha256: str) -> bool:
        told.append((model.name, sha256))
        return False

    monkeypatch.setattr(sources, "download", download)
    session = open_session(spheres[0], SessionSettings(grid=GRID, model="dino_vits8"), trust=trust)
    with pytest.raises(WeightsUnavailable, match="not trusted"):
        session.load_features(lambda *progress: told.append(progress))
    assert told == [(1, 2, "Downloading"), ("dino_vits8", "0" * 64)]


@pytest.mark.parametrize("ask_first", [False, True])
def test_weights_of_which_no_estimate_told_are_fetched_only_where_nobody_has_to_be_asked(
    spheres: Spheres, monkeypatch: pytest.MonkeyPatch, ask_first: bool
) -> None:
    """Features are in the cache, and the weights, which were here once, are gone; then, what is in the cache is damaged."""

    def fail(*_: object, **__: object) -> None:
        raise DownloadFailed("no network")

    monkeypatch.setattr(sources, "download", fail)
    fetched = Calls(monkeypatch, sources, "_download")
    cache_known_features(*spheres)
    session = open_session(spheres[0], SessionSettings(grid=GRID), ask_first=ask_first)
    assert session.estimate().download is None
    session.load_features()
    centre = centre_ras(spheres, 1)
    request = ClassRequest("sphere", centre, close_up=CloseUp(tuple(centre[0]), (40.0, 40.0, 40.0)))
    told = "nobody was asked" if ask_first else "no network"
    with pytest.raises(WeightsUnavailable, match=told):
        session.look_closer([request])
    for entry in FeatureCache().entries():
        FeatureCache()._path(entry.key).write_bytes(b"damaged")
    with pytest.raises(WeightsUnavailable, match=told):
        session.load_features()
    assert fetched.count == (0 if ask_first else 2)
    assert session.estimate().download is not None
    with pytest.raises(WeightsUnavailable, match="no network"):
        session.load_features()


def test_the_volume_is_hashed_once(spheres: Spheres) -> None:
    volume = Volume(spheres[0].array.copy(), spheres[0].geometry)
    before = volume.digest
    assert before == spheres[0].digest
    volume.array[0, 0, 0] += 1.0
    assert volume.digest is before


def test_features_are_reported_with_their_origin_and_precision(spheres: Spheres, tiny_weights: SessionSettings) -> None:
    computed, cached = (open_session(spheres[0], tiny_weights).load_features() for _ in range(2))
    assert (computed.cached, cached.cached) == (False, True)
    assert computed.precision == cached.precision == precision_name(torch.device("cpu"))
    assert computed.weights.model is TINY_MODEL


@pytest.mark.parametrize("coarse_first", [False, True])
def test_features_out_of_the_cache_are_normalised_as_they_were_without_looking_at_how_they_are_spread(
    spheres: Spheres, tiny_weights: SessionSettings, coarse_first: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    sessions = [open_session(spheres[0], tiny_weights) for _ in range(2)]
    sessions[0].load_features(on_coarse=(lambda: None) if coarse_first else None)
    looked = Calls(monkeypatch, whitening, "_moments")
    assert sessions[1].load_features().cached
    assert looked.count == 0
    np.testing.assert_array_equal(sessions[1].features.array, sessions[0].features.array)


def test_a_volume_that_was_moved_finds_its_features_where_it_is_now(
    spheres: Spheres, tiny_weights: SessionSettings, tmp_path: Path
) -> None:
    open_session(spheres[0], tiny_weights).load_features()
    shift = np.eye(4)
    shift[:3, 3] = (100.0, -50.0, 25.0)
    moved = Volume(spheres[0].array, Geometry(spheres[0].shape, shift @ spheres[0].geometry.ijk_to_ras))
    computed = open_session(moved, tiny_weights, cache=FeatureCache(tmp_path / "another"))
    cached = open_session(moved, tiny_weights)
    assert (computed.load_features().cached, cached.load_features().cached) == (False, True)
    request = ClassRequest("sphere", centre_ras(spheres, 1) + shift[:3, 3])
    (expected,), (found,) = (session.low_resolution_maps([request]) for session in (computed, cached))
    np.testing.assert_array_equal(found.geometry.ijk_to_ras, expected.geometry.ijk_to_ras)
    np.testing.assert_array_equal(found.array, expected.array)


def test_features_of_another_precision_are_not_taken_from_the_cache(
    spheres: Spheres, tiny_weights: SessionSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_session(spheres[0], tiny_weights).load_features()
    other = torch.float32 if precision_name(torch.device("cpu")) == "bfloat16" else torch.bfloat16
    monkeypatch.setattr("ViTTransferFunction.Logic.features.precision.device_precision", lambda device: other)
    assert not open_session(spheres[0], tiny_weights).load_features().cached


def test_cached_features_need_neither_weights_nor_network(spheres: Spheres, monkeypatch: pytest.MonkeyPatch) -> None:
    cache_known_features(*spheres)
    opened = Calls(monkeypatch, networks_module, "open_network")
    session = open_session(spheres[0], SessionSettings(grid=GRID))
    assert session.estimate().cached
    assert session.load_features().cached
    assert opened.count == 0
    assert np.isfinite(session.features.array).all()


def test_the_former_model_is_taken_where_its_weights_are_here_and_none_is_chosen(
    tiny_weights: SessionSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("VITTF_WEIGHTS", raising=False)
    automatic = replace(tiny_weights, model=None, former_model="tiny")
    assert chosen_model(automatic).name == "tiny"
    assert chosen_model(replace(automatic, model="dino_vits8")).name == "dino_vits8"
    assert chosen_model(replace(automatic, weights_path=None)).name == "dinov2_vits14"
    assert chosen_model(replace(automatic, former_model="of a later version", weights_path=None)).name == "dinov2_vits14"
    # A file that the user names would say by itself which model it is of; a folder with files of several does not.
    monkeypatch.setenv("VITTF_WEIGHTS", str(Path(str(automatic.weights_path)).parent))
    assert chosen_model(replace(automatic, weights_path=None)).name == "tiny"
    assert chosen_model(replace(automatic, weights_path=None, former_model=None)).name == "dinov2_vits14"


def test_a_former_model_whose_weights_are_not_here_is_passed_over_and_not_downloaded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "_download", lambda *_: pytest.fail("fetched without being asked for"))
    assert chosen_model(SessionSettings(former_model="dinov2_vitb14")).name == "dinov2_vits14"


def test_who_loads_features_that_cannot_be_kept_is_told_why(
    tiny_weights: SessionSettings, spheres: Spheres, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert open_session(spheres[0], tiny_weights).load_features().not_kept == ""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("VITTF_CACHE", str(tmp_path / "file" / "cache"))
    provenance = open_session(spheres[0], tiny_weights).load_features()
    assert not provenance.cached
    assert "cannot be kept" in provenance.not_kept


def test_features_are_used_where_the_disk_of_the_cache_is_full(
    tiny_weights: SessionSettings, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_free_space(monkeypatch, 1)
    session = open_session(spheres[0], tiny_weights)
    assert "disk is full" in session.load_features().not_kept
    assert "disk is full" in session.not_kept
    assert session.features is not None
    assert FeatureCache().entries() == []


def test_why_features_of_a_close_up_are_not_kept_is_told_once_for_all_close_ups(
    tiny_weights: SessionSettings, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = open_session(spheres[0], tiny_weights)
    session.load_features()
    near, far = (
        ClassRequest(f"sphere {label}", centre, close_up=CloseUp(tuple(centre[0]), (40.0, 40.0, 40.0)))
        for label in (1, 3)
        for centre in [centre_ras(spheres, label)]
    )
    assert session.not_kept == ""
    set_free_space(monkeypatch, 10_000_000)
    session.look_closer([near])
    assert "disk is full: 10 MB free" in session.not_kept
    # That there is less room now is no news.
    set_free_space(monkeypatch, 5_000_000)
    session.look_closer([near, far])
    assert "disk is full: 10 MB free" in session.not_kept
