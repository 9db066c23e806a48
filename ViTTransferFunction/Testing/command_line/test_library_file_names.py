"""Libraries are handed names of files in UTF-8, and take them for that, on Windows as well."""

from __future__ import annotations

import locale
import sys
from pathlib import Path

import pytest

from ViTTransferFunction.CommandLine.cohort.case_work import segment_case
from ViTTransferFunction.CommandLine.cohort.cases import Case
from ViTTransferFunction.CommandLine.cohort.job import CaseJob, CohortSettings
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.session.settings import SessionSettings


@pytest.fixture
def taken(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, str | None]]:
    """What the C library is told."""
    told: list[tuple[int, str | None]] = []
    monkeypatch.setattr(locale, "setlocale", lambda category, name=None: told.append((category, name)))
    return told


@pytest.mark.parametrize("platform", ["win32", "linux", "darwin"])
def test_windows_is_told_so_by_the_command_line_and_by_each_worker_of_a_cohort(
    platform: str, tmp_path: Path, taken: list[tuple[int, str | None]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", platform)
    expected = [(locale.LC_CTYPE, ".utf8")] if platform == "win32" else []
    assert main(["cache", "info"]) == 0
    assert taken == expected
    case = Case("a", tmp_path / "none.nii", tmp_path / "none.json")
    assert segment_case(CaseJob(case, CohortSettings(SessionSettings(), ""), tmp_path)).status == "refused"
    assert taken == 2 * expected


def test_a_windows_that_knows_no_such_names_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*_: object) -> str:
        raise locale.Error("unsupported locale setting")

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(locale, "setlocale", unknown)
    assert main(["cache", "info"]) == 0
