"""The module as the extension's package installs it: what its CMake file lists and no more, in a folder of another name."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

MODULE = Path(__file__).parents[2]
LISTS = ("MODULE_PYTHON_SCRIPTS", "MODULE_PYTHON_RESOURCES")
_INSTALLED = Path("lib/Slicer-5.10/qt-scripted-modules")
"""Of `slicerMacroBuildScriptedModule`, which copies each file to its own subfolder of this."""


def install(package: Path) -> Path:
    """Copy what is listed into a package, as installed by somebody else: its users may only read it.

    Args:
        package: a folder.

    Returns:
        The folder with the module's file.
    """
    installed = package / _INSTALLED
    for name in (name for variable in LISTS for name in cmake_list(MODULE / "CMakeLists.txt", variable)):
        to = installed / name
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(MODULE / name, to)
        to.chmod(0o444)
    for folder in (installed, *(path for path in installed.rglob("*") if path.is_dir())):
        folder.chmod(0o555)
    return installed


def remove(package: Path) -> None:
    """Remove a package, although it may only be read."""
    for path in (package, *package.rglob("*")):
        path.chmod(0o700)
    shutil.rmtree(package)


def content(folder: Path) -> dict[str, int]:
    """What lies in a folder, as it is now: the time of the last change of each file and folder, in nanoseconds."""
    return {path.relative_to(folder).as_posix(): path.stat().st_mtime_ns for path in folder.rglob("*")}


def cmake_list(path: Path, variable: str) -> list[str]:
    """The values that a CMake file sets a variable to."""
    match = re.search(rf"^set\({variable}\s+(.*?)\s*\)$", path.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert match, f"{path.name} does not set {variable}"
    return match[1].replace("${MODULE_NAME}", "ViTTransferFunction").split()
