"""Where the 3D rendering lies that belongs to a slice picture."""

from __future__ import annotations

from pathlib import Path


def rendering_path(path: Path) -> Path:
    """Where the 3D rendering lies, by the path of the slice picture."""
    return path.with_name(f"{path.stem}_3d{path.suffix}")
