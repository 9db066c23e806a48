"""Fixtures that several test files share: small volumes with known answers, a small network, and real data where it is."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import hypothesis
import numpy as np
import pytest

from ViTTransferFunction.Logic.compute import process
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Testing.support.loaded_python import LoadedPython
from ViTTransferFunction.Testing.support.real_volumes import REAL_VOLUMES
from ViTTransferFunction.Testing.support.slicer_release import let_slicer_go
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict

# The same examples on every run, and no judgement by the clock of a busy machine.
hypothesis.settings.register_profile("repeatable", deadline=None, derandomize=True)
hypothesis.settings.load_profile("repeatable")

# A shell has the programs that it starts in the background ignore Ctrl-C, and so their children; here it is tested.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

DATA_IS_REQUIRED = os.environ.get("VITTF_REQUIRE_DATA") == "1"
VOLUMES = os.environ.get("VITTF_TEST_VOLUMES")
WEIGHTS = os.environ.get("VITTF_WEIGHTS")


SLOW_FIXTURES = {"real_weights", "real_volume", "rebuilt"}
"""Real data: read from files, or rebuilt out of the package index."""


# First, so that `-m "not slow"` knows of it.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark tests on real data as slow."""
    for item in items:
        if isinstance(item, pytest.Function) and SLOW_FIXTURES & set(item.fixturenames):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(autouse=True)
def a_cache_of_its_own(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No test reads or fills the real user's cache."""
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("VITTF_CACHE", str(folder))
    return folder


@pytest.fixture(autouse=True)
def no_weights_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests ask for real weights by the fixture `real_weights`, never by accident."""
    monkeypatch.delenv("VITTF_WEIGHTS", raising=False)


@pytest.fixture
def real_weights() -> Path:
    """The file of dinov2_vits14_focus."""
    path = Path(WEIGHTS or "") / "dinov2_vits14_focus.pt"
    if WEIGHTS and Path(WEIGHTS).is_file():
        path = Path(WEIGHTS)
    if not WEIGHTS or not path.exists():
        _missing("VITTF_WEIGHTS does not name a folder with dinov2_vits14_focus.pt, nor that file")
    return path


@pytest.fixture
def real_volume() -> Callable[[str], Path]:
    """The path of a real volume, by its file name, one of `REAL_VOLUMES`."""

    def path_of(name: str) -> Path:
        assert name in REAL_VOLUMES
        path = Path(VOLUMES or "") / name
        if not VOLUMES or not path.exists():
            _missing(f"VITTF_TEST_VOLUMES does not name a folder with {name}")
        return path

    return path_of


def _missing(reason: str) -> None:
    if DATA_IS_REQUIRED:
        pytest.fail(reason)
    pytest.skip(reason)


@pytest.fixture(scope="session")
def loaded_python() -> Iterator[LoadedPython]:
    """The Python that compute processes are forked from."""
    with LoadedPython() as python:
        yield python


@pytest.fixture(scope="module")
def quick_compute_processes(request: pytest.FixtureRequest) -> Iterator[None]:
    """Compute processes are forked. Those of the tests in `compute`, and of programs that tests start, start like users'."""
    if sys.platform != "linux":
        yield
        return
    python = request.getfixturevalue("loaded_python")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(process, "subprocess", SimpleNamespace(**{**vars(subprocess), "Popen": python.popen}))
        yield


@pytest.fixture
def slicer_app(quick_compute_processes: None) -> Iterator[Any]:
    """Slicer's scene and module logics as its application has them, without its windows."""
    app = pytest.importorskip("trame_slicer.core").SlicerApp()
    # Tests that are killed would leave it.
    app.io_manager.cache_dir.cleanup()
    yield app
    # Slicer makes it again where it packs a scene.
    app.io_manager.cache_dir.cleanup()
    views = app.view_manager.get_views()
    for view in views:
        view.finalize()
    let_slicer_go(app)
    if views:
        # Python does not know how large they are. Those of this test are still held, and go with the next one's.
        gc.collect()


@pytest.fixture
def tiny_network() -> VisionTransformer:
    """A two-block network with fixed random weights."""
    return VisionTransformer(TINY_MODEL, random_state_dict(TINY_MODEL), "tiny")


@pytest.fixture
def spheres() -> tuple[Volume, np.ndarray]:
    """Two equal bright spheres and a darker one in noise, and their labels 1, 2 and 3; 48×40×32 voxels of 2×2×3 mm."""
    shape, spacing = (32, 40, 48), np.array([3.0, 2.0, 2.0])
    kji = np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), axis=-1) * spacing
    labels = np.zeros(shape, dtype=np.uint8)
    for label, centre in enumerate(([48.0, 40.0, 24.0], [48.0, 40.0, 72.0], [24.0, 20.0, 48.0]), start=1):
        labels[np.linalg.norm(kji - centre, axis=-1) < 16.0] = label
    means = np.array([0.0, 200.0, 200.0, 100.0])
    array = means[labels] + np.random.default_rng(0).normal(0.0, 5.0, shape)
    ijk_to_ras = np.diag([*spacing[::-1], 1.0])
    ijk_to_ras[:3, 3] = [-40.0, 10.0, 5.0]
    return Volume(array.astype(np.float32), Geometry(shape, ijk_to_ras), "spheres"), labels
