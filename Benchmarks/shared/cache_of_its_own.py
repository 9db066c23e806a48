"""A cache for features that a benchmark makes up, or computes anew, apart from the user's."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch


@contextmanager
def cache_of_its_own() -> Iterator[Path]:
    """An empty folder that this process and those that it starts have as their cache meanwhile; it is removed in the end."""
    with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ, {"VITTF_CACHE": folder}):
        # Made-up features are those of the preset's own model: with weights of another one they would be computed instead.
        os.environ.pop("VITTF_WEIGHTS", None)
        yield Path(folder)
