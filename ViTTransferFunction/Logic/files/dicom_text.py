"""Texts of DICOM headers, in the characters that they are written in (DICOM PS3.3, C.12.1.1.2)."""

from __future__ import annotations

import re

import SimpleITK as sitk  # noqa: N813

_CHARACTER_SET = "0008|0005"

_ENCODINGS = {
    "13": "shift_jis",
    "58": "gb2312",
    "87": "iso2022_jp_2",
    "101": "iso8859_2",
    "109": "iso8859_3",
    "110": "iso8859_4",
    "126": "iso8859_7",
    "127": "iso8859_6",
    "138": "iso8859_8",
    "144": "iso8859_5",
    "148": "iso8859_9",
    "149": "euc_kr",
    "159": "iso2022_jp_2",
    "166": "tis_620",
    "203": "iso8859_15",
    "GB18030": "gb18030",
    "GBK": "gbk",
}
"""By the number of a character set, or its name. Western European letters are not among them: UTF-8 is often called that."""

_CHANGES_OF_SET = re.compile(rb"\x1b[\x20-\x2f]+[\x30-\x7e]")
"""Escape sequences of ISO 2022, which Python's encodings know for Japanese only."""


def text_of(reader: sitk.ImageFileReader, tag: str) -> str:
    """What a header has under a tag, in one line.

    Letters that are not of the character set that the header names are UTF-8, or else taken for Western European ones.

    Args:
        reader: which has read the header.
        tag: as ITK writes it, such as "0008|103e".

    Returns:
        The text without spaces around it; "" where there is none.
    """
    text = _decoded(_written(reader, tag), _written(reader, _CHARACTER_SET).decode("latin-1"))
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def _written(reader: sitk.ImageFileReader, tag: str) -> bytes:
    return reader.GetMetaData(tag).encode("utf-8", "surrogateescape") if reader.HasMetaDataKey(tag) else b""


def _decoded(written: bytes, character_sets: str) -> str:
    """A text in the last of several sets, which those before it are extended by."""
    names = [name.strip().replace("ISO 2022 IR ", "").replace("ISO_IR ", "") for name in character_sets.split("\\")]
    declared = [_ENCODINGS[name] for name in reversed(names) if name in _ENCODINGS]
    texts = (_in_encoding(written, encoding) for encoding in (*declared, "utf-8"))
    return next((text for text in texts if text is not None), written.decode("latin-1"))


def _in_encoding(written: bytes, encoding: str) -> str | None:
    """The text, or None where it is none in that encoding."""
    try:
        return (written if encoding.startswith("iso2022") else _CHANGES_OF_SET.sub(b"", written)).decode(encoding)
    except UnicodeDecodeError:
        return None
