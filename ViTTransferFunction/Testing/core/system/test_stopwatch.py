"""The memory that a run took."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.stopwatch import peak_memory_bytes

HELD_MB = 300
IN_A_PROGRAM = """
from ViTTransferFunction.Logic.core.system.stopwatch import peak_memory_bytes
print(peak_memory_bytes())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell")
def test_the_peak_is_that_of_the_program_itself_and_not_of_the_one_that_started_it() -> None:
    held = np.ones(HELD_MB * 1_000_000, dtype=np.uint8)
    program = [sys.executable, "-c", IN_A_PROGRAM]
    printed = subprocess.run(
        program, cwd=Path(__file__).parents[4], stdout=subprocess.PIPE, encoding="utf-8", check=True
    ).stdout
    own = peak_memory_bytes()
    assert own is not None
    assert own > held.nbytes
    assert int(printed) < held.nbytes / 2
