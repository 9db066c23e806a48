"""Temporary files of processes that were killed."""

from __future__ import annotations

from pathlib import Path

from ViTTransferFunction.Logic.core.atomic_file import remove_leftovers, replacing


def test_what_a_killed_process_was_writing_is_removed_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "a.seg.nrrd").write_text("whole")
    with replacing(tmp_path / "b.seg.nrrd") as temporary:
        temporary.write_text("half")
        left = temporary.with_name(f"{temporary.name}-of-another.nrrd")
        left.write_text("half")
    assert left.exists()

    remove_leftovers(tmp_path)

    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.seg.nrrd", "b.seg.nrrd"]
