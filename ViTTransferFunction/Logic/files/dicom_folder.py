"""Finds the DICOM series in a folder or its subfolders."""

from __future__ import annotations

import filecmp
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..core.system.errors import InputError
from ..core.system.regular_file import check_length, check_regular_file
from .dicom_kind import instead_of_scan
from .dicom_slice import CUT_OFF, DicomSlice, heights, pixel_digest, read_slice, turned
from .file_start import DICOM_START_BYTES, is_dicom_start, read_start
from .itk_errors import last_line
from .volumes_of_series import IMAGE_TYPE, TRAITS, volumes_of_series

MOST_ENTRIES = 50_000
"""Most files and folders that are searched. A patient's CD has some thousands; a user who names a whole disk by mistake is
told at once."""

NO_SLICES = (".nrrd", ".nii", ".nii.gz", ".mha", ".json", ".png", ".gif", ".mp4")
"""Endings of results, in lower case: they are not slices, and may be written repeatedly beside a DICOM series."""

SCOUT = "LOCALIZER"
"""Value in a scout's image type (DICOM PS3.3, C.8.2.1.1.1). Some scanners put scouts into the series of the scan."""

_START_BYTES = 1024
"""First bytes of a file, which contain its unique identifier (0002,0003)."""

_FILES_OF_SYSTEMS = (".ds_store", "thumbs.db", "desktop.ini")
"""Files that operating systems write into folders that are viewed, in lower case."""

FOLDERS_OF_SYSTEMS = ("system volume information", "$recycle.bin", "lost+found")
"""Folders, in lower case, that operating systems put on a disk and that nobody may read; those of Macs are hidden."""


@dataclass(frozen=True, eq=False)
class DicomSeries:
    """A series, or one of several volumes in a series.

    Attributes:
        slices: its files, from the lowest to the highest along the normal of the first, as GDCM sorts them.
        part: name of the volume within its series, such as "echo time 4.6 ms" or "file 0002.dcm"; "" if it is the whole series.
    """

    slices: tuple[DicomSlice, ...]
    part: str = ""

    @property
    def number(self) -> str:
        """Number of the series in its study, or ""."""
        return self.slices[0].series_number

    @property
    def description(self) -> str:
        """Name of the series at the scanner, or ""."""
        return self.slices[0].description

    @property
    def instead(self) -> str:
        """What it is if not a scan (`instead_of_scan`); "" if it may be one."""
        return next(filter(None, (each.instead for each in self.slices)), "")

    @property
    def size(self) -> tuple[int, int, int]:
        """Voxels along (I, J, K), assuming that all slices have the size of the first."""
        width, height, _ = self.slices[0].size
        return width, height, sum(each.size[2] for each in self.slices)

    @property
    def may_be_volume(self) -> bool:
        """Whether it has several parallel greyscale slices of a scan, at more than one position.

        This excludes surveys in several directions, scouts, photographed reports, videos, segmentations and doses. Slices that
        form no stack for other reasons, such as a duplicate, are not excluded: the user is told of them later.
        """
        return (
            self.size[2] > 1
            and not self.instead
            and all(each.components == 1 for each in self.slices)
            and not turned(self.slices).any()
            and (self.slices[0].size[2] > 1 or bool(np.ptp(heights(self.slices)) > 0.0))
        )


@dataclass(frozen=True)
class FolderContent:
    """What a folder holds.

    Attributes:
        series: the series, in the order of their numbers; if a series has several volumes, each of these.
        unread: DICOM files without a readable slice, such as truncated files, reports and outlines, with the reason.
        empty: empty files and broken links beside slices: perhaps slices that were not copied.
    """

    series: list[DicomSeries]
    unread: dict[Path, str]
    empty: list[Path]


def series_files(folder: Path) -> list[Path]:
    """The files in a folder that may belong to DICOM series, judging without reading them completely, sorted.

    If the folder itself holds no DICOM files, as on a patient's CD, these are also files from its subfolders, except hidden
    ones.

    Raises:
        InputError: a folder cannot be read, or there are far too many files below it.
    """
    own = [entry for entry in _entries(folder) if entry.is_file() and not entry.name.lower().endswith(NO_SLICES)]
    return own if any(map(_is_dicom, own)) else own + [path for path in _files_below(folder) if _is_dicom(path)]


def holds_dicom(folder: Path) -> bool:
    """Whether the folder or a subfolder holds DICOM files. Raises InputError as `series_files` does."""
    return any(map(_is_dicom, series_files(folder)))


def read_content(folder: Path) -> FolderContent:
    """Read the headers of all DICOM files that `series_files` finds. Of copies of a slice, only one is used.

    Raises:
        InputError: a folder or file cannot be read, there are far too many files, or an entry is neither file nor folder.
    """
    for entry in _entries(folder):
        # GDCM would open a pipe, for example, and wait for ever.
        if not entry.is_dir():
            check_regular_file(entry)
    by_series: dict[tuple[str, ...], list[DicomSlice]] = {}
    unread: dict[Path, str] = {}
    for path in series_files(folder):
        found = _slice_or_reason(path)
        if isinstance(found, DicomSlice):
            by_series.setdefault(_series_of(found), []).append(found)
        elif _is_dicom(path):
            unread[path] = found
    once = (_without_second_exports(_without_copies(slices)) for slices in by_series.values())
    series = (each for slices in once for each in _volumes(slices, folder))
    slices = [one.path for ones in by_series.values() for one in ones]
    return FolderContent(sorted(series, key=_rank), unread, _empty_beside(slices))


def is_of_system(name: str) -> bool:
    """Whether a file of this name was written by the operating system, not by the user.

    Beside each file that a Mac copies to a shared disk or a memory stick, it puts one with the same name after `._`.
    """
    return name.startswith("._") or name.lower() in _FILES_OF_SYSTEMS


def _series_of(one: DicomSlice) -> tuple[str, ...]:
    """What slices of one series have in common.

    Programs that take names out of headers may also remove UIDs, or make those of a whole study equal.
    """
    other = () if one.series_uid else (one.description, one.modality, one.date)
    return one.series_uid, one.series_number, *other


def _empty_beside(slices: list[Path]) -> list[Path]:
    """Broken links, and files without content or with zeros only, as after an interrupted copy, in the folders of slices."""
    beside = {entry for folder in {path.parent for path in slices} for entry in folder.iterdir()} - set(slices)
    named = sorted(entry for entry in beside if not entry.name.startswith(".") and not is_of_system(entry.name))
    return [entry for entry in named if not entry.exists() or (entry.is_file() and _holds_nothing(entry))]


def _holds_nothing(file: Path) -> bool:
    return not file.name.lower().endswith(NO_SLICES) and not read_start(file, DICOM_START_BYTES).strip(b"\0")


def _slice_or_reason(path: Path) -> DicomSlice | str:
    try:
        found = read_slice(path, [trait.tag for trait in TRAITS])
        return f"{path.name} {CUT_OFF}" if found.is_cut_off else found
    except RuntimeError as error:
        return f"{path.name} {_why_unread(path, last_line(error))}"


def _why_unread(path: Path, complaint: str) -> str:
    instead = instead_of_scan(path)
    return f"is {instead}" if instead else f"cannot be read as an image: {complaint} Expected a slice of a scan."


def _without_copies(slices: Iterable[DicomSlice]) -> Iterator[DicomSlice]:
    """Slices of a series without those whose file is byte by byte the same as an earlier one, as after copying a CD twice."""
    # There may be hundreds of time points, but the first bytes of different files differ: few are compared to the end.
    alike: dict[tuple[int, bytes], list[Path]] = {}
    for one in slices:
        others = alike.setdefault((one.path.stat().st_size, read_start(one.path, _START_BYTES)), [])
        if not any(filecmp.cmp(one.path, other, shallow=False) for other in others):
            others.append(one.path)
            yield one


def _without_second_exports(slices: Iterable[DicomSlice]) -> list[DicomSlice]:
    """Slices without those that an archive has written again with other headers: of one UID, place, traits and pixels.

    Only if all of these are equal it is certainly no other phase or echo, whose outermost slices may be empty alike.
    """
    alike: dict[tuple[object, ...], list[DicomSlice]] = {}
    for one in slices:
        unlike = () if one.instance_uid and one.size[2] == 1 else (one.path,)
        alike.setdefault((one.instance_uid, *one.position, *one.traits.values(), *unlike), []).append(one)
    return [one for ones in alike.values() for one in (ones if len(ones) == 1 else _of_different_pixels(ones))]


def _of_different_pixels(slices: list[DicomSlice]) -> Iterable[DicomSlice]:
    first: dict[bytes, DicomSlice] = {}
    for one in slices:
        first.setdefault(pixel_digest(one.path), one)
    return first.values()


def _volumes(slices: list[DicomSlice], folder: Path) -> list[DicomSeries]:
    """The volumes of one series: each file with several frames, and those that files with a single frame form together.

    Scouts among the slices of a scan are separate volumes.
    """
    scouts, others = [one for one in slices if _is_scout(one)], [one for one in slices if not _is_scout(one)]
    if scouts and others:
        return [DicomSeries((one,), f"scout {one.path.relative_to(folder)}") for one in scouts] + _volumes(others, folder)
    single = [one for one in slices if one.size[2] == 1]
    if len(single) < len(slices) > 1:
        whole = [DicomSeries((one,), f"file {one.path.relative_to(folder)}") for one in slices if one.size[2] > 1]
        return whole + (_volumes(single, folder) if single else [])
    stacked = [slices[index] for index in np.argsort(heights(slices), kind="stable")]
    return [DicomSeries(tuple(volume), part) for part, volume in volumes_of_series(stacked)]


def _is_scout(one: DicomSlice) -> bool:
    return SCOUT in IMAGE_TYPE.value(one).split("\\")


def _rank(series: DicomSeries) -> tuple[int, str]:
    return int(series.number) if series.number.isdecimal() else 0, series.description


def _entries(folder: Path) -> list[Path]:
    try:
        entries = sorted(folder.iterdir())
        for entry in entries:
            # Otherwise a path that is too long counts as missing, and so does its slice, without a warning.
            check_length(entry)
        return [entry for entry in entries if entry.exists() and not is_of_system(entry.name)]
    except OSError as error:
        raise InputError(f"Cannot read the folder {folder}: {error.strerror or error}.") from error


def _files_below(folder: Path) -> list[Path]:
    """Regular files in all subfolders, sorted. Links to folders are skipped, since they may form a cycle."""
    files, count = [], 0
    to_do = _folders_among(_entries(folder))
    while to_do:
        below = to_do.pop()
        entries = _entries(below)
        count += len(entries)
        if count > MOST_ENTRIES:
            raise InputError(
                f"More than {MOST_ENTRIES} files and folders lie below {folder}, and it holds no DICOM files itself; expected "
                "the folder of an examination, or of one series. Name that."
            )
        files += [entry for entry in entries if entry.is_file() and not entry.name.lower().endswith(NO_SLICES)]
        to_do += _folders_among(entries)
    return sorted(files)


def _folders_among(entries: list[Path]) -> list[Path]:
    folders = [entry for entry in entries if entry.is_dir() and not entry.is_symlink() and not _is_junction(entry)]
    return [entry for entry in folders if not entry.name.startswith(".") and entry.name.lower() not in FOLDERS_OF_SYSTEMS]


def _is_junction(folder: Path) -> bool:
    """Whether a folder is a junction, Windows' older kind of link; those such as *My Pictures* cannot be read."""
    tag = getattr(folder.lstat(), "st_reparse_tag", 0)
    return bool(tag) and tag == getattr(stat, "IO_REPARSE_TAG_MOUNT_POINT", None)


def _is_dicom(path: Path) -> bool:
    return path.name.upper() != "DICOMDIR" and is_dicom_start(read_start(path, DICOM_START_BYTES))
