"""The arithmetic of more workers."""

from __future__ import annotations

import pytest

from Benchmarks.cohort.efficiency import Scaling, start_seconds


def test_workers_that_start_at_once_and_need_no_leader_lose_nothing() -> None:
    assert Scaling(0.0, 10.0, 0.0).efficiency(128, 64) == pytest.approx(1.0)


def test_a_last_case_that_is_alone_leaves_the_others_idle() -> None:
    scaling = Scaling(0.0, 10.0, 0.0)
    assert scaling.seconds(65, 64) == pytest.approx(20.0)
    assert scaling.efficiency(65, 64) == pytest.approx(65 / 128)


def test_a_slow_leader_is_the_limit() -> None:
    scaling = Scaling(5.0, 1.0, 0.1)
    assert scaling.most_workers == pytest.approx(10.0)
    assert scaling.seconds(1000, 64) == pytest.approx(105.0)
    assert scaling.cases_per_hour(1000, 64) == pytest.approx(3600 * 1000 / 105)


def test_what_a_cohort_took_to_start_is_what_its_cases_do_not_explain() -> None:
    assert start_seconds(25.0, 10.0, 3, 2) == pytest.approx(5.0)
    assert start_seconds(19.0, 10.0, 3, 2) == 0.0
