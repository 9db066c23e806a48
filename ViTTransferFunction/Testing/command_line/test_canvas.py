"""What a picture is made of, and its file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.CommandLine.canvas import PictureSegment
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.scene.views.png_file import save_png


def test_similarity_needs_an_iso_value() -> None:
    mask = np.zeros((3, 3, 3), dtype=bool)
    with pytest.raises(ValueError, match="iso"):
        PictureSegment("any", (1.0, 0.0, 0.0), 1.0, mask, similarity=mask.astype(float))


def test_png_holds_the_picture_the_right_way_up(tmp_path: Path) -> None:
    picture = np.zeros((5, 7, 3), dtype=np.uint8)
    picture[0, 6] = 255, 128, 3
    save_png(picture, tmp_path / "new folder" / "picture.png")

    read = sitk.GetArrayFromImage(sitk.ReadImage(str(tmp_path / "new folder" / "picture.png")))
    assert np.array_equal(read, picture)


def test_unwritable_png_is_an_input_error_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "a folder.png").mkdir()
    with pytest.raises(InputError, match="write"):
        save_png(np.zeros((5, 7, 3), dtype=np.uint8), tmp_path / "a folder.png")

    assert [path.name for path in tmp_path.iterdir()] == ["a folder.png"]
