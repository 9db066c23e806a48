"""The judgement itself: each way in which a run can be wrong is found."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from ViTTransferFunction.Testing.attack.calls import Call, Outcome
from ViTTransferFunction.Testing.attack.cases import Case, Place, Step
from ViTTransferFunction.Testing.attack.invariant import snapshot, violations
from ViTTransferFunction.Testing.attack.wheel import SHARES, make_case

REFUSAL = "error: There is no file scan.nii.\n"


@pytest.fixture
def place(tmp_path: Path) -> Place:
    place = Place(tmp_path, tmp_path / "tiny.pth")
    (place.work / "scan.nii").write_text("voxels")
    (place.work / "clicks.json").write_text("points")
    return place


def judged(place: Place, outcome: Outcome, done: object = None, **of_call: object) -> list[str]:
    """What is wrong with a run that ended so, and did `done` to the files."""
    step = Step((place.segment("scan.nii", **of_call),))  # type: ignore[arg-type]
    before = snapshot(place.work)
    if callable(done):
        done()
    return violations(Case("test", "", [step]), step, [outcome], place, before)


def ended(code: int, stderr: str = "", hung: bool = False) -> Outcome:
    return Outcome(code, hung, 0.0, "", stderr)


def test_a_refusal_in_one_sentence_is_right(place: Place) -> None:
    assert judged(place, ended(2, REFUSAL)) == []


@pytest.mark.parametrize(
    ("outcome", "message"),
    [
        (ended(1, "Traceback (most recent call last):\n  File\nKeyError: 1\n"), "KeyError: 1"),
        (ended(-11), "SIGSEGV"),
        (ended(0, hung=True), "hangs"),
        (ended(2), "0 lines"),
        (ended(2, REFUSAL + REFUSAL), "2 lines"),
        (ended(2, f"x.py:3: RuntimeWarning: overflow\n{REFUSAL}"), "RuntimeWarning"),
        (ended(2, f"WARNING: In /itkNiftiImageIO.cxx, line 3\n{REFUSAL}"), "itkNifti"),
        (ended(2, "error: ITK ERROR: NiftiImageIO(0x55ffd9310): no file\n"), "0x55ffd9310"),
        (ended(2, f"error: {'a' * 2000}\n"), "characters"),
    ],
)
def test_what_is_said_otherwise_is_found(place: Place, outcome: Outcome, message: str) -> None:
    assert any(message in failure for failure in judged(place, outcome))


def test_our_own_warnings_and_progress_bars_are_no_further_sentences(place: Place) -> None:
    bar = "\rComputing features:  50%|█████     | 1/2 [00:02<00:02,  2.24s/it]"
    assert judged(place, ended(2, f"{bar}\nWARNING: slices may be missing.\n{bar}{REFUSAL}")) == []
    assert judged(place, ended(2, f"Computing features...\nWARNING: slices may be missing.\n{REFUSAL}")) == []


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("scan.nii", "changed its input"),
        ("clicks.json", "changed its input"),
        ("out.nii.gz", "left its output"),
        (".writing-abc.nii", "left .writing-"),
        ("core", "left core"),
        ("../temporary/x", "left in temporary"),
        ("../home/x", "left in home"),
    ],
)
def test_what_a_refused_run_changed_or_left_is_found(place: Place, name: str, message: str) -> None:
    failures = judged(place, ended(2, REFUSAL), lambda: (place.work / name).write_text("other"))
    assert any(message in failure for failure in failures)


def test_what_was_asked_for_in_the_users_home_is_looked_for_there(place: Place) -> None:
    failures = judged(place, ended(0), lambda: (place.home / "out.nii.gz").write_bytes(b"half"), output="~/out.nii.gz")
    assert ["cannot be read" in failure for failure in failures] == [True]
    assert judged(place, ended(2, REFUSAL), output="~/out.nii.gz") == ["left in home: out.nii.gz"]


def test_a_result_that_cannot_be_read_is_found(place: Place) -> None:
    failures = judged(place, ended(0), lambda: (place.work / "out.nii.gz").write_bytes(b"half"))
    assert any("cannot be read" in failure for failure in failures)


def test_a_killed_run_may_leave_what_it_was_writing_and_an_interrupted_one_may_not(place: Place) -> None:
    def leave() -> None:
        (place.work / ".writing-abc.nii").touch()

    assert judged(place, ended(-9), leave, signal_name="SIGKILL") == []
    (place.work / ".writing-abc.nii").unlink()
    assert judged(place, ended(130, "interrupted\n"), leave, signal_name="SIGINT") != []


def test_a_number_is_the_same_case_again_and_each_kind_comes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def noted(chance: random.Random, _: Place) -> Case:
        return Case("noted", str(chance.random()), [Step((Call((), ""),))])

    wheel = "ViTTransferFunction.Testing.attack.wheel.SHARES"
    place = Place(tmp_path, tmp_path / "tiny.pth")
    with monkeypatch.context() as patched:
        patched.setattr(wheel, {noted: 1})
        assert make_case(3, 17, place).what == make_case(3, 17, place).what
        assert len({make_case(seed, number, place).what for seed in (3, 4) for number in (17, 18)}) == 4
    counted: list[int] = []
    makers = {lambda *_, n=n: counted.append(n): share for n, share in enumerate(SHARES.values())}
    monkeypatch.setattr(wheel, makers)
    for number in range(sum(SHARES.values())):
        make_case(0, number, place)
    assert [counted.count(n) for n in range(len(SHARES))] == list(SHARES.values())
