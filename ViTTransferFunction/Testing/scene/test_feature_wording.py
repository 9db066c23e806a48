"""What panel and page say of features."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from ViTTransferFunction.Logic.scene.feature_wording import MOST_POINT_WARNINGS, missing_text, point_warnings

ROUGH, WAITING, NOTHING = "coarse features, and rough", "once the features are computed", ""


@pytest.mark.parametrize(
    ("phase", "cached", "points", "iso", "told"),
    [
        ("no features", False, 1, None, WAITING),
        ("no features", False, 1, 0.5, ROUGH),
        ("no features", False, 0, None, NOTHING),
        ("no features", True, 1, None, NOTHING),
        ("no features", None, 1, None, NOTHING),
        ("extracting", False, 1, None, NOTHING),
        ("ready", False, 1, 0.5, NOTHING),
    ],
)
def test_who_clicks_without_features_is_told_what_is_missing(
    phase: str, cached: bool | None, points: int, iso: float | None, told: str
) -> None:
    """`cached` is None before the estimate is there; an iso value has been chosen where coarse features were there once."""
    session: Any = SimpleNamespace(
        phase=phase,
        estimate=None if cached is None else SimpleNamespace(cached=cached),
        classes=[SimpleNamespace(id="a", positive=[(0.0, 0.0, 0.0)] * points)],
        chosen_iso=lambda id_: iso,
    )
    text = missing_text(session)
    assert told in text
    assert bool(text) is bool(told)


@pytest.mark.parametrize(("beyond", "missing"), [(MOST_POINT_WARNINGS, 0), (3, MOST_POINT_WARNINGS), (40, 0)])
def test_warnings_of_many_structures_leave_room_for_the_table(beyond: int, missing: int) -> None:
    classes = [SimpleNamespace(id=str(n), name=f"structure {n}") for n in range(40)]
    session: Any = SimpleNamespace(
        classes=classes,
        points_beyond={each.id: 2 for each in classes[:beyond]},
        points_without_intensity={each.id: 1 for each in classes[:missing]},
    )
    lines = point_warnings(session)
    assert len(lines) == MOST_POINT_WARNINGS
    assert lines[0] == "⚠ structure 0: 2 points outside the volume do not count."
    left_out = beyond + missing - MOST_POINT_WARNINGS
    assert (lines[-1] == f"⚠ {left_out + 1} more warnings of this kind.") == (left_out > 0)


def test_the_number_of_points_stays_behind_a_name_from_the_right() -> None:
    classes = [SimpleNamespace(id="a", name="כבד 2"), SimpleNamespace(id="b", name="liver")]
    session: Any = SimpleNamespace(classes=classes, points_beyond={"a": 3, "b": 3}, points_without_intensity={})
    of_the_first, of_the_second = point_warnings(session)
    assert of_the_first == "⚠ \u2068כבד 2\u2069: 3 points outside the volume do not count."
    assert of_the_second == "⚠ liver: 3 points outside the volume do not count."
