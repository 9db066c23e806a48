"""Series of one UID that hold several volumes: phases, time points, echoes; which there are, and which is read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.files.series_choice import SeveralSeries
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Testing.attack.scans import Scan, write_dicom

ACQUISITION, ECHO_TIME, IMAGE_TYPE, B_VALUE = "0020|0012", "0018|0081", "0008|0008", "0018|9087"
TRIGGER, ACQUIRED, NUMBER = "0018|1060", "0008|0032", "0020|0013"
ABOUT = {"0020|0011": "5", "0008|103e": "Liver", "0008|0060": "MR"}


def write(
    folder: Path, tags_of: Callable[[int, int], Mapping[str, str]], counts: tuple[int, ...] = (4, 4), mixed: bool = False
) -> None:
    """Write a series of volumes of so many slices each, whose voxels are ten times the volume's index.

    Args:
        folder: where to.
        tags_of: elements of the slice, by the volume's index and its own.
        counts: of slices.
        mixed: whether the names of the files say nothing of their volumes; else they are in their order.
    """
    for volume, count in enumerate(counts):
        for k in range(count):
            array = np.full((1, 6, 7), 10 * volume, np.int16)
            array[0, 0, 0] = k
            scan = Scan(array, np.array([1.0, 1.0, 3.0]), np.eye(3), np.array([0.0, 0.0, 3.0 * k]), ([0] * 3, [0] * 3))
            tags = {**ABOUT, NUMBER: "1", **tags_of(volume, k)}
            rank = (volume + k) % len(counts) if mixed else volume
            (path,) = write_dicom(folder, scan, first=100 * rank + k, about=tags)
            assert path.exists()


def offered(folder: Path) -> list[str]:
    """What is offered, of which each can be chosen and is the volume that was written."""
    with pytest.raises(SeveralSeries) as several:
        read_volume(folder)
    for index, line in enumerate(several.value.lines):
        volume = read_volume(folder, pytest.fail, line)
        assert (volume.array[:, 3, 3] == 10 * index).all()
        assert volume.array[:, 0, 0].tolist() == list(range(len(volume.array)))
    return list(several.value.lines)


@pytest.mark.parametrize(
    ("tag", "values", "told"),
    [
        (ECHO_TIME, ("2.30", "4.6"), ("echo time 2.3 ms", "echo time 4.6 ms")),
        ("0018|0086", ("1", "2"), ("echo 1", "echo 2")),
        (B_VALUE, ("", "800"), ("no b-value", "b-value 800")),
        (IMAGE_TYPE, ("ORIGINAL\\PRIMARY\\F", "ORIGINAL\\PRIMARY\\W"), ("image type F", "image type W")),
        (IMAGE_TYPE, ("ORIGINAL\\M", "ORIGINAL\\M\\W"), ("image type ORIGINAL\\M", "image type ORIGINAL\\M\\W")),
        ("0020|0100", ("2", "11"), ("time point 2", "time point 11")),
        (ACQUISITION, ("9", "10"), ("acquisition 9", "acquisition 10")),
        (ACQUIRED, ("120005.250000", "120035"), ("at 12:00:05.25", "at 12:00:35")),
        (ACQUIRED, ("235950", "000020.5"), ("at 23:59:50", "at 00:00:20.5")),
        ("0008|0033", ("090005", "100035"), ("at 09:00:05", "at 10:00:35")),
    ],
)  # fmt: skip
def test_volumes_are_called_by_what_differs_and_each_is_read(
    tmp_path: Path, tag: str, values: tuple[str, str], told: tuple[str, str]
) -> None:
    write(tmp_path, lambda volume, _: {tag: values[volume]})
    assert offered(tmp_path) == [f"5: Liver, {each} (MR, 7×6×4)" for each in told]


def test_volumes_may_differ_in_more_than_one_way(tmp_path: Path) -> None:
    write(tmp_path, lambda volume, _: {ECHO_TIME: "28"[volume // 2], ACQUISITION: "12"[volume % 2]}, (4, 4, 4, 4))
    told = [f"echo time {echo} ms, acquisition {number}" for echo in "28" for number in "12"]
    assert offered(tmp_path) == [f"5: Liver, {each} (MR, 7×6×4)" for each in told]


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize(
    ("tag", "told"), [(TRIGGER, "trigger time"), (ACQUIRED, "time"), (ACQUISITION, "acquisition"), (NUMBER, "image number")]
)
def test_where_each_slice_has_a_value_of_its_own_volumes_are_told_by_their_order_at_each_place(
    tmp_path: Path, tag: str, told: str, mixed: bool
) -> None:
    """As of a beating heart, whose slices are taken one after the other."""
    write(tmp_path, lambda volume, k: {tag: str(95000 + 300 * k + 7 * volume)}, (4, 4, 4), mixed)
    assert offered(tmp_path) == [f"5: Liver, {number} of 3 by {told} (MR, 7×6×4)" for number in (1, 2, 3)]


def test_volumes_that_were_taken_around_midnight_are_not_mixed(tmp_path: Path) -> None:
    times = (("235956", "235958", "000000", "000002"), ("000004", "000006", "000008", "000010"))
    write(tmp_path, lambda volume, k: {ACQUIRED: times[volume][k]})
    assert offered(tmp_path) == [f"5: Liver, {number} of 2 by time (MR, 7×6×4)" for number in (1, 2)]


def test_acquisitions_that_take_turns_at_two_halves_are_no_volumes_but_their_order_is(tmp_path: Path) -> None:
    write(tmp_path, lambda volume, k: {ACQUISITION: str(2 * volume + k // 2)})
    assert offered(tmp_path) == [f"5: Liver, {number} of 2 by acquisition (MR, 7×6×4)" for number in (1, 2)]


def test_a_volume_that_was_broken_off_is_offered_as_far_as_it_goes(tmp_path: Path) -> None:
    write(tmp_path, lambda volume, _: {ACQUISITION: str(volume)}, (4, 4, 2))
    assert [line[-8:-1] for line in offered(tmp_path)] == [", 7×6×4", ", 7×6×4", ", 7×6×2"]


def test_a_slice_that_was_taken_again_does_not_stand_in_the_way(tmp_path: Path) -> None:
    write(tmp_path, lambda volume, _: {ACQUISITION: str(volume)}, (4, 1))
    warnings: list[str] = []
    assert (read_volume(tmp_path, warnings.append).array[:, 3, 3] == 0).all()
    assert "passed over, since they are no volumes: 5: Liver, acquisition 1 (MR, 7×6×1)" in warnings[0]


@pytest.mark.parametrize("wanted", ["echo 1", "Liver, ECHO 1"])
def test_the_name_of_one_that_is_the_beginning_of_others_is_its_own(tmp_path: Path, wanted: str) -> None:
    write(tmp_path, lambda volume, _: {"0018|0086": str(volume)}, (4,) * 12)
    if wanted == "echo 1":
        assert (read_volume(tmp_path, pytest.fail, wanted).array[:, 3, 3] == 10).all()
    else:
        with pytest.raises(SeveralSeries, match=r"3 DICOM volumes .* are 'Liver, ECHO 1'"):
            read_volume(tmp_path, series=wanted)


def test_the_number_of_a_series_leads_to_its_volumes(tmp_path: Path) -> None:
    write(tmp_path, lambda volume, _: {"0018|0086": str(volume + 1)})
    with pytest.raises(SeveralSeries) as several:
        read_volume(tmp_path, series="5")
    assert several.value.lines == ("5: Liver, echo 1 (MR, 7×6×4)", "5: Liver, echo 2 (MR, 7×6×4)")


def test_of_very_many_the_message_names_some(tmp_path: Path) -> None:
    write(tmp_path, lambda volume, _: {"0020|0100": str(volume)}, (2,) * 30)
    with pytest.raises(SeveralSeries, match=r"holds 30 .* time point 19 \(MR, 7×6×2\); and 10 more\. ") as several:
        read_volume(tmp_path)
    assert len(several.value.lines) == 30


@pytest.mark.parametrize(
    "tags_of",
    [
        lambda volume, k: {},
        lambda volume, k: {NUMBER: str(k)},
        lambda volume, k: {TRIGGER: "2" if (volume, k) == (1, 2) else str(100 * volume + k)},
    ],
    ids=["all alike", "numbers twice", "a time twice at one place"],
)
def test_what_nothing_tells_apart_is_refused_as_copies_are(
    tmp_path: Path, tags_of: Callable[[int, int], Mapping[str, str]]
) -> None:
    write(tmp_path, lambda volume, k: {**tags_of(volume, k)})
    with pytest.raises(InputError, match="two slices at one place") as refusal:
        read_volume(tmp_path)
    assert not isinstance(refusal.value, SeveralSeries)


def test_stacks_side_by_side_are_not_mixed(tmp_path: Path) -> None:
    for side, left in enumerate((0.0, 200.0)):
        for k in range(4):
            scan = Scan(
                np.full((1, 6, 7), k, np.int16), np.array([1.0, 1.0, 3.0]), np.eye(3), np.array([left, 0.0, 3.0 * k]), ([], [])
            )
            write_dicom(tmp_path, scan, first=100 * side + k, about={**ABOUT, NUMBER: str((side + k) % 2)})
    with pytest.raises(InputError, match="two slices at one place"):
        read_volume(tmp_path)


def test_a_series_of_one_volume_is_not_split_whatever_differs(tmp_path: Path) -> None:
    write(tmp_path, lambda _, k: {ACQUISITION: str(k), ECHO_TIME: str(k), TRIGGER: str(k)}, (4,))
    assert len(read_volume(tmp_path, pytest.fail).array) == 4


def test_a_large_gap_does_not_make_one_place_of_neighbours(tmp_path: Path) -> None:
    """As where a scan went on far below: it is said to be no one stack, and not that two slices are at one place."""
    for k, height in enumerate((0.0, 1.0, 2.0, 503.0, 504.0, 505.0)):
        scan = Scan(np.full((1, 6, 7), k, np.int16), np.ones(3), np.eye(3), np.array([0.0, 0.0, height]), ([], []))
        write_dicom(tmp_path, scan, first=k, about={**ABOUT, NUMBER: str(k % 3)})
    with pytest.raises(InputError, match="they lie 1 to 501 mm apart"):
        read_volume(tmp_path)
