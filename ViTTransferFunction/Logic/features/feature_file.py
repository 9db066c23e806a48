"""The file that features are cached in: arrays in an archive without compression, as NumPy writes it, and never pickles."""

from __future__ import annotations

import lzma
import math
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import numpy as np

from ..core.volumes.geometry import Geometry
from .feature_volume import FeatureVolume, Moments

_BLOCK_BYTES = 1 << 20
_TYPES = {np.dtype(name) for name in ("float16", "float32", "float64")}
"""Of values in a file; as this computer has them, in the order of bytes as well."""
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


def write_features(file: IO[bytes], features: FeatureVolume) -> None:
    """Write features to a file that is open for it."""
    arrays = {
        "features": features.array,
        "ijk_to_ras": features.geometry.ijk_to_ras,
        "cells": np.array(features.cells.shape, dtype=np.float64),
        "cells_to_ras": features.cells.ijk_to_ras,
    }
    if features.moments is not None:
        # They take as long to find out as the features to read.
        arrays |= {"mean": features.moments.mean, "covariance": features.moments.covariance}
    # `numpy.savez` of NumPy 2.0 does not close the archive where the disk is full, which then complains on the console.
    with zipfile.ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)


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
        cells = Geometry((k, j, i), _read_array(archive, "cells_to_ras"))
        return FeatureVolume(array, geometry, key, cells, _read_moments(archive, array.shape[3]))


@contextmanager
def _archive(file: IO[bytes]) -> Iterator[zipfile.ZipFile]:
    """Reads a file; whatever shows that it is damaged becomes a ValueError."""
    try:
        with zipfile.ZipFile(file) as archive:
            yield archive
    except _DAMAGED as error:
        raise ValueError(str(error) or type(error).__name__) from error


def _read_moments(archive: zipfile.ZipFile, channels: int) -> Moments | None:
    """None where the file has none."""
    if "mean.npy" not in archive.namelist():
        return None
    moments = Moments(_read_array(archive, "mean"), _read_array(archive, "covariance"))
    if moments.mean.shape != (channels,) or moments.covariance.shape != (channels, channels):
        raise ValueError(f"the moments are not of {channels} channels")
    return moments


def _read_array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """An array of numbers, as `numpy.load` reads it."""
    info = archive.getinfo(f"{name}.npy")
    if info.compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"{info.filename} is compressed")
    with archive.open(info) as member:
        np.lib.format.read_magic(member)
        shape, fortran_order, dtype = np.lib.format.read_array_header_1_0(member)
        # Before there is room made for it: a flipped bit can make a size absurd.
        if fortran_order or dtype not in _TYPES or member.tell() + math.prod(shape) * dtype.itemsize != info.file_size:
            raise ValueError(f"{info.filename} is not what its header says")
        if not math.prod(shape):
            raise ValueError(f"{info.filename} holds nothing")
        array = np.empty(shape, dtype)
        values = array.reshape(-1).view(np.uint8)
        for start in range(0, values.size, _BLOCK_BYTES):
            # The last one compares the checksum.
            block = np.frombuffer(member.read(_BLOCK_BYTES), np.uint8)
            if not all_finite(block.view(dtype)):
                raise ValueError(f"{name} holds values that are not numbers")
            values[start : start + _BLOCK_BYTES] = block
    return array


def all_finite(values: np.ndarray) -> bool:
    """Whether no exponent has all of its bits set; `numpy.isfinite` takes many times as long in half precision."""
    form = np.finfo(values.dtype)
    exponent = ((1 << form.nexp) - 1) << form.nmant
    bits = values.view(f"u{values.itemsize}")
    return not values.size or int((bits & bits.dtype.type(exponent)).max()) < exponent
