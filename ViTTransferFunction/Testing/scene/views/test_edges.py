"""The inside of a structure, seen evenly or only where the image changes, in the pixels of a 3D view."""

from __future__ import annotations

from typing import Any

import numpy as np

from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Testing.scene.views.test_rendering import GRID, RED, SHAPE, Stage
from ViTTransferFunction.Testing.support.views import ball


def test_edges_leave_nothing_of_what_is_even_and_a_shell_where_the_image_changes(slicer_app: Any) -> None:
    stage = Stage(slicer_app)
    intensities = np.where(np.arange(SHAPE[2]) < 12, 120.0, 200.0) * np.ones((*SHAPE[:2], 1))
    even, edges = (Appearance(RED, style="as scanned", low=0.0, high=200.0, edges=share) for share in (0.0, 1.0))
    shown = stage.show_structures([ball(SHAPE, (7.5, 9.5, 11.5), 8.0)], [even], intensities=intensities)
    places = [GRID.ijk_to_ras_points(np.array([[i, 9.5, 7.5]]))[0] for i in (8.0, 11.5, 15.0)]
    evenly, at_edges = stage.picture(), stage.change(shown, [edges])
    all_seen, edges_seen = ([float(stage.mean(seen, place)[0]) for place in places] for seen in (evenly, at_edges))
    assert min(all_seen) > 40.0
    left, middle, right = edges_seen
    assert max(left, right) < 10.0
    assert middle > 30.0
