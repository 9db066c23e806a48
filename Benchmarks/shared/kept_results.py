"""Measurements that are made once and kept, so that a long benchmark can be had in parts."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from Benchmarks.shared.report_files import write_text


class KeptResults:
    """A folder of JSON files, one for each measurement.

    Args:
        folder: what is there is taken as it is; None: everything is measured, and nothing kept.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder

    def get(self, name: str, measure: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """The measurement called `name`, made now if it is not there."""
        path = self._folder / f"{name}.json" if self._folder else None
        if path is None or not path.exists():
            print(name, flush=True)
            measured = measure()
            if path is None:
                return measured
            write_text(path, json.dumps(measured))
        return json.loads(path.read_text(encoding="utf-8"))
