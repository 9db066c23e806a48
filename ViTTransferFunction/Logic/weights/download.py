"""Files that arrive whole and checked, over an encrypted connection, or not at all."""

from __future__ import annotations

import contextlib
import hashlib
import http.client
import os
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ..core.system.atomic_file import replacing
from ..core.system.errors import InputError
from ..core.system.progress import Progress, no_progress

_TIMEOUT_S = 10.0
"""Longest silence of the network, on connecting as on reading, before it counts as broken."""
_BLOCK = 1 << 20
_MOST_BYTES = 4 * 2**30
_RECENT_S = 2.0
"""A file that changed so recently may change again within what its file system takes for the same moment."""
_hashes: dict[tuple[int, ...], str] = {}
"""By the states of files that were read before: weights are asked for with every volume, and reading them takes a while."""
_SCHEMES = frozenset({"https"})
"""Who sits in between can read and change what comes by any other; a hash alone would not show what is fetched to others."""


class DownloadFailed(InputError):
    """The network was not reached, refused, or broke off. Another source may still do."""


def download(
    url: str,
    target: Path,
    *,
    expected_sha256: str | None = None,
    accept: Callable[[str], bool] = lambda sha256: True,
    most_bytes: int = _MOST_BYTES,
    what: str = "Downloading",
    progress: Progress = no_progress,
) -> str:
    """Download `url` to `target`, which appears only when it is complete and its hash is the expected one.

    Args:
        url: the file's address, by HTTPS, as is any that it redirects to.
        target: where it goes; its folder is created, an older file there is replaced.
        expected_sha256: hexadecimal hash that the file must have; None where it is not known.
        accept: asked then whether a file of this hash is to be kept.
        most_bytes: a longer file is not what is wanted, and is not waited for.
        what: name of this work in `progress`.
        progress: called with bytes; may raise to cancel.

    Returns:
        Hexadecimal SHA-256 of the file.

    Raises:
        DownloadFailed: the network did not deliver the whole file.
        InputError: the file has another hash, or one that was not accepted, or cannot be written.
    """
    with _open(url) as response, replacing(target) as part:
        sha256 = _stream_to(part, response, most_bytes, what, progress)
        if expected_sha256 is not None and sha256 != expected_sha256:
            raise InputError(
                f"{url} delivered a file with SHA-256 {sha256}, expected {expected_sha256}; it was not kept. Something on the "
                "way may have changed it: try another network, or get it from someone who has it and check its hash."
            )
        if expected_sha256 is None and not accept(sha256):
            raise InputError(f"{url} delivered a file with SHA-256 {sha256}, which was not accepted, and not kept.")
    return sha256


def sha256_of(path: Path) -> str:
    """Hexadecimal SHA-256 of a file's content; that of a file that has not changed since is known.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        with path.open("rb") as stream:
            status = os.fstat(stream.fileno())
            state = (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
            if state not in _hashes:
                digest = hashlib.sha256()
                while block := stream.read(_BLOCK):
                    digest.update(block)
                if time.time() - status.st_mtime < _RECENT_S:
                    return digest.hexdigest()
                _hashes[state] = digest.hexdigest()
            return _hashes[state]
    except OSError as error:
        raise InputError(
            f"Cannot read {path} ({error.strerror or error}). Check its permissions, or choose another file."
        ) from error


@contextlib.contextmanager
def _open(url: str) -> Iterator[http.client.HTTPResponse]:
    _check_scheme(url)
    # Some hosts refuse the default "Python-urllib".
    request = urllib.request.Request(url, headers={"User-Agent": "vit-transfer-function"})
    try:
        response = urllib.request.build_opener(_CheckedRedirects).open(request, timeout=_TIMEOUT_S)
    except (OSError, http.client.HTTPException) as error:
        reason = _words(error)
        if sys.platform == "darwin" and "CERTIFICATE_VERIFY_FAILED" in reason:
            reason += "; Python from python.org needs 'Install Certificates.command' of its folder in Applications once"
        raise DownloadFailed(f"{url} could not be opened ({reason})") from error
    with response:
        # A hospital's or hotel's network answers with its own page and status 200.
        if response.headers.get_content_type() == "text/html":
            raise DownloadFailed(f"{url} answered with a web page instead of the file; is there a login or a proxy in between?")
        yield response


def _words(error: Exception) -> str:
    """What the system says, such as "Name or service not known", without what Python puts around it."""
    if isinstance(error, urllib.error.URLError) and not isinstance(error, urllib.error.HTTPError):
        return getattr(error.reason, "strerror", None) or str(error.reason)
    return str(error)


class _CheckedRedirects(urllib.request.HTTPRedirectHandler):
    def redirect_request(
        self, req: urllib.request.Request, fp: Any, code: int, msg: str, headers: Any, newurl: str
    ) -> urllib.request.Request | None:
        _check_scheme(newurl)
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def _check_scheme(url: str) -> None:
    if urlsplit(url).scheme not in _SCHEMES:
        raise DownloadFailed(f"{url} is not an https address, and nothing is fetched by any other")


def _stream_to(part: Path, response: http.client.HTTPResponse, most_bytes: int, what: str, progress: Progress) -> str:
    digest = hashlib.sha256()
    done, total = 0, _announced_bytes(response)
    with part.open("wb") as stream:
        for block in _blocks(response):
            done += len(block)
            if max(done, total) > most_bytes:
                raise DownloadFailed(f"{response.url} delivers {max(done, total)} bytes or more, expected {most_bytes} at most")
            stream.write(block)
            digest.update(block)
            progress(done, max(done, total), what)
    # Python's own check for an early end covers only some ways of reading.
    if done < total:
        raise DownloadFailed(f"{response.url} broke off after {done} of {total} bytes")
    if not done:
        raise DownloadFailed(f"{response.url} answered with an empty file")
    return digest.hexdigest()


def _announced_bytes(response: http.client.HTTPResponse) -> int:
    """What the header says; 0 where it says nothing of use."""
    announced = response.headers.get("Content-Length", "")
    return int(announced) if announced.isdecimal() and len(announced) < 20 else 0


def _blocks(response: http.client.HTTPResponse) -> Iterator[bytes]:
    while True:
        try:
            block = response.read(_BLOCK)
        except (OSError, http.client.HTTPException) as error:
            raise DownloadFailed(f"{response.url} broke off ({error})") from error
        if not block:
            return
        yield block
