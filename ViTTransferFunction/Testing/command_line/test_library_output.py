"""What libraries print is kept from the console, and all that is meant for the user is not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.CommandLine.library_output import silenced_libraries
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Testing.support.programs import MODULE

COMMAND = [sys.executable, "-m", "ViTTransferFunction.CommandLine.vittf"]


def errors_of_a_process(arguments: list[str], folder: Path) -> list[str]:
    """The lines that `vittf` prints to the error stream, as it refuses."""
    environment = {**os.environ, "PYTHONPATH": str(MODULE.parent), "VITTF_CACHE": str(folder)}
    finished = subprocess.run(
        [*COMMAND, *arguments], cwd=folder, env=environment, capture_output=True, encoding="utf-8", check=False
    )
    assert finished.returncode == 2
    return finished.stderr.splitlines()


def test_a_refusal_is_one_line_and_more_only_where_it_is_asked_for(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    # ITK itself has something to say of this one, whose two places are the same to a quarter of a voxel.
    sitk.WriteImage(sitk.GetImageFromArray(np.ones((4, 5, 6), np.float32)), str(tmp_path / "scan.nii"))
    content = bytearray((tmp_path / "scan.nii").read_bytes())
    content[80:84] = np.float32(1.01).tobytes()
    (tmp_path / "scan.nii").write_bytes(content)

    (line,) = errors_of_a_process(["features", "scan.nii"], tmp_path)
    assert line.startswith("error: 'scan' is constant")
    scan = str(tmp_path / "scan.nii")
    for arguments in (["--verbose", "features", scan], ["features", scan, "--verbose"]):
        assert main(arguments) == 2
        lines = capfd.readouterr().err.splitlines()
        assert lines[-1] == line
        assert any("NiftiImageIO" in entry for entry in lines[:-1])


def test_the_process_has_its_error_stream_back_also_after_an_error(capfd: pytest.CaptureFixture[str]) -> None:
    def fail() -> None:
        os.write(2, b"of a library")
        raise ValueError("of the user")

    with pytest.raises(ValueError, match="of the user"), silenced_libraries():
        fail()
    os.write(2, b"afterwards")
    assert capfd.readouterr().err == "afterwards"
