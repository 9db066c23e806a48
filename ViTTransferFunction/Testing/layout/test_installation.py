"""The module as users have it: in a folder of Slicer's, with what is listed for it and no more, which they may only read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

from ViTTransferFunction.Testing.support import installation
from ViTTransferFunction.Testing.support.known_features import cache_known_features
from ViTTransferFunction.Testing.support.programs import open_installed, run
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras

IMPORT_ALL = """
import importlib
root = standin.MODULE_FILE.parent
for path in sorted(root.rglob("*.py")):
    if path.parent != root:
        importlib.import_module(".".join(("ViTTransferFunction", *path.relative_to(root).with_suffix("").parts)))
ours = {name: module for name, module in sys.modules.items() if name.startswith("ViTTransferFunction.")}
tests = "ViTTransferFunction.Testing"
files = [Path(module.__file__) for name, module in ours.items() if not name.startswith(tests) and module.__file__]
assert len(files) == len(list(root.rglob("*.py"))) - 1
assert all(root in path.parents for path in files)
host.close()
"""
SEGMENT = """
import numpy as np
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.rendering.shader import shader_pieces
from ViTTransferFunction.Testing.support.known_features import GRID
from ViTTransferFunction.Testing.support.scenes import add_volume, segment_masks
from ViTTransferFunction.Testing.support.widgets import add_class, place, wait_until
array, matrix, point = (np.load(f"{name}.npy") for name in ("array", "ijk_to_ras", "point"))
session.parameters.set("grid", GRID)
volume = add_volume(slicer.mrmlScene, Volume(array, Geometry(array.shape, matrix), "spheres"))
ui.volumeSelector.setCurrentNode(volume)
wait_until(lambda: session.phase == "ready")
add_class(widget, "sphere")
place(widget, tuple(point))
session.wait()
ui.writeSegmentsButton.click()
session.wait()
error = session.take_error()
assert error is None, error
(segmentation,) = slicer.util.getNodesByClass("vtkMRMLSegmentationNode")
(mask,) = segment_masks(segmentation, volume).values()
print(int(mask.sum()))
assert "vittf" in shader_pieces(1)["//VTK::ComputeRayDirection::Dec"]
host.close()
"""


@pytest.fixture
def installed(tmp_path: Path) -> Iterator[Path]:
    """The folder of the installed module's file."""
    yield installation.install(tmp_path / "package")
    installation.remove(tmp_path / "package")


@pytest.mark.slow
def test_every_installed_file_finds_all_that_it_imports(installed: Path, tmp_path: Path) -> None:
    run(open_installed(installed) + IMPORT_ALL, tmp_path)


@pytest.mark.slow
def test_an_installed_module_segments_and_leaves_its_folder_as_it_was(
    installed: Path, tmp_path: Path, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    volume, labels = spheres
    monkeypatch.setenv("VITTF_CACHE", str(tmp_path))
    cache_known_features(*spheres)
    for name, array in (
        ("array", volume.array),
        ("ijk_to_ras", volume.geometry.ijk_to_ras),
        ("point", centre_ras(spheres, 1)[0]),
    ):
        np.save(tmp_path / name, array)
    before = installation.content(installed)
    # Byte code is Python's, and goes where it may.
    printed = run(open_installed(installed) + SEGMENT, tmp_path, PYTHONDONTWRITEBYTECODE="1")
    assert int(printed.splitlines()[-1]) == pytest.approx((labels == 1).sum(), rel=0.1)
    assert installation.content(installed) == before
