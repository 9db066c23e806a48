"""What ships is all there, and is what the index of Slicer extensions asks for."""

from __future__ import annotations

import json
import os
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from ViTTransferFunction.Testing.support.installation import cmake_list

MODULE = Path(__file__).parents[2]
ROOT = MODULE.parent
EXTENSION = "ViTTransferFunction"
STAYS_BEHIND = {"CommandLine", "Testing", "WebApp"}
SELF_TEST = MODULE / "Testing" / "run_in_slicer.py"
SHARE = "share/Slicer-5.10/qt-scripted-modules"
LARGEST_CLONE_MB = 100
"""That the index takes, with all history; its `check_repository_size`."""


def cmake_string(variable: str) -> str:
    """The text that the extension's CMake file sets a variable to, as the index's own check finds it."""
    match = re.search(rf'set\s*\({variable}\s*"([^"]+)"\)', (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"))
    assert match, f"CMakeLists.txt does not set {variable}"
    return match[1]


def shipped(pattern: str) -> list[str]:
    paths = (path.relative_to(MODULE) for path in MODULE.rglob(pattern) if path.is_file() and not path.name.endswith(".pyc"))
    return sorted(path.as_posix() for path in paths if path.parts[0] not in STAYS_BEHIND)


def catalogue_entry() -> dict:
    return json.loads((ROOT / f"{EXTENSION}.json").read_text(encoding="utf-8"))


def test_every_python_file_is_listed_once_and_in_order() -> None:
    module, *rest = cmake_list(MODULE / "CMakeLists.txt", "MODULE_PYTHON_SCRIPTS")
    assert module == f"{EXTENSION}.py"
    assert rest == [path for path in shipped("*.py") if path != module]


def test_every_resource_is_listed_once_and_in_order() -> None:
    listed = cmake_list(MODULE / "CMakeLists.txt", "MODULE_PYTHON_RESOURCES")
    assert listed == [path for path in shipped("*") if path.startswith("Resources/")]


def test_what_ships_imports_nothing_that_stays_behind() -> None:
    for name in shipped("*.py"):
        text = (MODULE / name).read_text(encoding="utf-8")
        assert not re.search(rf"^\s*(from|import) [\w.]*\b({'|'.join(STAYS_BEHIND)})\b", text, re.MULTILINE), name


def test_cmake_hands_slicer_every_file(tmp_path: Path) -> None:
    """Configures the extension with CMake, against a stand-in for Slicer's build files that writes down what it is given."""
    if not shutil.which("cmake") or not (shutil.which("cc") or shutil.which("cl")):
        pytest.skip("CMake or a compiler is missing")
    slicer = tmp_path / "slicer"
    slicer.mkdir()
    (slicer / "SlicerConfig.cmake").write_text(
        'set(Slicer_USE_FILE "${CMAKE_CURRENT_LIST_DIR}/use.cmake")\n'
        'set(Slicer_EXTENSION_GENERATE_CONFIG "${CMAKE_CURRENT_LIST_DIR}/nothing.cmake")\n'
        'set(Slicer_EXTENSION_CPACK "${CMAKE_CURRENT_LIST_DIR}/nothing.cmake")\n'
    )
    (slicer / "nothing.cmake").write_text("")
    (slicer / "use.cmake").write_text(
        f"set(BUILD_TESTING ON)\nset(Slicer_INSTALL_QTSCRIPTEDMODULES_SHARE_DIR {SHARE})\n"
        'macro(slicerMacroBuildScriptedModule)\n  file(WRITE "${CMAKE_BINARY_DIR}/module.txt" "${ARGN}")\nendmacro()\n'
        'macro(slicer_add_python_unittest)\n  file(WRITE "${CMAKE_BINARY_DIR}/test.txt" "${ARGN}")\nendmacro()\n'
    )
    build = tmp_path / "build"
    command = ["cmake", "-S", str(ROOT), "-B", str(build), f"-DSlicer_DIR={slicer}"]
    configured = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    assert configured.returncode == 0, configured.stderr
    given = (build / "module.txt").read_text().split(";")
    assert given[:2] == ["NAME", EXTENSION]
    assert sorted(given[given.index("SCRIPTS") + 1 : given.index("RESOURCES")]) == shipped("*.py")
    assert (build / "test.txt").read_text().split(";") == ["SCRIPT", f"{EXTENSION}.py"]
    package = tmp_path / "package"
    subprocess.run(["cmake", "--install", str(build), "--prefix", str(package)], capture_output=True, check=True)
    assert (package / SHARE / EXTENSION / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()


def test_the_catalogue_entry_has_the_fields_of_its_schema() -> None:
    """Of slicer-extension-catalog-entry-schema, version 1.0.1: these required, these allowed, no others."""
    entry = catalogue_entry()
    required = {"$schema", "category", "scm_url"}
    allowed = required | {"scm_revision", "scm_type", "build_dependencies", "build_subdirectory", "enabled", "tier"}
    assert required <= entry.keys() <= allowed
    assert entry["$schema"].endswith("/slicer-extension-catalog-entry-schema-v1.0.1.json#")
    assert entry["tier"] in range(1, 6)


def test_the_catalogue_entry_agrees_with_the_build() -> None:
    entry = catalogue_entry()
    assert entry["category"] == cmake_string("EXTENSION_CATEGORY") == "Segmentation"
    assert entry["build_dependencies"] == cmake_string("EXTENSION_DEPENDS").split() == ["PyTorch"]
    assert entry["scm_url"].removesuffix(".git") == cmake_string("EXTENSION_HOMEPAGE")


def test_names_are_those_that_the_index_accepts() -> None:
    """The repository's name starts with Slicer, the extension's does not, and it is the project's."""
    assert re.search(r"^project\((\w+)\)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"), re.MULTILINE)[1] == EXTENSION  # type: ignore[index]
    assert "slicer" not in EXTENSION.lower()
    assert catalogue_entry()["scm_url"].rpartition("/")[2] == f"Slicer{EXTENSION}.git"


def test_pictures_in_the_catalogue_are_in_the_repository() -> None:
    repository = cmake_string("EXTENSION_HOMEPAGE").removeprefix("https://github.com/")
    base = f"https://raw.githubusercontent.com/{repository}/{catalogue_entry()['scm_revision']}/"
    urls = [cmake_string("EXTENSION_ICONURL"), *cmake_string("EXTENSION_SCREENSHOTURLS").split()]
    assert len(urls) >= 2
    for url in urls:
        assert url.startswith(base)
        assert (ROOT / url.removeprefix(base)).is_file(), url


def test_the_description_is_short_and_has_no_characters_that_cmake_lists_break_at() -> None:
    description = cmake_string("EXTENSION_DESCRIPTION")
    assert ";" not in description
    assert 1 <= len(re.findall(r"\.(?: |$)", description)) <= 2


def test_keywords_are_single_words_each_given_once() -> None:
    keywords = cmake_string("EXTENSION_KEYWORDS")
    assert re.fullmatch(r"[\w-]+( [\w-]+)*", keywords)
    words = keywords.lower().split()
    assert sorted(set(words)) == sorted(words)


def test_a_clone_is_not_too_large_for_the_index() -> None:
    """Most of it are pictures that were drawn anew: every version stays for ever.

    The history is packed as for a clone: how this checkout keeps it, in many small packs or single files, may take much more.
    """
    if not shutil.which("git") or not (ROOT / ".git").exists():
        pytest.skip("no clone")
    history = size_of_pack()
    files = sum((ROOT / name).stat().st_size for name in git("ls-files") if (ROOT / name).exists())
    assert (history + files) / 2**20 < LARGEST_CLONE_MB


def size_of_pack() -> int:
    """What a clone of this commit and its history transfers, in bytes."""
    command = ["git", "pack-objects", "--revs", "--stdout", "-q"]
    return len(subprocess.run(command, cwd=ROOT, input=b"HEAD\n", capture_output=True, check=True).stdout)


def git(*arguments: str) -> list[str]:
    command = ["git", "-c", "core.quotePath=off", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, encoding="utf-8", check=True).stdout.splitlines()


def test_the_licence_is_at_the_root() -> None:
    assert "Apache License" in (ROOT / "LICENSE").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", [ROOT / f"{EXTENSION}.png", MODULE / "Resources" / "Icons" / f"{EXTENSION}.png"])
def test_the_icon_is_a_png_of_128_pixels_with_transparency(path: Path) -> None:
    header = path.read_bytes()[:26]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    width, height, bits, kind = struct.unpack(">IIBB", header[16:26])
    assert (width, height, bits) == (128, 128, 8)
    assert kind in (4, 6), "no alpha channel"


# As Slicer does: the folder goes to the end of sys.path, and the file is loaded under the module's name. Of Slicer and Qt,
# whatever is not installed is a module whose every name is a class.
LOADER = """
import importlib.abc, importlib.machinery, importlib.util, sys, types

class Anything:
    def __init__(self, *args, **kwargs): pass
    def __call__(self, *args, **kwargs): return Anything()
    def __getattr__(self, name): return Anything()

class StandIn(types.ModuleType):
    __path__ = []
    __all__ = ["ScriptedLoadableModule" + part for part in ("", "Widget", "Logic", "Test")]
    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (Anything,), {})

class StandIns(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def find_spec(self, name, path, target=None):
        known = name.partition(".")[0] in ("slicer", "qt", "ctk", "PythonQt", "PyTorchUtils")
        return importlib.machinery.ModuleSpec(name, self, is_package=True) if known else None
    def create_module(self, spec): return StandIn(spec.name)
    def exec_module(self, module): pass

sys.meta_path.append(StandIns())

def load(folder, name):
    sys.path.append(folder)
    spec = importlib.util.spec_from_file_location(name, f"{folder}/{name}.py")
    sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules[name])
"""


@pytest.mark.slow
@pytest.mark.parametrize("ours_first", [True, False], ids=["ours first", "theirs first"])
@pytest.mark.parametrize("their_logic_is_a_package", [True, False], ids=["with __init__", "without __init__"])
def test_another_extension_with_a_logic_folder_works_beside_ours(
    tmp_path: Path, ours_first: bool, their_logic_is_a_package: bool
) -> None:
    other = tmp_path / "Other"
    (other / "Logic").mkdir(parents=True)
    (other / "Logic" / "foo.py").write_text("NAME = 'theirs'\n")
    # Named as one of ours, to see who gets whose.
    (other / "Logic" / "geometry.py").write_text("NAME = 'theirs'\n")
    (other / "Other.py").write_text("from Logic.foo import NAME\n")
    if their_logic_is_a_package:
        (other / "Logic" / "__init__.py").write_text("")
    loads = [f"load({str(MODULE)!r}, {EXTENSION!r})", f"load({str(other)!r}, 'Other')"]
    program = "\n".join(
        [
            LOADER,
            *(loads if ours_first else reversed(loads)),
            "import Logic.foo",
            f"from {EXTENSION}.Logic.core.volumes.geometry import Geometry",
            "assert Logic.foo.NAME == 'theirs'",
            f"assert Geometry.__module__ == '{EXTENSION}.Logic.core.volumes.geometry'",
        ]
    )
    run = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, encoding="utf-8", check=False)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize(
    ("body", "verdict"),
    [
        ("def test_a(self): pass", "PASSED"),
        ("def runTest(self): pass", "PASSED"),
        ("def test_a(self): self.fail()", "FAILED"),
        ("def setUp(self): raise OSError\n    def test_a(self): pass", "FAILED"),
        ("def test_a(self): self.skipTest('no network')", "SKIPPED: no network"),
        ("def test_a(self): pass\n    def test_b(self): self.skipTest('no network')", "SKIPPED: no network"),
        ("pass\nraise ImportError", "FAILED"),
    ],
    ids=["passes", "passes by runTest", "fails", "cannot be set up", "is skipped", "is skipped in part", "cannot be imported"],
)
def test_the_self_test_says_how_it_went(tmp_path: Path, body: str, verdict: str) -> None:
    (tmp_path / f"{EXTENSION}.py").write_text(f"import unittest\nclass {EXTENSION}Test(unittest.TestCase):\n    {body}\n")
    log = tmp_path / "log.txt"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "VITTF_SELF_TEST_LOG": str(log)}
    subprocess.run([sys.executable, str(SELF_TEST)], cwd=tmp_path, env=environment, check=False)
    assert log.read_text(encoding="utf-8").splitlines()[-1] == f"VITTF SELF-TEST {verdict}"
