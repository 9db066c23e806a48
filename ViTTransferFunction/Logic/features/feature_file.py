"""The file that features are cached in: arrays in an archive without compression, as NumPy writes it, and never pickles."""

from __future__ import annotations

import io
import lzma
import math
import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, cast

import numpy as np

from ..core.geometry import Geometry
from .feature_volume import FeatureVolume
from .stored_features import ArrayInFile, StoredFeatures
from .whitening import FeatureTransform, NormalisedFeatures

_BLOCK_BYTES = 1 << 20
_HEADER_BYTES = 30
"""Of what stands in front of each name in a zip file."""
_TYPES = {np.dtype(name) for name in ("float16", "float32", "float64")}
"""Of values in a file; as this computer has them, in the order of bytes as well."""
_WHITENED = ("whitened", "mean", "directions")
"""What a file holds beside the features and where they lie, if they were kept with the whitened ones; the directions are the
projection's columns, which lie like that in memory: another order may give products other last digits."""
_DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    RuntimeError,
    LookupError,
    TypeError,
    EOFError,
    AttributeError,
    OverflowError,
    SyntaxError,
)
"""What reading a damaged archive raises beside OSError and ValueError: an encrypted file or an unknown method, say, is a
RuntimeError. Found by flipping the bits of one."""


def write_features(file: IO[bytes], features: FeatureVolume, whitened: NormalisedFeatures | None) -> None:
    """Write features, and the same whitened if there are such, to a file that is open for it."""
    arrays = {
        "features": features.array,
        "ijk_to_ras": features.geometry.ijk_to_ras,
        "cells": np.array(features.cells.shape, dtype=np.float64),
        "cells_to_ras": features.cells.ijk_to_ras,
        **_arrays_of(whitened),
    }
    np.savez(file, **arrays)  # type: ignore[arg-type]


def read_features(path: Path, key: str) -> FeatureVolume:
    """The features of a file, complete and with matching checksums.

    Raises:
        OSError: it cannot be read.
        ValueError: it is damaged.
    """
    with path.open("rb") as file, _archive(file) as archive:
        array = _read_array(archive, "features")
        geometry = Geometry(array.shape[:3], _read_array(archive, "ijk_to_ras"))
        k, j, i = _read_array(archive, "cells").astype(int).tolist()
        return FeatureVolume(array, geometry, key, Geometry((k, j, i), _read_array(archive, "cells_to_ras")))


def read_whitened(path: Path, key: str) -> NormalisedFeatures | None:
    """The whitened features of a file, if it has any; the others are only looked through. Errors as `read_features`."""
    file = path.open("rb")
    with ExitStack() as unless_kept:
        unless_kept.callback(file.close)
        with _archive(file) as archive:
            if not all(f"{name}.npy" in archive.namelist() for name in _WHITENED):
                return None
            place = _checked_array(archive, "features")
            array, mean, directions = (_read_array(archive, name) for name in _WHITENED)
            if array.shape[3:] + place.shape[3:] != directions.shape or mean.shape != place.shape[3:]:
                raise ValueError(f"features of shape {array.shape} are not whitened ones of features of shape {place.shape}")
            k, j, i = place.shape[:3]
            geometry = Geometry((k, j, i), _read_array(archive, "ijk_to_ras"))
            cells = Geometry(array.shape[:3], _read_array(archive, "cells_to_ras"))
        stored = StoredFeatures(file, place, geometry, key, cells)
        unless_kept.pop_all()
        return NormalisedFeatures(array, cells, FeatureTransform(mean, directions.T), stored)


def _arrays_of(whitened: NormalisedFeatures | None) -> dict[str, np.ndarray]:
    if whitened is None or whitened.transform.projection is None:
        return {}
    arrays = (whitened.array, whitened.transform.mean, whitened.transform.projection.T)
    return {name: np.ascontiguousarray(array) for name, array in zip(_WHITENED, arrays, strict=True)}


@contextmanager
def _archive(file: IO[bytes]) -> Iterator[zipfile.ZipFile]:
    """Reads a file; whatever shows that it is damaged becomes a ValueError."""
    try:
        with zipfile.ZipFile(file) as archive:
            yield archive
    except _DAMAGED as error:
        raise ValueError(str(error) or type(error).__name__) from error


def _read_array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """An array of numbers, as `numpy.load` reads it."""
    place, crc = _place_of(archive, name)
    array = np.empty(place.shape, place.dtype)
    values = array.reshape(-1).view(np.uint8).data
    blocks = (values[start : start + _BLOCK_BYTES] for start in range(0, len(values), _BLOCK_BYTES))
    _read_checked(archive, name, place, crc, blocks)
    return array


def _checked_array(archive: zipfile.ZipFile, name: str) -> ArrayInFile:
    """Where an array lies that is all there, by its checksum."""
    place, crc = _place_of(archive, name)
    size = math.prod(place.shape) * place.dtype.itemsize
    # Always the same block: fresh memory costs more than reading does.
    block = memoryview(bytearray(_BLOCK_BYTES))
    _read_checked(archive, name, place, crc, (block[: size - start] for start in range(0, size, _BLOCK_BYTES)))
    return place


def _place_of(archive: zipfile.ZipFile, name: str) -> tuple[ArrayInFile, int]:
    """Where an array lies in an archive's file, and the checksum of what stands before it under its name."""
    info = archive.getinfo(f"{name}.npy")
    if info.compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"{info.filename} is compressed")
    with archive.open(info) as member:
        np.lib.format.read_magic(member)
        shape, fortran_order, dtype = np.lib.format.read_array_header_1_0(member)
        header_bytes = member.tell()
        # Before there is room made for it: a flipped bit can make a size absurd.
        if fortran_order or dtype not in _TYPES or header_bytes + math.prod(shape) * dtype.itemsize != info.file_size:
            raise ValueError(f"{info.filename} is not what its header says")
        if not math.prod(shape):
            raise ValueError(f"{info.filename} holds nothing")
        member.seek(0)
        crc = zlib.crc32(member.read(header_bytes))
    return ArrayInFile(_start(archive, info) + header_bytes, shape, dtype), crc


def _read_checked(archive: zipfile.ZipFile, name: str, place: ArrayInFile, crc: int, blocks: Iterable[memoryview]) -> None:
    """Read an array into blocks, which may be the same memory; not through `zipfile`, which takes three times as long."""
    file = cast(io.BufferedReader, archive.fp)
    file.seek(place.start)
    for block in blocks:
        if file.readinto(block) != len(block):
            raise EOFError(f"{name} ends early")
        crc = zlib.crc32(block, crc)
        if not all_finite(np.frombuffer(block, place.dtype)):
            raise ValueError(f"{name} holds values that are not numbers")
    if crc != archive.getinfo(f"{name}.npy").CRC:
        raise ValueError(f"the checksum of {name} is another one")


def all_finite(values: np.ndarray) -> bool:
    """Whether no exponent has all of its bits set; `numpy.isfinite` takes many times as long in half precision."""
    form = np.finfo(values.dtype)
    exponent = ((1 << form.nexp) - 1) << form.nmant
    bits = values.view(f"u{values.itemsize}")
    return not values.size or int((bits & bits.dtype.type(exponent)).max()) < exponent


def _start(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> int:
    """Offset in the file of what is stored under a name: behind a header that ends with the lengths of two fields after it."""
    file = cast(io.BufferedReader, archive.fp)
    file.seek(info.header_offset)
    header = file.read(_HEADER_BYTES)
    of_name, of_extra = struct.unpack("<HH", header[-4:])
    return int(info.header_offset + _HEADER_BYTES + of_name + of_extra)
