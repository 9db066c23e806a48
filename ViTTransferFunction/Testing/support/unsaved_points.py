"""Files of points that are saved nowhere else, as tests look for them."""

from __future__ import annotations

from pathlib import Path

from ViTTransferFunction.Logic.core.system.atomic_file import TEMPORARY


def kept_in(folder: Path) -> list[Path]:
    """The files of unsaved points in a folder, without those that are still being written."""
    return sorted(path for path in folder.glob("*.annotations.json") if not path.name.startswith(TEMPORARY))
