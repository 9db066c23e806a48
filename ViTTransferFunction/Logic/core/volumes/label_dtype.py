"""Which numbers labels are."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..system.errors import InputError


def label_dtype(count: int) -> type[np.unsignedinteger[Any]]:
    """The smallest type for labels of `count` structures, 0 for background and 1 + index for each: uint8, or uint16 beyond 255.

    Raises:
        InputError: there are more than such labels can tell apart.
    """
    if count > np.iinfo(np.uint16).max:
        raise InputError(f"There are {count} structures; expected {np.iinfo(np.uint16).max} at most. Leave some of them out.")
    return np.uint8 if count <= np.iinfo(np.uint8).max else np.uint16
