"""Messages between two processes: a line of JSON each, on a stream of bytes, and arrays beside it in files. No pickles."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from .array_files import ArrayFiles


@dataclass(frozen=True, eq=False)
class Message:
    """What is said in one go.

    Attributes:
        content: anything that JSON can hold.
        arrays: numbers and booleans of any shape.
    """

    content: dict[str, Any]
    arrays: tuple[np.ndarray, ...] = ()


def write_message(stream: BinaryIO, message: Message, files: ArrayFiles) -> None:
    """Write a message and flush.

    Raises:
        ArraysNotWritten: there is no room for the arrays, say. Nothing was said.
        OSError: the other side is gone.
    """
    try:
        described = files.put(message.arrays) if message.arrays else None
    except (OSError, MemoryError) as error:
        raise ArraysNotWritten(str(error) or "too little memory") from error
    stream.write(json.dumps({"content": message.content, "arrays": described}).encode() + b"\n")
    stream.flush()


def read_message(stream: BinaryIO, files: ArrayFiles) -> Message | None:
    """Wait for the next message; None where the stream ends before it is complete. Raises as `message_of`."""
    line = read_line(stream)
    return None if line is None else message_of(line, files)


def read_line(stream: BinaryIO) -> bytes | None:
    """Wait for what the next message says; None where the stream ends before that is complete."""
    line = stream.readline()
    return line if line.endswith(b"\n") else None


def message_of(line: bytes, files: ArrayFiles) -> Message:
    """The message that a line says, with its arrays, which may take a while to read.

    Raises:
        ValueError: the line is no message.
        OSError: its arrays are not there.
    """
    try:
        message = json.loads(line)
    except RecursionError as error:
        raise ValueError(f"not a message: {line[:100]!r}") from error
    if not isinstance(message, dict) or not isinstance(message.get("content"), dict):
        raise ValueError(f"not a message: {line[:100]!r}")
    described = message.get("arrays")
    return Message(message["content"], files.take(described) if described else ())


class ArraysNotWritten(Exception):
    """The arrays of a message could not be handed over; the stream is as it was."""
