"""The rooms of the Logic, and the walls between them. `docs/ARCHITECTURE.md` draws what is written here."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from ViTTransferFunction.Testing.support.imports import SHIPPED_WITH_SLICER, imports_anywhere, imports_at_file_scope
from ViTTransferFunction.Testing.support.rooms import ARROWS, FRONT_ENDS, KNOWS_MRML, drawing

MODULE = Path(__file__).parents[2]
ROOT = MODULE.parent
LOGIC = MODULE / "Logic"
FILES = sorted(LOGIC.rglob("*.py"))
PACKAGE = "ViTTransferFunction"


def room_of(path: Path) -> str:
    return path.parent.relative_to(LOGIC).as_posix()


def room_named_by(parts: list[str]) -> str:
    """The room that a module of the Logic lies in, by its dotted name behind `Logic`."""
    return next(room for room in ("/".join(parts[:2]), parts[0]) if room in ARROWS)


def dotted(path: Path) -> tuple[str, ...]:
    return path.relative_to(ROOT).with_suffix("").parts


def imported(path: Path) -> Iterator[str]:
    return imports_anywhere(path, dotted(path)[:-1])


def test_every_file_of_the_logic_lies_in_a_room() -> None:
    assert {room_of(path) for path in FILES} == set(ARROWS)


def test_the_arrows_have_no_cycle() -> None:
    order = list(TopologicalSorter({room: set(allowed) for room, allowed in ARROWS.items()}).static_order())
    assert order.index("core/system") < order.index("core/volumes") < order.index("scene")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(LOGIC).as_posix())
def test_a_file_imports_from_no_room_but_those_that_its_own_may_enter(path: Path) -> None:
    room = room_of(path)
    for module in imported(path):
        package, *rest = module.split(".")
        if package == PACKAGE:
            assert rest[0] == "Logic", f"{module} is no part of the Logic"
            assert room_named_by(rest[1:]) in (room, *ARROWS[room]), f"{room} may not import {module}"


@pytest.mark.parametrize("front_end", FRONT_ENDS)
def test_a_front_end_imports_from_no_room_but_its_own(front_end: str) -> None:
    for path in sorted((MODULE / front_end).rglob("*.py")):
        for module in imported(path):
            package, *rest = module.split(".")
            if package != PACKAGE or rest[0] == front_end:
                continue
            if rest[0] == "Logic":
                assert room_named_by(rest[1:]) in FRONT_ENDS[front_end], f"{path.name} imports {module}"
            else:
                assert (front_end, rest[0]) == ("CommandLine", "WebApp"), f"{path.name} imports {module}"


def test_the_app_in_the_browser_computes_nothing_itself() -> None:
    for path in (MODULE / "WebApp").rglob("*.py"):
        assert not {"torch", "scipy", "SimpleITK"} & {module.partition(".")[0] for module in imported(path)}, path.name


@pytest.mark.parametrize("room", sorted(ARROWS))
def test_every_arrow_is_used(room: str) -> None:
    entered = {
        room_named_by(module.split(".")[2:])
        for path in FILES
        if room_of(path) == room
        for module in imported(path)
        if "Logic" in module
    }
    assert entered - {room} == set(ARROWS[room])


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(LOGIC).as_posix())
def test_numerics_know_no_scene_and_the_scene_knows_no_torch(path: Path) -> None:
    strangers = {"qt", "ctk", "PySide6", "PythonQt"}
    strangers |= {"torch"} if room_of(path) in KNOWS_MRML else {"vtk", "vtkmodules", "slicer", "trame_slicer"}
    assert not strangers & {module.partition(".")[0] for module in imported(path)}


def test_one_file_alone_makes_tensors_of_arrays_and_arrays_of_tensors() -> None:
    """PyTorch's own way is closed where it was built for another NumPy (`core/volumes/torch_arrays.py`)."""
    files = [*FILES, *(MODULE / "CommandLine").rglob("*.py")]
    assert [path.name for path in files if {"from_numpy", "numpy"} & _attributes(path)] == ["torch_arrays.py"]


def _attributes(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}


def test_no_file_imports_itself_by_way_of_others() -> None:
    names = {".".join(dotted(path)) for path in FILES}
    graph = {".".join(dotted(path)): {module for module in imported(path) if module in names} for path in FILES}
    assert len(list(TopologicalSorter(graph).static_order())) == len(names)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(LOGIC).as_posix())
def test_a_file_loads_on_a_bare_slicer(path: Path) -> None:
    for name in imports_at_file_scope(path):
        assert name in SHIPPED_WITH_SLICER or name in sys.stdlib_module_names, f"{path.name} imports {name}"


@pytest.mark.slow
def test_the_logic_loads_where_pytorch_is_missing() -> None:
    modules = [".".join(dotted(path)) for path in FILES]
    program = f"import sys; sys.modules['torch'] = None\nimport importlib\nfor name in {modules}: importlib.import_module(name)"
    finished = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    assert finished.returncode == 0, finished.stderr


def test_no_folder_is_a_package_that_hides_others_of_its_name() -> None:
    """Another extension's folder `Logic` must stay importable beside ours."""
    assert not [path for path in MODULE.rglob("__init__.py") if "standin" not in path.parts]


def test_the_documentation_draws_these_rooms() -> None:
    assert drawing() in (ROOT / "docs" / "ARCHITECTURE.md").read_text(encoding="utf-8"), (
        "docs/ARCHITECTURE.md shows other rooms; paste what `python dev.py rooms` prints"
    )
