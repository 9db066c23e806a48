"""What several tests of the benchmarks are given."""

from __future__ import annotations

import pytest

from Benchmarks.shared.labelled_cases import LabelledVolume
from ViTTransferFunction.Testing.support.spheres import Spheres


@pytest.fixture
def labelled(spheres: Spheres) -> LabelledVolume:
    """The three spheres as a benchmark's case."""
    return LabelledVolume(*spheres, ("left", "right", "dark"))
