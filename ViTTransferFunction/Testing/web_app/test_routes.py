"""What becomes of a file before it is sent."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("trame_slicer")

from ViTTransferFunction.Logic.core.system.progress import no_progress
from ViTTransferFunction.WebApp.routes import _as_it_is


def test_what_is_sent_as_it_is_is_not_renamed_while_a_virus_scanner_looks_at_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(path: Path, target: Path) -> None:
        raise PermissionError(13, "The process cannot access the file", str(path))

    for name in ("replace", "rename"):
        monkeypatch.setattr(Path, name, refused)
    (tmp_path / "staged").write_bytes(b"points")
    _as_it_is(tmp_path / "staged", tmp_path / "scan.annotations.json", no_progress)
    assert (tmp_path / "scan.annotations.json").read_bytes() == b"points"
