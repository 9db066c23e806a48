"""What may be opened."""

from __future__ import annotations

from pathlib import Path

import pytest

from ViTTransferFunction.Logic.core.atomic_file import replacing
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.regular_file import check_regular_file


@pytest.mark.parametrize("name", ["\udcff.nii.gz", "scans \udcff/scan.nrrd"])
def test_names_that_are_no_text_are_refused_for_reading_and_writing(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="no text"):
        check_regular_file(tmp_path / name)
    with pytest.raises(InputError, match="no text"), replacing(tmp_path / name):
        pass
    assert not list(tmp_path.iterdir())
