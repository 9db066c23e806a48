"""Fetching weights from the official site (here: a server on this computer), and keeping them in the cache."""

from __future__ import annotations

import dataclasses
import errno
import hashlib
import http.server
import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ViTTransferFunction.Logic.core.errors import Cancelled, InputError
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS, PretrainedModel
from ViTTransferFunction.Logic.weights.sources import WeightsUnavailable, fetch_weights, find_weights
from ViTTransferFunction.Logic.weights.store import list_weights, remove_weights, weights_folder
from ViTTransferFunction.Testing.support.cancelling import cancel_at_once

WEIGHTS = b"weights" * 500_000
SHA256 = hashlib.sha256(WEIGHTS).hexdigest()
NAME = "dino_vits8"


class Site(http.server.ThreadingHTTPServer):
    """The official site: one file under every address, delivered as a test wants it."""

    content = WEIGHTS
    content_type = "application/octet-stream"
    status = 200
    announced_beyond_content = 0
    requests = 0

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/weights.pth"

    def handle_error(self, *_: object) -> None:
        """Keep the test's output clean of clients that hang up, which is what some tests are about."""


class _Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        site = self.server
        assert isinstance(site, Site)
        site.requests += 1
        self.send_response(site.status)
        self.send_header("Content-Type", site.content_type)
        self.send_header("Content-Length", str(len(site.content) + site.announced_beyond_content))
        self.end_headers()
        self.wfile.write(site.content)

    def log_message(self, *_: object) -> None:
        """Keep the test's output clean."""


@pytest.fixture
def site(monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with Site(("127.0.0.1", 0), _Handler) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture
def folder() -> Path:
    """The cache's folder of weights, empty."""
    return weights_folder()


@pytest.fixture
def unhashed(site: Site, monkeypatch: pytest.MonkeyPatch) -> PretrainedModel:
    """A model that the site publishes without a hash."""
    return _publish(monkeypatch, url=site.url, sha256=None)


@pytest.fixture
def hashed(site: Site, monkeypatch: pytest.MonkeyPatch) -> PretrainedModel:
    """A model that the site publishes with the hash of `WEIGHTS`."""
    return _publish(monkeypatch, url=site.url, sha256=SHA256)


def _publish(monkeypatch: pytest.MonkeyPatch, *, url: str, sha256: str | None) -> PretrainedModel:
    model = dataclasses.replace(PRETRAINED_MODELS[NAME], url=url, sha256=sha256)
    monkeypatch.setitem(PRETRAINED_MODELS, NAME, model)
    return model


def _files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


class TestDownload:
    def test_the_file_arrives_whole_and_says_where_it_came_from(self, hashed: PretrainedModel, folder: Path) -> None:
        weights = find_weights(NAME)

        assert weights.path == folder / "dino_deitsmall8_pretrain.pth"
        assert weights.path.read_bytes() == WEIGHTS
        assert (weights.sha256, weights.model) == (SHA256, hashed)
        assert weights.origin == f"downloaded from {hashed.url}"

    def test_the_second_time_it_is_in_the_cache(self, hashed: PretrainedModel, site: Site) -> None:
        find_weights(NAME)

        assert find_weights(NAME, allow_download=False).origin == "cache"
        assert site.requests == 1

    @pytest.mark.usefixtures("hashed")
    def test_progress_counts_its_bytes(self) -> None:
        reports: list[tuple[int, int, str]] = []

        find_weights(NAME, progress=lambda done, total, what: reports.append((done, total, what)))

        assert reports[-1] == (len(WEIGHTS), len(WEIGHTS), "Downloading dino_vits8")
        assert [done for done, _, _ in reports] == sorted(done for done, _, _ in reports)

    def test_a_wrong_hash_is_refused_and_nothing_is_kept(self, hashed: PretrainedModel, site: Site, folder: Path) -> None:
        site.content = b"something else"

        with pytest.raises(InputError, match=f"expected {hashed.sha256}; it was not kept"):
            find_weights(NAME)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    def test_an_interrupted_download_leaves_nothing(self, site: Site, folder: Path) -> None:
        site.announced_beyond_content = 1

        with pytest.raises(WeightsUnavailable, match="broke off after 3500000 of 3500001 bytes"):
            find_weights(NAME)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    def test_a_cancelled_download_leaves_nothing(self, folder: Path) -> None:
        with pytest.raises(Cancelled):
            find_weights(NAME, progress=cancel_at_once)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    def test_a_login_page_is_not_taken_for_weights(self, site: Site, folder: Path) -> None:
        site.content, site.content_type = b"<html>Log in</html>", "text/html; charset=utf-8"

        with pytest.raises(WeightsUnavailable, match="web page instead of the file"):
            find_weights(NAME)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    def test_a_site_without_the_file_is_quoted(self, site: Site) -> None:
        site.status = 404

        with pytest.raises(WeightsUnavailable, match="HTTP Error 404: Not Found"):
            find_weights(NAME)

    def test_without_network_the_message_says_where_to_get_it_and_where_to_put_it(
        self, monkeypatch: pytest.MonkeyPatch, folder: Path
    ) -> None:
        # Nothing listens on the port that is reserved for discarding.
        model = _publish(monkeypatch, url="http://127.0.0.1:9/weights.pth", sha256=None)

        with pytest.raises(WeightsUnavailable) as error:
            find_weights(NAME)

        for part in (model.url, "Apache-2.0", str(folder / model.file_name), "--weights", "VITTF_WEIGHTS"):
            assert str(part) in str(error.value)

    @pytest.mark.parametrize("allow_download", [True, False])
    def test_where_one_has_to_agree_to_a_licence_the_message_says_which_and_where(
        self, allow_download: bool, folder: Path
    ) -> None:
        model = PRETRAINED_MODELS["dinov3_vits16"]

        with pytest.raises(WeightsUnavailable) as error:
            find_weights(model.name, allow_download=allow_download)

        for part in (str(model.request_page), "DINOv3 License", str(folder / model.file_name), "--weights", "VITTF_WEIGHTS"):
            assert part in str(error.value)

    def test_the_network_stays_unused_when_it_is_not_allowed(self, hashed: PretrainedModel, site: Site) -> None:
        with pytest.raises(WeightsUnavailable, match=f"switched off.*{hashed.url}"):
            find_weights(NAME, allow_download=False)

        assert site.requests == 0

    @pytest.mark.usefixtures("hashed")
    def test_a_full_disk_is_an_input_error_and_leaves_nothing(self, folder: Path) -> None:
        # Stands in for the writing itself, which comes just before it.
        def disk_is_full(done: int, total: int, what: str) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        with pytest.raises(InputError, match="disk is full"):
            find_weights(NAME, progress=disk_is_full)

        assert _files(folder) == []

    @pytest.mark.usefixtures("hashed")
    def test_a_cache_that_cannot_be_written_is_an_input_error(self, folder: Path) -> None:
        folder.parent.parent.mkdir(exist_ok=True)
        folder.parent.rmdir()
        folder.parent.write_text("a file where the cache's folder should be")

        with pytest.raises(InputError, match="Cannot write"):
            find_weights(NAME)


class TestTrust:
    def test_the_first_hash_is_shown_and_remembered(
        self, unhashed: PretrainedModel, folder: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        with caplog.at_level(logging.WARNING):
            find_weights(NAME)

        assert SHA256 in caplog.text
        assert (folder / f"{unhashed.file_name}.sha256").read_text() == f"{SHA256}  {unhashed.file_name}\n"

    def test_a_file_that_changed_since_is_refused(self, unhashed: PretrainedModel, folder: Path) -> None:
        find_weights(NAME)
        (folder / unhashed.file_name).write_bytes(b"changed")

        with pytest.raises(InputError, match=f"expected {SHA256}.*vittf weights remove dino_vits8"):
            find_weights(NAME)

    def test_a_later_download_must_be_the_same_file(self, unhashed: PretrainedModel, site: Site, folder: Path) -> None:
        find_weights(NAME).path.unlink()
        site.content = b"changed"

        with pytest.raises(InputError, match=f"expected {SHA256}"):
            find_weights(NAME)

        assert _files(folder) == [f"{unhashed.file_name}.sha256"]

    @pytest.mark.usefixtures("unhashed")
    def test_removing_the_weights_forgets_the_hash(self, site: Site) -> None:
        find_weights(NAME)
        remove_weights(NAME)
        site.content = b"published again"

        assert find_weights(NAME).path.read_bytes() == b"published again"

    @pytest.mark.usefixtures("unhashed")
    @pytest.mark.parametrize("file_name", ["dino_deitsmall8_pretrain.pth", "dino_vits8.pt", "dino_vits8.pth"])
    def test_a_file_that_the_user_put_into_the_cache_is_used_and_remembered(self, folder: Path, file_name: str) -> None:
        folder.mkdir(parents=True)
        (folder / file_name).write_bytes(WEIGHTS)

        assert find_weights(NAME, allow_download=False).path == folder / file_name
        assert _files(folder) == [file_name, f"{file_name}.sha256"]

    def test_a_remembered_hash_does_not_outweigh_a_published_one(self, hashed: PretrainedModel, folder: Path) -> None:
        other = b"not as published"
        folder.mkdir(parents=True)
        (folder / hashed.file_name).write_bytes(other)
        (folder / f"{hashed.file_name}.sha256").write_text(hashlib.sha256(other).hexdigest())

        with pytest.raises(InputError, match=f"expected {SHA256}"):
            find_weights(NAME)


class TestCache:
    def test_an_empty_cache_lists_every_model_without_a_file(self) -> None:
        assert {entry.model.name: entry.path for entry in list_weights()} == dict.fromkeys(PRETRAINED_MODELS)

    @pytest.mark.usefixtures("hashed")
    def test_what_was_fetched_is_listed(self) -> None:
        path = find_weights(NAME).path

        assert [(e.path, e.sha256, e.intact) for e in list_weights() if e.path is not None] == [(path, SHA256, True)]

    @pytest.mark.usefixtures("hashed")
    def test_a_damaged_file_is_listed_as_such(self) -> None:
        find_weights(NAME).path.write_bytes(b"damaged")

        assert [entry.intact for entry in list_weights() if entry.path is not None] == [False]

    @pytest.mark.usefixtures("unhashed")
    def test_removing_leaves_nothing_of_the_model_and_everything_else(self, folder: Path) -> None:
        find_weights(NAME)
        (folder / "dino_vits16.pt").write_bytes(b"another model's")

        assert len(remove_weights(NAME)) == 2
        assert _files(folder) == ["dino_vits16.pt"]

    def test_removing_what_is_not_there_says_so(self) -> None:
        with pytest.raises(InputError, match="Nothing to remove"):
            remove_weights(NAME)

    @pytest.mark.parametrize("call", [find_weights, fetch_weights, remove_weights])
    def test_an_unknown_model_is_answered_with_the_known_ones(self, call: Callable[[str], object]) -> None:
        with pytest.raises(InputError, match="Unknown model 'resnet50'; expected one of dino_vits8"):
            call("resnet50")
