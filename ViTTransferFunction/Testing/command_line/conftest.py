"""The grids that pictures are drawn of."""

from __future__ import annotations

import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Testing.support.pictures import GEOMETRIES


@pytest.fixture(params=GEOMETRIES)
def geometry(request: pytest.FixtureRequest) -> Geometry:
    """A grid, in each of several orientations."""
    return GEOMETRIES[request.param]()


@pytest.fixture
def aligned() -> Geometry:
    """A grid along the patient's axes."""
    return GEOMETRIES["RAS"]()
