"""What the mouse does in views, as the page sends it."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer.core")

from ViTTransferFunction.WebApp.app import WebApp

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]
NO_KEYS = [False, False, False]


@pytest.mark.parametrize(("button", "turns"), [("left", True), ("middle", False)])
def test_in_3d_the_left_button_turns_and_the_middle_one_shifts_until_it_is_released(
    opened: Callable[[Journey], None], button: str, turns: bool
) -> None:
    async def journey(app: WebApp) -> None:
        app.views.view_3d.render_window().SetSize(300, 200)
        camera = app.views.view_3d.get_camera_node().GetCamera()

        def pose() -> tuple[np.ndarray, np.ndarray]:
            return np.array(camera.GetDirectionOfProjection()), np.array(camera.GetFocalPoint())

        direction, middle = pose()
        start, end = [[0.5, 0.5], NO_KEYS], [[0.7, 0.5], NO_KEYS]
        app.views.use("ThreeD", [["hover", *start], ["press", *start, button], ["move", *end], ["release", *end, button]])
        turned, shifted = pose()
        assert np.allclose(direction, turned) != turns
        assert np.allclose(middle, shifted) == turns
        app.views.use("ThreeD", [["hover", *start]])
        np.testing.assert_allclose(pose(), (turned, shifted))

    opened(journey)
