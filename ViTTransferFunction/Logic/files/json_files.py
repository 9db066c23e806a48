"""JSON that a user wrote: read, or refused with what is wrong with it."""

from __future__ import annotations

import json
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

from ..core.system.errors import InputError, shown
from ..core.system.regular_file import cannot_read, check_regular_file
from .image_formats import image_ending


def read_json(path: Path) -> Any:
    """The content of a JSON file in UTF-8.

    Raises:
        InputError: it cannot be read, is an image or empty, is no JSON, or names a field twice in one place.
    """
    check_regular_file(path)
    if image_ending(path) is not None:
        raise InputError(f"{path} is an image, by its ending; expected a file of JSON, such as one of points. Name that one.")
    try:
        # Notepad puts a mark in front.
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise cannot_read(path, error) from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not a text in UTF-8, as JSON is ({error.reason} at byte {error.start}). Save it as UTF-8."
        ) from error
    if not text.strip():
        raise InputError(f"{path} is empty; expected JSON. Save it again, or copy it again from where it came.")
    try:
        return json.loads(text, object_pairs_hook=partial(_without_repetition, path))
    except RecursionError as error:
        raise InputError(f"{path} cannot be used: its brackets are nested too deeply.") from error
    except json.JSONDecodeError as error:
        raise InputError(f"{path} is not valid JSON: {error}. {_advice(text)}") from error
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path} is not valid JSON: it holds a number of thousands of digits. Correct or remove it."
        ) from error


def _advice(text: str) -> str:
    """What to do about a text that is not JSON: a damaged file, or one of another kind."""
    if text.lstrip().startswith(("{", "[")):
        return "Correct it there, or save it again."
    return "If it is a table of points, load it in Slicer, and save the list as .mrk.json."


def _without_repetition(path: Path, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A dictionary of pairs. Of two fields of one name, JSON would silently keep the second, and the first would be lost."""
    fields = dict(pairs)
    if len(fields) < len(pairs):
        name, _ = Counter(name for name, _ in pairs).most_common(1)[0]
        raise InputError(f"{path}: the field {shown(name)} stands twice in one place; join them, or remove one.")
    return fields
