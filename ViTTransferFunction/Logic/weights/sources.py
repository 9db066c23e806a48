"""Where model weights come from: the user's own file, the user's cache, or the official site."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ..core.system.errors import InputError
from ..core.system.progress import Progress, no_progress
from ..core.system.regular_file import check_regular_file
from ..core.system.user_path import user_path
from .download import DownloadFailed, download, sha256_of
from .models import PRETRAINED_MODELS, PretrainedModel, pretrained_model
from .store import check_cached, file_in, file_names, remember, trusted_hashes, weights_folder

WEIGHTS_VARIABLE = "VITTF_WEIGHTS"
"""Environment variable that names a weights file, or a folder of them."""

Trust = Callable[[PretrainedModel, str], bool]
"""From a model and the hexadecimal SHA-256 of a file to whether this file may be used as its weights, now and later."""

_SIZE_TOLERANCE = 2
"""Published sizes are rounded, and may change with a new release. A file larger by more than this factor is another one."""

_logger = logging.getLogger(__name__)


class WeightsUnavailable(InputError):
    """The weights are not on this computer and could not be downloaded. Those of another model may be available."""


@dataclass(frozen=True)
class WeightsFile:
    """A weights file that was found.

    Attributes:
        path: path of the file.
        sha256: hexadecimal hash of its content.
        model: the model whose weights it holds.
        origin: the source that it came from, in words.
    """

    path: Path
    sha256: str
    model: PretrainedModel
    origin: str


def find_weights(
    model_name: str,
    path: str | Path | None = None,
    *,
    allow_download: bool = True,
    trust: Trust | None = None,
    progress: Progress = no_progress,
) -> WeightsFile:
    """The weights of a model, from the first source that has them.

    The sources are, in this order: `path`; the file or folder that `VITTF_WEIGHTS` names; the cache; the official address,
    if there is one. In a folder, the file must have its publisher's name, or `<model name>.pt`, `.pth` or `.safetensors`.

    Args:
        model_name: a key of `PRETRAINED_MODELS`.
        path: the user's own file, or a folder with it. A file of unknown hash is accepted, and its hash logged.
        allow_download: whether the network may be used.
        trust: asked about a downloaded file whose hash is neither published nor known from an earlier download; if None, such
            weights are not downloaded.
        progress: called with bytes while downloading; may raise to cancel, which leaves nothing behind.

    Raises:
        WeightsUnavailable: no source has them. The message says how to get them and where to put them.
        InputError: unknown model; `path` does not exist or holds another model; a file has the wrong hash or cannot be written.
    """
    model = pretrained_model(model_name)
    given = _given_file(model, path)
    if given is not None:
        return given
    try:
        return fetch_weights(model_name, allow_download=allow_download, trust=trust, progress=progress)
    except WeightsUnavailable as error:
        source, _ = _given_source(path)
        if source is None or not (others := _other_models(source)):
            raise
        raise WeightsUnavailable(f"{error}{others}") from error


def fetch_weights(
    model_name: str,
    *,
    allow_download: bool = True,
    trust: Trust | None = None,
    progress: Progress = no_progress,
) -> WeightsFile:
    """The weights of a model from the cache; if they are not there, they are downloaded into it.

    Arguments and errors are those of `find_weights`.
    """
    model = pretrained_model(model_name)
    folder = weights_folder()
    cached = file_in(folder, model)
    if cached is not None:
        return WeightsFile(cached, check_cached(model, cached), model, "cache")
    target = folder / model.file_name
    if not allow_download:
        raise _unavailable(model, target, "nobody was asked whether they may be downloaded")
    if model.request_page is not None:
        raise _unavailable(model, target, "their publisher gives them only to those who agree to its licence")
    if model.url is None:
        raise _unavailable(model, target, "nobody publishes them as a file")
    # A remembered hash outlives its file: a new download must have the same hash.
    expected = next(iter(trusted_hashes(model, target)), None)
    if expected is None and trust is None:
        look = f"'vittf weights get {model.name}' shows that of the file and asks whether to trust it"
        raise _unavailable(model, target, f"their publisher names no SHA-256; {look}")
    try:
        return _download(model, model.url, target, expected, trust, progress)
    except DownloadFailed as error:
        raise _unavailable(model, target, f"{error}; check the network, and try again") from error


def identify_model(path: str | Path | None = None) -> str | None:
    """Name of the model whose weights the user's file holds, recognised by the file's hash, else by its name.

    Args:
        path: the user's file, or a folder that holds files of one model only; None for the file that `VITTF_WEIGHTS` names. If
            that names a folder, it identifies no model, because it is only a place to look in.

    Returns:
        None if there is no such file, or neither its hash nor its name is known.

    Raises:
        InputError: the file or folder does not exist.
    """
    source, _ = _given_source(path)
    if source is None:
        return None
    if source.is_dir():
        there = _models_in(source) if path is not None else []
        return there[0] if len(there) == 1 else None
    return _model_of_hash(sha256_of(source)) or next(iter(_models_in(source)), None)


def files_of_environment() -> dict[str, Path]:
    """The files that `VITTF_WEIGHTS` supplies, by model name; they take precedence over those of the cache.

    Raises:
        InputError: the variable names a file or folder that does not exist.
    """
    source, _ = _given_source(None)
    if source is None:
        return {}
    if not source.is_dir():
        name = identify_model()
        return {} if name is None else {name: source}
    found = ((model.name, file_in(source, model)) for model in PRETRAINED_MODELS.values())
    return {name: path for name, path in found if path is not None}


def offered_models() -> list[str]:
    """Names of the models that a user can choose: those that can be downloaded or requested, or are on this computer.

    A model is on this computer if the folder or file of `VITTF_WEIGHTS` or the cache has a file with its name.
    """
    here: set[str] = set()
    # A folder that cannot exist holds no weights. The user is told when weights are needed.
    with suppress(InputError):
        here |= set(_models_in(weights_folder()))
    with suppress(InputError):
        source, _ = _given_source(None)
        if source is not None:
            here |= set(_models_in(source))
    return [
        model.name
        for model in PRETRAINED_MODELS.values()
        if model.url is not None or model.request_page is not None or model.name in here
    ]


def _given_file(model: PretrainedModel, path: str | Path | None) -> WeightsFile | None:
    source, origin = _given_source(path)
    if source is None:
        return None
    file = file_in(source, model) if source.is_dir() else source
    if file is None:
        if path is not None:
            raise InputError(
                f"{source} holds no weights of '{model.name}'; expected a file {' or '.join(file_names(model))}."
                f"{_other_models(source)}"
            )
        # The variable's folder is only a place to look in, such as a department's shared drive. The cache is the next place.
        return None
    sha256 = sha256_of(file)
    _check_may_be(model, file, sha256, origin)
    return WeightsFile(file, sha256, model, origin)


def _other_models(folder: Path) -> str:
    """A sentence, to append to a message, about the models whose weights a folder holds; "" if it holds none."""
    there = [f"'{name}'" for name in _models_in(folder)]
    if not there:
        return ""
    return (
        f" There are those of {', '.join(there)} in {folder}: to use them, name that file itself, or choose that model, under "
        "Advanced or by --model."
    )


def _models_in(source: Path) -> list[str]:
    """Names of the models whose weights a folder or file holds, judging by file names."""
    if source.is_file():
        return [model.name for model in PRETRAINED_MODELS.values() if source.name in file_names(model)]
    return [model.name for model in PRETRAINED_MODELS.values() if file_in(source, model) is not None]


def _given_source(path: str | Path | None) -> tuple[Path | None, str]:
    """The existing file or folder that the user names (None if none is named), and how it is named, in words."""
    origin = "given path" if path is not None else WEIGHTS_VARIABLE
    named = path if path is not None else os.environ.get(WEIGHTS_VARIABLE)
    if not named:
        return None, origin
    source = user_path(named, f"a weights file ({origin})")
    if not source.exists():
        raise InputError(
            f"There is no weights file {source} ({origin}). Correct the path, or name none to use the model's own."
        )
    if not source.is_dir():
        check_regular_file(source)
    return source, origin


def _check_may_be(model: PretrainedModel, path: Path, sha256: str, origin: str) -> None:
    owner = _model_of_hash(sha256)
    if owner is not None and owner != model.name:
        raise InputError(
            f"{path} ({origin}) holds the weights of '{owner}', expected those of '{model.name}'. "
            f"Choose the model '{owner}', or name another file."
        )
    if owner is None and sha256 not in trusted_hashes(model, path):
        _logger.warning(
            "%s has SHA-256 %s, which is not known as that of '%s'. It is used all the same.", path, sha256, model.name
        )


def _model_of_hash(sha256: str) -> str | None:
    return next((model.name for model in PRETRAINED_MODELS.values() if model.is_published(sha256)), None)


def _download(
    model: PretrainedModel, url: str, target: Path, expected: str | None, trust: Trust | None, progress: Progress
) -> WeightsFile:
    sha256 = download(
        url,
        target,
        expected_sha256=expected,
        accept=lambda sha256: trust is not None and trust(model, sha256),
        most_bytes=_SIZE_TOLERANCE * model.size_mb * 10**6,
        what=f"Downloading {model.name}",
        progress=progress,
    )
    if expected is None:
        remember(model, target, sha256)
    return WeightsFile(target, sha256, model, f"downloaded from {url}")


def _unavailable(model: PretrainedModel, target: Path, reason: str) -> WeightsUnavailable:
    if model.request_page is not None:
        how = f"Ask for {model.file_name} at {model.request_page} ({model.licence}, {model.size_mb} MB)"
    elif model.url is None:
        how = f"Run 'vittf weights get {model.name}' on a computer with a network"
    else:
        file = "that file" if model.url in reason else model.url
        how = f"Get {file} ({model.licence}, {model.size_mb} MB) on a computer with a network"
    return WeightsUnavailable(
        f"There are no weights of '{model.name}' on this computer, and they could not be fetched: {reason}. "
        f"{how}. Put the file anywhere on this computer, and name it under Advanced, Weights, by --weights, or in "
        f"{WEIGHTS_VARIABLE}; or copy it to {target}."
    )
