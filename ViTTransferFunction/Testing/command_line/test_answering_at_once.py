"""`vittf` answers mistakes in its arguments, and Ctrl-C, before anything slow is loaded. In processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SLOW_TO_LOAD = {"numpy", "scipy", "torch", "SimpleITK", "vtkmodules", "tqdm"}

INTERRUPTED_WHEN_IT_IMPORTS = """
import sys

class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            raise KeyboardInterrupt

sys.modules.pop({module!r}, None)
sys.meta_path.insert(0, CtrlC())
from ViTTransferFunction.CommandLine.vittf import main
sys.exit(main({arguments!r}))
"""

LOADED_AFTER_A_MISTAKE = """
import sys
from ViTTransferFunction.CommandLine.vittf import main
try:
    main({arguments!r})
except SystemExit:
    print(*{{name.split(".")[0] for name in sys.modules}})
"""


def python(code: str, environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, encoding="utf-8", check=False
    )


@pytest.mark.parametrize(
    "arguments", [[], ["--help"], ["--version"], ["segment", "--help"], ["segment", "scan.nrrd"], ["weights", "forget"]]
)
def test_help_and_mistakes_in_the_arguments_are_answered_before_anything_slow_is_loaded(arguments: list[str]) -> None:
    answer = python(LOADED_AFTER_A_MISTAKE.format(arguments=arguments))
    loaded = set(answer.stdout.splitlines()[-1].split())
    assert "argparse" in loaded
    assert not loaded & SLOW_TO_LOAD


def test_how_libraries_wait_and_how_many_threads_they_take_is_set_before_they_load() -> None:
    variables = ("OMP_WAIT_POLICY", "OPENBLAS_NUM_THREADS")
    ours = f"import os; print(*map(os.environ.get, {variables}), file=sys.stderr)"
    environment = {name: value for name, value in os.environ.items() if name not in variables}
    for given, expected in (({}, "passive 1"), ({"OPENBLAS_NUM_THREADS": "3"}, "passive 3")):
        answer = python(f"{LOADED_AFTER_A_MISTAKE.format(arguments=['--help'])}{ours}", {**environment, **given})
        assert answer.stderr.split() == expected.split()
        assert "numpy" not in answer.stdout.splitlines()[-1].split()


@pytest.mark.parametrize("module", ["argparse", "numpy", "SimpleITK"])
def test_an_interrupt_while_libraries_load_ends_in_one_line(module: str, tmp_path: Path) -> None:
    scan = tmp_path / "scan.nrrd"
    scan.write_bytes(b"")
    arguments = ["segment", str(scan), "--annotations", "a.json", "-o", str(tmp_path / "o.seg.nrrd")]
    ended = python(INTERRUPTED_WHEN_IT_IMPORTS.format(module=module, arguments=arguments))
    assert ended.returncode == 130
    assert ended.stderr.splitlines() == ["interrupted; nothing was left half-written"]
