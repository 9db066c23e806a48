"""Fetching weights from the official site (here: a server on this computer), and keeping them in the cache."""

from __future__ import annotations

import dataclasses
import errno
import hashlib
import http.server
import logging
import ssl
import sys
import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch

from ViTTransferFunction.Logic.core.system import atomic_file
from ViTTransferFunction.Logic.core.system.errors import Cancelled, InputError
from ViTTransferFunction.Logic.weights import download as download_module
from ViTTransferFunction.Logic.weights.download import DownloadFailed, download, sha256_of
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS, PretrainedModel
from ViTTransferFunction.Logic.weights.sources import WeightsUnavailable, fetch_weights, find_weights
from ViTTransferFunction.Logic.weights.state_dict import tensors_sha256
from ViTTransferFunction.Logic.weights.store import list_weights, remove_weights, weights_folder
from ViTTransferFunction.Testing.support.cancelling import cancel_at_once
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S

WEIGHTS = b"weights" * 500_000
SHA256 = hashlib.sha256(WEIGHTS).hexdigest()
NAME = "dino_vits8"


class Site(http.server.ThreadingHTTPServer):
    """The official site: one file under every address, delivered as a test wants it."""

    content = WEIGHTS
    content_type = "application/octet-stream"
    status = 200
    announced_beyond_content = 0
    announced: str | None = None
    redirects_to: str | None = None
    silent_after: int | None = None
    """It sends so many bytes of the file, or nothing at all if negative, and no more until the client hangs up."""
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
        if site.silent_after is not None and site.silent_after < 0:
            self._await_hanging_up()
            return
        self.send_response(site.status)
        self.send_header("Content-Type", site.content_type)
        if site.redirects_to is not None:
            self.send_header("Location", site.redirects_to)
        usual = str(len(site.content) + site.announced_beyond_content)
        self.send_header("Content-Length", usual if site.announced is None else site.announced)
        self.end_headers()
        self.wfile.write(site.content[: site.silent_after])
        if site.silent_after is not None:
            self._await_hanging_up()

    def _await_hanging_up(self) -> None:
        self.connection.settimeout(LONGEST_WAIT_S)
        self.connection.recv(1)

    def log_message(self, *_: object) -> None:
        """Keep the test's output clean."""


def trusting(model: PretrainedModel, sha256: str) -> bool:
    return True


@pytest.fixture
def site(monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    # It has no certificate.
    monkeypatch.setattr(download_module, "_SCHEMES", {"https", "http"})
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
        weights = find_weights(NAME, trust=trusting)

        assert weights.path == folder / "dino_deitsmall8_pretrain.pth"
        assert weights.path.read_bytes() == WEIGHTS
        assert (weights.sha256, weights.model) == (SHA256, hashed)
        assert weights.origin == f"downloaded from {hashed.url}"

    def test_the_second_time_it_is_in_the_cache(self, hashed: PretrainedModel, site: Site) -> None:
        find_weights(NAME, trust=trusting)

        assert find_weights(NAME, allow_download=False).origin == "cache"
        assert site.requests == 1

    @pytest.mark.usefixtures("hashed")
    def test_progress_counts_its_bytes(self) -> None:
        reports: list[tuple[int, int, str]] = []

        find_weights(NAME, trust=trusting, progress=lambda done, total, what: reports.append((done, total, what)))

        assert reports[-1] == (len(WEIGHTS), len(WEIGHTS), "Downloading dino_vits8")
        assert [done for done, _, _ in reports] == sorted(done for done, _, _ in reports)

    def test_a_wrong_hash_is_refused_and_nothing_is_kept(self, hashed: PretrainedModel, site: Site, folder: Path) -> None:
        site.content = b"something else"

        with pytest.raises(InputError, match=f"expected {hashed.sha256}; it was not kept"):
            find_weights(NAME, trust=trusting)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    def test_an_interrupted_download_leaves_nothing(self, site: Site, folder: Path) -> None:
        site.announced_beyond_content = 1

        with pytest.raises(WeightsUnavailable, match="broke off after 3500000 of 3500001 bytes"):
            find_weights(NAME, trust=trusting)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    @pytest.mark.parametrize("silent_after", [-1, 5])
    def test_a_network_that_falls_silent_is_not_waited_for(
        self, silent_after: int, site: Site, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(download_module, "_TIMEOUT_S", 0.1)
        site.silent_after = silent_after

        with pytest.raises(WeightsUnavailable, match=r"(could not be opened|broke off) \(timed out\); check the network"):
            find_weights(NAME, trust=trusting)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    def test_a_cancelled_download_leaves_nothing(self, folder: Path) -> None:
        with pytest.raises(Cancelled):
            find_weights(NAME, trust=trusting, progress=cancel_at_once)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    def test_a_login_page_is_not_taken_for_weights(self, site: Site, folder: Path) -> None:
        site.content, site.content_type = b"<html>Log in</html>", "text/html; charset=utf-8"

        with pytest.raises(WeightsUnavailable, match="web page instead of the file"):
            find_weights(NAME, trust=trusting)

        assert _files(folder) == []

    @pytest.mark.parametrize("url", ["http://example.org/w.pth", "ftp://example.org/w.pth", "file:///etc/passwd", "w.pth"])
    def test_nothing_is_fetched_but_by_https(self, url: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        _publish(monkeypatch, url=url, sha256=None)

        with pytest.raises(WeightsUnavailable, match="is not an https address"):
            find_weights(NAME, trust=trusting)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    @pytest.mark.parametrize("address", ["http://example.org/w.pth", "ftp://example.org/w.pth", "file:///etc/passwd"])
    def test_a_redirect_to_anything_but_https_is_not_followed(
        self, address: str, site: Site, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        site.status, site.redirects_to = 302, address
        original = urllib.request.OpenerDirector.open

        def opened(opener: urllib.request.OpenerDirector, *arguments: Any, **options: Any) -> Any:
            # The site itself is reached; from there on, no exception is made for it.
            monkeypatch.setattr(download_module, "_SCHEMES", {"https"})
            return original(opener, *arguments, **options)

        monkeypatch.setattr(urllib.request.OpenerDirector, "open", opened)
        with pytest.raises(WeightsUnavailable, match=f"{address} is not an https address|is not allowed"):
            find_weights(NAME, trust=trusting)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    def test_an_empty_file_is_not_taken_for_weights(self, site: Site, folder: Path) -> None:
        site.content = b""

        with pytest.raises(WeightsUnavailable, match="empty file"):
            find_weights(NAME, trust=trusting)

        assert _files(folder) == []

    @pytest.mark.usefixtures("unhashed")
    @pytest.mark.parametrize("announced", ["-5", "many", "", "1e30", "9" * 5000, "3499999, 3499999"])
    def test_a_length_that_makes_no_sense_is_not_believed(self, announced: str, site: Site) -> None:
        site.announced = announced

        assert find_weights(NAME, trust=trusting).path.read_bytes() == WEIGHTS

    @pytest.mark.parametrize("announced", [str(10**15), str(len(WEIGHTS)), ""])
    def test_far_more_than_the_model_has_is_not_waited_for(
        self, announced: str, site: Site, unhashed: PretrainedModel, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(PRETRAINED_MODELS, NAME, dataclasses.replace(unhashed, size_mb=1))
        site.announced = announced

        with pytest.raises(WeightsUnavailable, match="expected 2000000 at most"):
            find_weights(NAME, trust=trusting)

        assert _files(folder) == []

    def test_a_part_that_passes_for_the_whole_is_not_the_file(self, site: Site, hashed: PretrainedModel) -> None:
        site.announced = str(len(WEIGHTS) - 1)

        with pytest.raises(InputError, match=f"expected {hashed.sha256}; it was not kept"):
            find_weights(NAME)

    @pytest.mark.usefixtures("unhashed")
    def test_a_site_without_the_file_is_quoted(self, site: Site) -> None:
        site.status = 404

        with pytest.raises(WeightsUnavailable, match="HTTP Error 404: Not Found"):
            find_weights(NAME, trust=trusting)

    def test_without_network_the_message_says_where_to_get_it_and_where_to_put_it(
        self, monkeypatch: pytest.MonkeyPatch, folder: Path
    ) -> None:
        # Nothing listens on the port that is reserved for discarding.
        model = _publish(monkeypatch, url="http://127.0.0.1:9/weights.pth", sha256=None)

        with pytest.raises(WeightsUnavailable) as error:
            find_weights(NAME, trust=trusting)

        for part in (model.url, "Apache-2.0", str(folder / model.file_name), "--weights", "VITTF_WEIGHTS", "try again"):
            assert str(part) in str(error.value)
        assert str(error.value).count(str(model.url)) == 1

    def test_a_host_that_is_not_found_is_told_in_the_system_s_words(self, tmp_path: Path) -> None:
        with pytest.raises(DownloadFailed, match=r"could not be opened \([^<\[]*\)"):
            download("https://nobody.invalid/weights.pth", tmp_path / "weights.pth")

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
        with pytest.raises(WeightsUnavailable, match=f"nobody was asked.*{hashed.url}"):
            find_weights(NAME, allow_download=False)

        assert site.requests == 0

    @pytest.mark.usefixtures("hashed")
    def test_a_full_disk_is_an_input_error_and_leaves_nothing(self, folder: Path) -> None:
        # Stands in for the writing itself, which comes just before it.
        def disk_is_full(done: int, total: int, what: str) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        with pytest.raises(InputError, match="disk is full"):
            find_weights(NAME, trust=trusting, progress=disk_is_full)

        assert _files(folder) == []

    @pytest.mark.usefixtures("hashed")
    def test_a_cache_that_cannot_be_written_is_an_input_error(self, folder: Path) -> None:
        folder.parent.parent.mkdir(exist_ok=True)
        folder.parent.rmdir()
        folder.parent.write_text("a file where the cache's folder should be")

        with pytest.raises(InputError, match="Cannot write"):
            find_weights(NAME, trust=trusting)


class TestTrust:
    def test_without_a_published_hash_nothing_is_downloaded_unless_somebody_looks_at_it(
        self, unhashed: PretrainedModel, site: Site
    ) -> None:
        with pytest.raises(WeightsUnavailable, match=f"'vittf weights get {unhashed.name}' shows"):
            find_weights(NAME)

        assert site.requests == 0

    def test_the_hash_is_shown_and_a_file_that_is_not_wanted_is_not_kept(self, unhashed: PretrainedModel, folder: Path) -> None:
        asked: list[tuple[PretrainedModel, str]] = []

        def refuses(model: PretrainedModel, sha256: str) -> bool:
            asked.append((model, sha256))
            return False

        with pytest.raises(InputError, match=f"{SHA256}, which was not accepted"):
            find_weights(NAME, trust=refuses)

        assert asked == [(unhashed, SHA256)]
        assert _files(folder) == []

    @pytest.mark.usefixtures("hashed")
    def test_where_a_hash_is_published_nobody_is_asked(self) -> None:
        assert find_weights(NAME, trust=lambda *_: False).sha256 == SHA256

    def test_the_first_hash_is_shown_and_remembered(
        self, unhashed: PretrainedModel, folder: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        with caplog.at_level(logging.WARNING):
            find_weights(NAME, trust=trusting)

        assert SHA256 in caplog.text
        assert (folder / f"{unhashed.file_name}.sha256").read_text() == f"{SHA256}  {unhashed.file_name}\n"

    def test_a_file_that_changed_since_is_refused(self, unhashed: PretrainedModel, folder: Path) -> None:
        find_weights(NAME, trust=trusting)
        (folder / unhashed.file_name).write_bytes(b"changed")

        with pytest.raises(InputError, match=f"expected {SHA256}.*vittf weights remove dino_vits8"):
            find_weights(NAME, trust=trusting)

    def test_a_later_download_must_be_the_same_file(self, unhashed: PretrainedModel, site: Site, folder: Path) -> None:
        find_weights(NAME, trust=trusting).path.unlink()
        site.content = b"changed"

        with pytest.raises(InputError, match=f"expected {SHA256}"):
            find_weights(NAME, trust=trusting)

        assert _files(folder) == [f"{unhashed.file_name}.sha256"]

    @pytest.mark.usefixtures("unhashed")
    def test_removing_the_weights_forgets_the_hash(self, site: Site) -> None:
        find_weights(NAME, trust=trusting)
        remove_weights(NAME)
        site.content = b"published again"

        assert find_weights(NAME, trust=trusting).path.read_bytes() == b"published again"

    @pytest.mark.usefixtures("unhashed")
    @pytest.mark.parametrize("file_name", ["dino_deitsmall8_pretrain.pth", "dino_vits8.pt", "dino_vits8.pth"])
    def test_a_file_that_the_user_put_into_the_cache_is_used_and_remembered(self, folder: Path, file_name: str) -> None:
        folder.mkdir(parents=True)
        (folder / file_name).write_bytes(WEIGHTS)

        assert find_weights(NAME, allow_download=False).path == folder / file_name
        assert _files(folder) == [file_name, f"{file_name}.sha256"]

    @pytest.mark.usefixtures("unhashed")
    def test_one_in_a_cache_that_cannot_be_written_is_used_all_the_same(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
    ) -> None:
        def read_only(*_: object) -> int:
            raise OSError(errno.EROFS, "Read-only file system")

        folder.mkdir(parents=True)
        (folder / f"{NAME}.pth").write_bytes(WEIGHTS)
        monkeypatch.setattr(atomic_file, "_make", read_only)

        assert find_weights(NAME, allow_download=False).sha256 == SHA256
        assert "cannot be remembered" in caplog.text

    def test_a_remembered_hash_does_not_outweigh_a_published_one(self, hashed: PretrainedModel, folder: Path) -> None:
        other = b"not as published"
        folder.mkdir(parents=True)
        (folder / hashed.file_name).write_bytes(other)
        (folder / f"{hashed.file_name}.sha256").write_text(hashlib.sha256(other).hexdigest())

        with pytest.raises(InputError, match=f"expected {SHA256}"):
            find_weights(NAME, trust=trusting)

    def test_a_file_that_is_made_anew_on_each_computer_is_known_by_its_tensors(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
    ) -> None:
        right, wrong = {"weight": torch.zeros(2)}, {"weight": torch.ones(2)}
        published = _publish(monkeypatch, url="", sha256=SHA256)
        model = dataclasses.replace(published, tensors_sha256=tensors_sha256(right))
        monkeypatch.setitem(PRETRAINED_MODELS, NAME, model)
        folder.mkdir(parents=True)

        torch.save(wrong, folder / model.file_name)
        with pytest.raises(InputError, match="was changed or is damaged"):
            find_weights(NAME, allow_download=False)

        torch.save(right, folder / model.file_name)
        assert find_weights(NAME, allow_download=False).path == folder / model.file_name
        assert "No hash is published" not in caplog.text

        remembered = sha256_of(folder / model.file_name)
        (folder / model.file_name).write_bytes(b"no weights")
        with pytest.raises(InputError, match=f"was changed or is damaged.*, expected {SHA256} or {remembered}"):
            find_weights(NAME, allow_download=False)


class TestCache:
    def test_an_empty_cache_lists_every_model_without_a_file(self) -> None:
        assert {entry.model.name: entry.path for entry in list_weights()} == dict.fromkeys(PRETRAINED_MODELS)

    @pytest.mark.usefixtures("hashed")
    def test_what_was_fetched_is_listed(self) -> None:
        path = find_weights(NAME, trust=trusting).path

        assert [(e.path, e.sha256, e.intact) for e in list_weights() if e.path is not None] == [(path, SHA256, True)]

    @pytest.mark.usefixtures("hashed")
    def test_a_damaged_file_is_listed_as_such(self) -> None:
        find_weights(NAME, trust=trusting).path.write_bytes(b"damaged")

        assert [entry.intact for entry in list_weights() if entry.path is not None] == [False]

    @pytest.mark.usefixtures("unhashed")
    def test_removing_leaves_nothing_of_the_model_and_everything_else(self, folder: Path) -> None:
        find_weights(NAME, trust=trusting)
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


@pytest.mark.parametrize("platform", ["darwin", "linux"])
def test_on_a_mac_whose_python_has_no_certificates_it_is_told_where_they_are(
    platform: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Opener:
        def open(self, *_: object, **__: object) -> None:
            reason = "[SSL: CERTIFICATE_VERIFY_FAILED] certificate verify failed: unable to get local issuer certificate"
            raise urllib.error.URLError(ssl.SSLCertVerificationError(1, reason))

    monkeypatch.setattr(urllib.request, "build_opener", lambda _: Opener())
    monkeypatch.setattr(sys, "platform", platform)
    with pytest.raises(DownloadFailed, match="unable to get local issuer certificate") as failed:
        download("https://example.org/weights.pth", tmp_path / "weights.pth")
    assert ("Install Certificates.command" in str(failed.value)) == (platform == "darwin")
