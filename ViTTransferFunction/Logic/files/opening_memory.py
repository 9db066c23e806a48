"""Refusing to open what memory has no room for, before its voxels are read."""

from __future__ import annotations

from pathlib import Path

import SimpleITK as sitk  # noqa: N813

from ..core.system.available_memory import require_memory


def require_memory_to_open(path: Path, voxels: int, pixel_id: int, copies: int = 1) -> None:
    """Refuse an image that ITK could not read into memory.

    Args:
        path: of the file or folder, for the message.
        voxels: how many the image has.
        pixel_id: SimpleITK's, of the image that is read.
        copies: of the voxels, while ITK reads them.

    Raises:
        InputError: memory has no room for it.
    """
    needed_bytes = copies * voxels * pixel_bytes(pixel_id)
    require_memory(needed_bytes, f"Opening {path}", "Close other programs, or resample it to larger voxels.")


def pixel_bytes(pixel_id: int) -> int:
    """How many bytes a pixel of one component takes in memory."""
    return int(sitk.Image([1, 1, 1], pixel_id).GetSizeOfPixelComponent())
