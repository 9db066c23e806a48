"""The bar in slice views that tells how long something is."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("trame_slicer")

from ViTTransferFunction.Testing.support.web_app import AppPage, serving
from ViTTransferFunction.WebApp.app import WebApp
from ViTTransferFunction.WebApp.scale_bar import LARGEST_SHARE, scale_bar

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]
UNITS_MM = {"cm": 10.0, "mm": 1.0, "µm": 0.001}


@pytest.mark.parametrize(
    ("view_mm", "text"),
    [
        (500.0, "10 cm"),
        (399.0, "5 cm"),
        (80.0, "2 cm"),
        (39.9, "5 mm"),
        (40.0, "1 cm"),
        (4.0, "1 mm"),
        (3.9, "500 µm"),
        (0.08, "20 µm"),
    ],
)
def test_lengths_are_told_as_people_say_them(view_mm: float, text: str) -> None:
    assert scale_bar(view_mm)["text"] == text


@given(st.floats(1e-3, 1e6))
def test_the_bar_is_as_long_as_it_says_and_neither_tiny_nor_in_the_way(view_mm: float) -> None:
    bar = scale_bar(view_mm)
    number, unit = bar["text"].split()
    assert float(number) * UNITS_MM[unit] == pytest.approx(bar["share"] * view_mm, rel=1e-5)
    assert LARGEST_SHARE / 2.5 * 0.999 < bar["share"] <= LARGEST_SHARE * 1.001


@pytest.mark.parametrize("view_mm", [0.0, -1.0, float("nan"), float("inf")])
def test_a_view_on_nothing_has_no_bar(view_mm: float) -> None:
    assert scale_bar(view_mm) == {"share": 0.0, "text": ""}


def test_the_bar_of_a_view_follows_its_zoom_and_its_size(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        view, state = app.views.slices[0], app.server.state
        node = view.get_view_node()

        def pixels_per_mm() -> float:
            number, unit = state.scale_Red["text"].split()
            return state.scale_Red["share"] * view.render_window().GetSize()[0] / (float(number) * UNITS_MM[unit])

        for size in ((300, 300), (600, 300)):
            view.render_window().SetSize(*size)
            view.reset_view()
            for zoom in (1.0, 3.0, 40.0):
                width, height, depth = node.GetFieldOfView()
                node.SetFieldOfView(width / zoom, height / zoom, depth)
                origin, end = (node.GetXYToRAS().MultiplyPoint((x, 0.0, 0.0, 1.0)) for x in (0.0, 100.0))
                in_patient_mm = sum((a - b) ** 2 for a, b in zip(origin[:3], end[:3], strict=True)) ** 0.5
                assert pixels_per_mm() == pytest.approx(100.0 / in_patient_mm, rel=1e-3)

    opened(journey)


@pytest.mark.slow
def test_slices_of_a_small_specimen_are_told_apart(new_page: Callable[[], AppPage], tmp_path: Path) -> None:
    image = sitk.GetImageFromArray(np.random.default_rng(0).normal(0.0, 8.0, (20, 22, 24)))
    image.SetSpacing([0.005] * 3)
    sitk.WriteImage(image, str(tmp_path / "wasp.nrrd"))
    with serving(tmp_path / "wasp.nrrd", "--device", "cpu", cache=tmp_path) as server:
        page = new_page()
        page.page.goto(server.address)
        page.wait_for_state("volume_name === 'wasp' && opening === ''")
        for mm in ("0.050", "0.055"):
            page["slice-Red"].fill(mm)
            page.page.wait_for_function("mm => document.querySelector('.offset').textContent.trim() === `S ${mm} mm`", arg=mm)
