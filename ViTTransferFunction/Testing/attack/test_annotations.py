"""Annotation files of any content that JSON can say; hypothesis looks for the smallest that is not refused in a sentence."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ViTTransferFunction.Testing.attack.annotation_attacks import write_scan
from ViTTransferFunction.Testing.attack.cases import Case, Place, Step
from ViTTransferFunction.Testing.attack.forked_calls import ForkedCalls
from ViTTransferFunction.Testing.attack.invariant import snapshot, violations

EXAMPLES = 60

anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)
coordinates = st.floats(-5.0, 5.0) | st.integers(0, 3) | st.floats()
points = st.lists(st.tuples(*[coordinates] * 3), max_size=4) | anything
edges = st.lists(st.floats(0.0, 100.0) | st.integers(1, 9), min_size=3, max_size=3)
boxes = st.fixed_dictionaries({"center": st.lists(coordinates, min_size=3, max_size=3), "size_mm": edges | anything})
classes = st.fixed_dictionaries(
    {"name": st.text(max_size=5) | anything, "positive": points},
    optional={
        "negative": points,
        "color": st.text(max_size=7) | st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3) | anything,
        "opacity": st.floats(0.0, 1.0) | anything,
        "iso": st.floats(0.0, 1.0) | anything,
        "size": st.sampled_from(["smaller", "larger"]) | st.floats(-3.0, 3.0) | anything,
        "proximity": st.floats(0.0, 1.0) | anything,
        "refine": st.booleans() | anything,
        "close_up": st.booleans() | boxes | anything,
    },
)
files = st.fixed_dictionaries(
    {
        "coordinate_system": st.sampled_from(["IJK", "RAS", "LPS"]) | anything,
        "classes": st.lists(classes, max_size=3) | anything,
    }
)


@pytest.fixture
def judge(forked: ForkedCalls) -> Iterator[Callable[[Any], list[str]]]:
    """Says what is wrong after a run with a file of this content."""
    with TemporaryDirectory(prefix="vittf-attack-") as folder:
        place = Place(Path(folder), forked.weights)
        scan = write_scan(random.Random(0), place)

        def judged(content: Any) -> list[str]:
            (place.work / "clicks.json").write_text(json.dumps(content))
            (place.work / "out.nii.gz").unlink(missing_ok=True)
            step = Step((place.segment("scan.nrrd"),))
            before = snapshot(place.work)
            return violations(Case("annotations", "", [step], scan), step, forked.run(step.calls), place, before)

        yield judged


@pytest.mark.slow
def test_an_annotation_file_of_any_form_is_followed_or_refused_in_a_sentence(judge: Callable[[Any], list[str]]) -> None:
    @settings(max_examples=EXAMPLES)
    @example({"coordinate_system": ["IJK"], "classes": [{"name": "a", "positive": [[1, 1, 1]]}]})
    @given(files | anything)
    def every(content: Any) -> None:
        assert judge(content) == []

    every()
