"""Which of a folder's DICOM series, or volumes in one, is read: the one that is named, or the only one that can be a volume."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from ..core.system.errors import InputError, shown
from .dicom_folder import DicomSeries

_HOW = "Choose by a part of a line that no other has, or by a series' number: --series, or a column series in a table of cases."

MOST_TOLD = 20
"""Lines in a message; of time points there may be hundreds."""


class SeveralSeries(InputError):
    """A folder holds several series, or one with several volumes, that may be meant.

    Attributes:
        lines: what tells each from the others; any is a choice of `choose_series`.
    """

    def __init__(self, message: str, lines: Iterable[str]) -> None:
        super().__init__(message)
        self.lines = tuple(lines)


def choose_series(
    series: Sequence[DicomSeries], folder: Path, wanted: str | None, on_warning: Callable[[str], None]
) -> DicomSeries:
    """The series to read.

    Args:
        series: all that the folder holds, at least one.
        folder: that holds them.
        wanted: the number of a series, its description, its line, or a part of that, in letters of any case; None: the only
            one, or the only one that can be a volume.
        on_warning: is told what was passed over where nobody chose.

    Raises:
        SeveralSeries: more than one may be meant, or `wanted` is none of them.
        InputError: none can be a volume.
    """
    lines = _lines(series)
    if wanted is not None:
        return _named(dict(zip(lines, series, strict=True)), folder, wanted)
    if len(series) == 1:
        return series[0]
    volumes = [index for index, each in enumerate(series) if each.may_be_volume]
    if not volumes:
        told = (f"The series {line} is {each.instead}" for line, each in zip(lines, series, strict=True) if each.instead)
        raise InputError(
            f"The folder {folder} holds {len(series)} DICOM series, none of which has several parallel slices of a scan in "
            f"shades of grey: {_told(lines)}. {next(told, 'Name a folder with a whole series.')}"
        )
    if len(volumes) > 1:
        offered = [lines[index] for index in volumes]
        raise SeveralSeries(
            f"The folder {folder} holds {len(offered)} DICOM volumes to choose from: {_told(offered)}. {_HOW}", offered
        )
    (chosen,) = volumes
    others = [line for index, line in enumerate(lines) if index != chosen]
    on_warning(f"{folder}: the series {lines[chosen]} is read; passed over, since they are no volumes: {'; '.join(others)}.")
    return series[chosen]


def _named(by_line: dict[str, DicomSeries], folder: Path, wanted: str) -> DicomSeries:
    text = " ".join(wanted.split()).casefold()
    exactly = [
        line
        for line, series in by_line.items()
        if text in (series.number, series.description.casefold(), series.part.casefold(), line.casefold())
    ]
    # Tables that have been through pandas have 3.0 for a number, and descriptions have it for a slice thickness.
    number = text.removesuffix(".0")
    # Sizes and dates have digits as well; who gives nothing else means the series' number.
    found = exactly or [
        line for line, series in by_line.items() if series.number == number or (text in line.casefold() and not text.isdigit())
    ]
    if not found:
        raise SeveralSeries(f"No DICOM series in {folder} is {shown(wanted)}; it holds {_told(list(by_line))}. {_HOW}", by_line)
    if len(found) > 1:
        raise SeveralSeries(
            f"{len(found)} DICOM volumes in {folder} are {shown(wanted)}: {_told(found)}. Give a part of a line that no "
            "other has, or all of it.",
            found,
        )
    return by_line[found[0]]


def _told(lines: Sequence[str]) -> str:
    more = f"; and {len(lines) - MOST_TOLD} more" if len(lines) > MOST_TOLD else ""
    return "; ".join(lines[:MOST_TOLD]) + more


def _lines(series: Sequence[DicomSeries]) -> list[str]:
    """What people tell each series by, and no more than that takes: its date, and as the last its UID, only where need be."""
    plain = [_line(each) for each in series]
    dated = [f"{line} of {each.slices[0].date or 'unknown date'}" for line, each in zip(plain, series, strict=True)]
    unique = [f"{line} {each.slices[0].series_uid}" for line, each in zip(dated, series, strict=True)]
    ways = (plain, dated, unique)
    return [next(way[index] for way in ways if way.count(way[index]) == 1) for index in range(len(series))]


def _line(series: DicomSeries) -> str:
    name = ": ".join(filter(None, (series.number, series.description))) or "without a name"
    size = "×".join(map(str, series.size))
    called = ", ".join(filter(None, (name, series.part)))
    return f"{called} ({series.slices[0].modality or 'unknown modality'}, {size})"
