"""Programs that open the panel in a Python of their own, where modules can be hidden, and loaded anew."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

MODULE = Path(__file__).parents[2]

OPEN = """
import sys
import slicer
from trame_slicer.core import SlicerApp
from ViTTransferFunction.Testing.support.standin.host import Host
app = SlicerApp()
host = Host(app)
widget = host.open_panel()
ui, session = widget.ui, widget.panel.session
"""


def open_installed(installed: Path) -> str:
    """`OPEN`, but of a module that was installed: nothing but the tests comes from the folder that they lie in.

    Args:
        installed: the folder with the module's file.
    """
    return f"""
import sys
from pathlib import Path
from types import ModuleType
for name, folder in (("ViTTransferFunction", {str(installed)!r}), ("ViTTransferFunction.Testing", {str(MODULE / "Testing")!r})):
    package = sys.modules[name] = ModuleType(name)
    package.__path__ = [folder]
from ViTTransferFunction.Testing.support.standin import host as standin
standin.MODULE_FILE = Path({str(installed)!r}) / "ViTTransferFunction.py"
{OPEN}"""


def run(program: str, folder: Path, **environment: str) -> str:
    """Run a program in `folder`, with its cache there; it must not fail. Returns what it printed."""
    finished = subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env={**os.environ, "VITTF_CACHE": str(folder), "PYTHONPATH": str(MODULE.parent), **environment},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout
