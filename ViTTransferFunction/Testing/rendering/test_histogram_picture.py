"""Pictures of transfer functions, read back from their SVG."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.rendering.histogram_picture import HEIGHT, WIDTH, histogram_svg
from ViTTransferFunction.Logic.rendering.intensity_histogram import BINS, IntensityHistogram

SVG = "{http://www.w3.org/2000/svg}"
HISTOGRAM = IntensityHistogram(np.linspace(0.0, 100.0, BINS + 1), np.eye(BINS)[48], np.eye(BINS)[16])
RED = Appearance((1.0, 0.0, 0.0), style="as scanned", ramp=0.25, tone=0.5)


def drawn(window: tuple[float, float] = (20.0, 60.0), look: Appearance = RED) -> ElementTree.Element:
    return ElementTree.fromstring(histogram_svg(HISTOGRAM, window, look))


def places(element: ElementTree.Element) -> np.ndarray:
    return np.array([[float(number) for number in place.split(",")] for place in element.attrib["points"].split()])


def test_both_histograms_have_their_peaks_where_their_intensities_are() -> None:
    outside, inside = (places(polygon) for polygon in drawn().iter(f"{SVG}polygon"))
    for polygon, share in ((outside, 16.5 / BINS), (inside, 48.5 / BINS)):
        peak = polygon[polygon[:, 1].argmin()]
        assert peak[0] == pytest.approx(share * WIDTH, abs=0.1)
        assert peak[1] < 0.1 * HEIGHT


def test_the_line_rises_within_the_window_from_the_ramps_opacity_to_all() -> None:
    *_, line = (places(polyline) for polyline in drawn().iter(f"{SVG}polyline"))
    assert line[:, 0] == pytest.approx([0.0, 0.2 * WIDTH, 0.6 * WIDTH, WIDTH])
    heights = (line[:, 1] - line[:, 1].min()) / (line[:, 1].max() - line[:, 1].min())
    assert heights == pytest.approx([1.0, 1.0, 0.0, 0.0])
    *_, even = (places(polyline) for polyline in drawn(look=Appearance((1.0, 0.0, 0.0), ramp=1.0)).iter(f"{SVG}polyline"))
    assert np.ptp(even[:, 1]) == 0.0


def test_a_window_beyond_the_histogram_is_drawn_as_far_as_it_is_seen() -> None:
    *_, line = (places(polyline) for polyline in drawn((-50.0, 300.0)).iter(f"{SVG}polyline"))
    assert (np.diff(line[:, 0]) >= 0.0).all()


def test_the_strip_goes_from_the_darker_colour_to_the_structures_own() -> None:
    stops = [stop.attrib["stop-color"] for stop in drawn().iter(f"{SVG}stop")]
    assert stops == ["#800000", "#ff0000"]
