"""Messages between two processes: a JSON object and arrays, written to a stream of bytes. No pickles.

On the stream: the header's length (8 bytes, little-endian), the header (JSON in UTF-8: the content, and dtype and shape of each
array), then the arrays' values one after the other, in C order.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

_LENGTH = struct.Struct("<Q")


@dataclass(frozen=True, eq=False)
class Message:
    """What is said in one go.

    Attributes:
        content: anything that JSON can hold.
        arrays: numbers and booleans of any shape.
    """

    content: dict[str, Any]
    arrays: tuple[np.ndarray, ...] = ()


def write_message(stream: BinaryIO, message: Message) -> None:
    """Write a message and flush. Raises OSError where the other side is gone."""
    arrays = [np.ascontiguousarray(array) for array in message.arrays]
    described = [{"dtype": array.dtype.str, "shape": array.shape} for array in arrays]
    header = json.dumps({"content": message.content, "arrays": described}).encode()
    stream.write(_LENGTH.pack(len(header)))
    stream.write(header)
    for array in arrays:
        stream.write(array.reshape(-1).view(np.uint8).data)
    stream.flush()


def read_message(stream: BinaryIO) -> Message | None:
    """Wait for the next message; None where the stream ends before it is complete."""
    try:
        (length,) = _LENGTH.unpack(_read(stream, bytearray(_LENGTH.size)))
        header = json.loads(bytes(_read(stream, bytearray(length))))
        arrays = [_read_array(stream, **described) for described in header["arrays"]]
    except EOFError:
        return None
    return Message(header["content"], tuple(arrays))


def _read_array(stream: BinaryIO, dtype: str, shape: list[int]) -> np.ndarray:
    array = np.empty(shape, dtype=np.dtype(dtype))
    _read(stream, array.reshape(-1).view(np.uint8).data)
    return array


def _read(stream: BinaryIO, buffer: bytearray | memoryview) -> bytearray | memoryview:
    """Fill `buffer` from the stream. Raises EOFError where it ends too early."""
    view = memoryview(buffer)
    done = 0
    while done < len(view):
        # A read from a pipe may return fewer bytes than asked for.
        count = stream.readinto(view[done:])  # type: ignore[attr-defined]
        if not count:
            raise EOFError
        done += count
    return buffer
