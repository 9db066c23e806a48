"""The weights that lie in the user's cache, and which of them are trusted.

A file is trusted by its SHA-256. Where its publisher names one, no other is accepted. Where nobody does, the hash of the first
file is logged, remembered in `<file name>.sha256` beside it if that can be written, and no other is accepted from then on.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from ..core.system.atomic_file import replacing
from ..core.system.cache_folder import cache_folder
from ..core.system.errors import InputError
from .download import sha256_of
from .models import PRETRAINED_MODELS, PretrainedModel, pretrained_model
from .state_dict import load_state_dict, tensors_sha256

_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class CachedWeights:
    """What the cache holds of a model.

    Attributes:
        model: the model.
        path: its file; None where there is none.
        sha256: hexadecimal hash of the file's content; None where there is none.
        intact: whether the file is one that would be accepted.
    """

    model: PretrainedModel
    path: Path | None
    sha256: str | None
    intact: bool


def weights_folder() -> Path:
    """The folder of the cache that holds weights. It need not exist."""
    return cache_folder() / "weights"


def list_weights() -> list[CachedWeights]:
    """What the cache holds of every model. Reads every file in full."""
    folder = weights_folder()
    return [_cached_weights(model, file_in(folder, model)) for model in PRETRAINED_MODELS.values()]


def remove_weights(model_name: str) -> list[Path]:
    """Delete a model's weights from the cache, together with their remembered hash.

    The user's own files, elsewhere, are never touched.

    Returns:
        The deleted files.

    Raises:
        InputError: unknown model; the cache does not hold it; a file cannot be deleted.
    """
    model = pretrained_model(model_name)
    folder = weights_folder()
    candidates = [path for name in file_names(model) for path in (folder / name, _sidecar(folder / name))]
    paths = [path for path in candidates if path.is_file()]
    if not paths:
        raise InputError(f"Nothing to remove: {folder} holds no weights of '{model.name}'.")
    for path in paths:
        _delete(path)
    return paths


def check_cached(model: PretrainedModel, path: Path) -> str:
    """Hexadecimal SHA-256 of a model's cached file, once it is sure that the file is the right one.

    Raises:
        InputError: it is not.
    """
    sha256 = sha256_of(path)
    if not _is_intact(model, path, sha256):
        raise InputError(
            f"{path} was changed or is damaged: its SHA-256 is {sha256}, expected {' or '.join(trusted_hashes(model, path))}. "
            f"Remove it (Remove model under Advanced, or 'vittf weights remove {model.name}') and get it again."
        )
    if sha256 not in trusted_hashes(model, path):
        try:
            remember(model, path, sha256)
        except InputError as error:
            # Whoever put it there, for many users say, is the one who may write there.
            _logger.warning("%s is used, but its SHA-256, %s, cannot be remembered: %s", path, sha256, error)
    return sha256


def trusted_hashes(model: PretrainedModel, path: Path) -> list[str]:
    """The hashes that a model's file at `path` may have; empty where neither a published nor a remembered one is known."""
    published = [] if model.sha256 is None else [model.sha256]
    # A remembered hash counts beside a published one only where a file that was made anew has bytes of its own.
    return published if published and model.tensors_sha256 is None else published + _remembered(path)


def remember(model: PretrainedModel, path: Path, sha256: str) -> None:
    """Accept no other file than this one at `path` from now on."""
    # The form that `sha256sum --check` reads.
    with replacing(_sidecar(path)) as part:
        part.write_text(f"{sha256}  {path.name}\n", encoding="utf-8")
    if model.sha256 is None:
        _logger.warning(
            "No hash is published for the weights of '%s'. Those in %s have SHA-256 %s; from now on, only these are accepted.",
            model.name,
            path,
            sha256,
        )


def file_names(model: PretrainedModel) -> list[str]:
    """What a file with the model's weights may be called: as its publisher calls it, or after the model."""
    # Without repetition: dinov2_vits14_focus is published under its own name.
    return list(dict.fromkeys((model.file_name, *(f"{model.name}.{suffix}" for suffix in ("pt", "pth", "safetensors")))))


def file_in(folder: Path, model: PretrainedModel) -> Path | None:
    """The file in `folder` that is called as the model's weights may be; None where there is none."""
    return next((folder / name for name in file_names(model) if (folder / name).is_file()), None)


def _cached_weights(model: PretrainedModel, path: Path | None) -> CachedWeights:
    if path is None:
        return CachedWeights(model, None, None, intact=False)
    sha256 = sha256_of(path)
    return CachedWeights(model, path, sha256, intact=_is_intact(model, path, sha256))


def _is_intact(model: PretrainedModel, path: Path, sha256: str) -> bool:
    trusted = trusted_hashes(model, path)
    # Without any hash to go by, this is the first use of a file that the user put there.
    return not trusted or sha256 in trusted or _is_rebuilt(model, path)


def _is_rebuilt(model: PretrainedModel, path: Path) -> bool:
    """Whether `path` was made anew, on another computer, and came from there without its remembered hash."""
    if model.tensors_sha256 is None:
        return False
    try:
        return tensors_sha256(load_state_dict(path)) == model.tensors_sha256
    except InputError:
        return False


def _remembered(path: Path) -> list[str]:
    sidecar = _sidecar(path)
    return sidecar.read_text(encoding="utf-8", errors="replace").split()[:1] if sidecar.is_file() else []


def _sidecar(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _delete(path: Path) -> None:
    try:
        path.unlink()
    except OSError as error:
        raise InputError(f"Cannot remove {path} ({error.strerror or error}). Close what uses it and try again.") from error
