"""Cached features and weights that were changed, damaged, replaced by something else, or carry code."""

from __future__ import annotations

import io
import json
import os
import pickle
import random
import shutil
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ViTTransferFunction.Testing.attack.annotation_attacks import write_scan
from ViTTransferFunction.Testing.attack.cases import Case, Place, Step
from ViTTransferFunction.Testing.attack.damage import damage_file, flip_bits

DONE = frozenset({0})
PROOF = "code was run"
"""Name of the file that code in a pickle makes, where it is run."""


class Bomb:
    """Pickled, it is an order to make a file."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / PROOF

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self._path),)


def changed_features(chance: random.Random, place: Place) -> Case:
    """Cached features that are none any more: they are computed anew, and the result is the same."""
    scan = write_scan(chance, place)
    how = chance.choice(list(_changes(chance, place)))

    def change() -> None:
        for path in (place.cache / "features").glob("*.npz"):
            _changes(chance, place)[how](path)

    calls = [place.segment("scan.nrrd", output=f"out{n}.nii.gz") for n in range(2)]
    steps = [Step((calls[0],), DONE), Step((calls[1],), DONE, before=change)]
    return Case("cache", how, steps, scan, alike=True, judge=lambda _: [*_code_was_run(place), *_cache_wrong(place)])


def _changes(chance: random.Random, place: Place) -> dict[str, Callable[[Path], object]]:
    def replaced(make: Callable[[Path], object]) -> Callable[[Path], object]:
        return lambda path: _put_instead(path, make)

    def with_arrays(**arrays: Any) -> Callable[[Path], object]:
        def change(path: Path) -> None:
            with np.load(path) as content:
                kept = dict(content)
            np.savez(path, **{name: arrays.get(name, lambda array: array)(array) for name, array in kept.items()})

        return change

    def directory(path: Path) -> None:
        content = path.read_bytes()
        at = content.rindex(b"PK\x01\x02")
        path.write_bytes(content[:at] + flip_bits(content[at:], chance))

    def headers(path: Path) -> None:
        path.write_bytes(flip_bits(path.read_bytes(), chance, within=300))

    def pickled(path: Path) -> None:
        np.savez(path, features=np.array([Bomb(place.work)], dtype=object), ijk_to_ras=np.eye(4))

    def other_method(path: Path) -> None:
        with np.load(path) as content, zipfile.ZipFile(path.with_suffix(".zip"), "w", zipfile.ZIP_LZMA) as archive:
            for name, array in content.items():
                buffer = io.BytesIO()
                np.save(buffer, array)
                archive.writestr(f"{name}.npy", buffer.getvalue())
        path.with_suffix(".zip").replace(path)

    return {
        "damaged": lambda path: damage_file(path, chance),
        "damaged directory": directory,
        "damaged headers": headers,
        "pickled code": pickled,
        "another compression": other_method,
        "empty": lambda path: path.write_bytes(b""),
        "a folder": replaced(lambda path: path.mkdir()),
        "a link to nothing": replaced(lambda path: path.symlink_to("nowhere")),
        "a link to itself": replaced(lambda path: path.symlink_to(path.name)),
        "a link to the volume": replaced(lambda path: path.symlink_to(place.work / "scan.nrrd")),
        "a pipe": replaced(os.mkfifo),
        "NaN": with_arrays(features=lambda array: np.full_like(array, np.nan)),
        "one NaN": with_arrays(features=lambda array: np.where(np.arange(array.size).reshape(array.shape), array, np.nan)),
        "infinite": with_arrays(features=lambda array: np.full_like(array, np.inf)),
        "another shape": with_arrays(features=lambda array: array[:1]),
        "no cells": with_arrays(features=lambda array: array[:0]),
        "one axis less": with_arrays(features=lambda array: array[0]),
        "text": with_arrays(features=lambda array: np.array("features")),
        "complex": with_arrays(features=lambda array: array.astype(np.complex64)),
        "matrix of NaN": with_arrays(ijk_to_ras=lambda matrix: np.full_like(matrix, np.nan)),
        "matrix of zero": with_arrays(ijk_to_ras=np.zeros_like),
        "another matrix": with_arrays(ijk_to_ras=lambda matrix: matrix[:3]),
        "no matrix": lambda path: np.savez(path, features=np.zeros((5, 5, 5, 24), np.float16)),
        "features folder is a file": lambda path: _put_instead(path.parent, lambda folder: folder.write_text("a file")),
        "features folder is a link to nothing": lambda path: _put_instead(
            path.parent, lambda folder: folder.symlink_to("nowhere")
        ),
    }


def _put_instead(path: Path, make: Callable[[Path], object]) -> None:
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    make(path)


def changed_weights(chance: random.Random, place: Place) -> Case:
    """A file of weights that is damaged, holds something else, or carries code."""
    import torch

    scan = write_scan(chance, place)
    path = place.work / chance.choice(("own.pth", "tiny.pth", "own.safetensors"))
    shutil.copy(place.weights, path)
    state = torch.load(place.weights, weights_only=True)
    name = chance.choice(list(state))

    def saved(**changed: Any) -> None:
        torch.save({**state, **changed}, path)

    ways: dict[str, Callable[[], object]] = {
        "damaged": lambda: damage_file(path, chance),
        "damaged headers": lambda: path.write_bytes(flip_bits(path.read_bytes(), chance, within=400)),
        "NaN": lambda: saved(**{name: torch.full_like(state[name], torch.nan)}),
        "infinite": lambda: saved(**{name: torch.full_like(state[name], torch.inf)}),
        "huge": lambda: saved(**{name: torch.full_like(state[name], 3e38)}),
        "zero": lambda: saved(**{key: torch.zeros_like(value) for key, value in state.items()}),
        "another shape": lambda: saved(**{name: torch.zeros(3, 3)}),
        "another type": lambda: saved(**{name: state[name].to(chance.choice((torch.int8, torch.complex64, torch.float64)))}),
        "one more": lambda: saved(head=torch.zeros(3)),
        "one less": lambda: torch.save({key: value for key, value in state.items() if key != name}, path),
        "a list": lambda: torch.save(list(state.values()), path),
        "nothing": lambda: torch.save({}, path),
        "numbers": lambda: saved(**{name: 1.0}),
        "pickled code": lambda: path.write_bytes(pickle.dumps(Bomb(place.work))),
        "code among tensors": lambda: saved(**{name: Bomb(place.work)}),
        "old format with code": lambda: torch.save({name: Bomb(place.work)}, path, _use_new_zipfile_serialization=False),
        "safetensors that lie": lambda: path.write_bytes(_lying_safetensors(chance)),
        "empty": lambda: path.write_bytes(b""),
        "folder": lambda: _put_instead(path, lambda there: there.mkdir()),
        "pipe": lambda: _put_instead(path, os.mkfifo),
        "link to nothing": lambda: _put_instead(path, lambda there: there.symlink_to("nowhere")),
        "link to a device": lambda: _put_instead(
            path, lambda there: there.symlink_to(chance.choice(("/dev/null", "/dev/full", "/dev/zero")))
        ),
        "no rights": lambda: path.chmod(0),
    }
    how = chance.choice(list(ways))
    ways[how]()
    given, environment = (["--weights", path.name], {}) if chance.random() < 0.7 else ([], {"VITTF_WEIGHTS": str(path)})
    call = place.segment("scan.nrrd", "--model", "tiny", *given, environment=environment, without_rights=how == "no rights")
    steps = [Step((call,))]
    return Case("weights", f"{how}: {path.name}", steps, scan, judge=lambda _: [*_code_was_run(place), *_cache_wrong(place)])


def _lying_safetensors(chance: random.Random) -> bytes:
    entry = {"dtype": "F32", "shape": [1, 2], "data_offsets": [0, 8]}
    odd: dict[str, Any] = chance.choice((
        {"shape": [2**40, 2**40]}, {"shape": [-1, -2]}, {"shape": "x"}, {"data_offsets": [8, 0]}, {"data_offsets": [0, 2**60]},
        {"dtype": "I64"}, {"dtype": None}, {"shape": [1.5]}, {"data_offsets": []}, {"shape": [[1]]}, {},
    ))  # fmt: skip
    header = json.dumps({"cls_token": {**entry, **odd}}).encode()
    length = chance.choice((len(header), len(header), 0, 2**63, 2**64 - 1, len(header) - 3))
    return length.to_bytes(8, "little") + header + bytes(8)


def _code_was_run(place: Place) -> Iterator[str]:
    if (place.work / PROOF).exists():
        yield "code in a file was run"


def _cache_wrong(place: Place) -> Iterator[str]:
    """What the cache holds is whole and finite."""
    folder = place.cache / "features"
    if not folder.is_dir():
        return
    for path in folder.iterdir():
        if path.name.startswith(".writing-"):
            yield f"left {path.name} in the cache"
        elif path.suffix == ".npz" and path.is_file():
            with np.load(path) as content:
                if not np.isfinite(content["features"].astype(np.float32)).all():
                    yield "features in the cache are not finite"
