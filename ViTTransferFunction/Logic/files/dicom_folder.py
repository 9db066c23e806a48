"""Which DICOM series a folder holds, in itself or below."""

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
from .dicom_slice import DicomSlice, heights, read_slice, turned
from .file_start import DICOM_START_BYTES, is_dicom_start, read_start
from .itk_errors import last_line
from .volumes_of_series import IMAGE_TYPE, TRAITS, volumes_of_series

MOST_ENTRIES = 50_000
"""Files and folders below a folder that is looked through. A disk that a patient brings has some thousands; whoever names a
whole computer by mistake is told at once."""

NO_SLICES = (".nrrd", ".nii", ".nii.gz", ".mha", ".json", ".png", ".gif", ".mp4")
"""Endings, in small letters, of results, which are no slices and may be written again and again beside a DICOM series."""

SCOUT = "LOCALIZER"
"""Among the values of a scout's image type (DICOM PS3.3, C.8.2.1.1.1). Some scanners put it into the series of the scan."""

_START_BYTES = 1024
"""In which a file says by what number it is known from all others (0002,0003)."""

_FILES_OF_SYSTEMS = (".ds_store", "thumbs.db", "desktop.ini")
"""What systems write where a folder is looked at, in small letters."""

FOLDERS_OF_SYSTEMS = ("system volume information", "$recycle.bin", "lost+found")
"""Folders, in small letters, that systems put on a disk and let nobody read; those of Macs are hidden."""


@dataclass(frozen=True, eq=False)
class DicomSeries:
    """A series of a folder, or one of several volumes in it.

    Attributes:
        slices: its files, from the lowest to the highest along the normal of the first, as GDCM sorts them.
        part: which of the volumes in its series it is, "echo time 4.6 ms" say, or "file 0002.dcm"; "" where it is all of it.
    """

    slices: tuple[DicomSlice, ...]
    part: str = ""

    @property
    def number(self) -> str:
        """Of the series in its study, or ""."""
        return self.slices[0].series_number

    @property
    def description(self) -> str:
        """What it is called at the scanner, or ""."""
        return self.slices[0].description

    @property
    def instead(self) -> str:
        """What it is instead of a scan, as `instead_of_scan` says; "" where it may be one."""
        return next(filter(None, (each.instead for each in self.slices)), "")

    @property
    def size(self) -> tuple[int, int, int]:
        """Voxels along (I, J, K), as far as all slices are like the first."""
        width, height, _ = self.slices[0].size
        return width, height, sum(each.size[2] for each in self.slices)

    @property
    def may_be_volume(self) -> bool:
        """Whether it has several parallel slices of a scan in shades of grey, at more than one place.

        Surveys in several directions, scouts, photographed reports, videos, segmentations and doses do not. Slices that are
        no stack for other reasons, such as one that is there twice, are for the user to hear of.
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
        series: in the order of their numbers; of one that has several volumes at the same places, these.
        unread: DICOM files without a slice that can be read, cut off, or reports, outlines and the like; and why, with what
            was expected and what to do.
        empty: files beside slices that hold nothing, and links that lead nowhere: slices, perhaps, that were not copied.
    """

    series: list[DicomSeries]
    unread: dict[Path, str]
    empty: list[Path]


def series_files(folder: Path) -> list[Path]:
    """The files that a DICOM series of the folder may consist of, as far as can be told without reading them, sorted.

    They lie in the folder itself; where that holds no DICOM files, as on the disk that a patient brings, in those below, of
    which hidden ones are passed over.

    Raises:
        InputError: a folder cannot be read, or far too much lies below.
    """
    own = [entry for entry in _entries(folder) if entry.is_file() and not entry.name.lower().endswith(NO_SLICES)]
    return own if any(map(_is_dicom, own)) else own + [path for path in _files_below(folder) if _is_dicom(path)]


def holds_dicom(folder: Path) -> bool:
    """Whether the folder, or one below, holds DICOM files. Raises InputError as `series_files` does."""
    return any(map(_is_dicom, series_files(folder)))


def read_content(folder: Path) -> FolderContent:
    """Read the headers of all DICOM files that `series_files` finds. Of a slice and its copies, one is taken.

    Raises:
        InputError: a folder or file cannot be read, far too much lies below, or something in it is neither file nor folder.
    """
    for entry in _entries(folder):
        # GDCM would open it, and wait.
        if not entry.is_dir():
            check_regular_file(entry)
    by_uid: dict[str, list[DicomSlice]] = {}
    unread: dict[Path, str] = {}
    for path in series_files(folder):
        found = _slice_or_reason(path)
        if isinstance(found, DicomSlice):
            by_uid.setdefault(found.series_uid, []).append(found)
        elif _is_dicom(path):
            unread[path] = found
    series = (each for slices in by_uid.values() for each in _volumes(list(_without_copies(slices)), folder))
    slices = [one.path for ones in by_uid.values() for one in ones]
    return FolderContent(sorted(series, key=_rank), unread, _empty_beside(slices))


def is_of_system(name: str) -> bool:
    """Whether a file of this name is none of the user's.

    Beside each file that a Mac copies to a shared disk or a stick, it puts one that is called the same but for `._` in front.
    """
    return name.startswith("._") or name.lower() in _FILES_OF_SYSTEMS


def _empty_beside(slices: list[Path]) -> list[Path]:
    """Files in the folders of slices that hold nothing but zeros, as where a copy broke off, and links that lead nowhere."""
    beside = {entry for folder in {path.parent for path in slices} for entry in folder.iterdir()} - set(slices)
    named = sorted(entry for entry in beside if not entry.name.startswith(".") and not is_of_system(entry.name))
    return [entry for entry in named if not entry.exists() or (entry.is_file() and _holds_nothing(entry))]


def _holds_nothing(file: Path) -> bool:
    return not file.name.lower().endswith(NO_SLICES) and not read_start(file, DICOM_START_BYTES).strip(b"\0")


def _slice_or_reason(path: Path) -> DicomSlice | str:
    try:
        return read_slice(path, [trait.tag for trait in TRAITS])
    except RuntimeError as error:
        return f"{path.name} {_why_unread(path, last_line(error))}"


def _why_unread(path: Path, complaint: str) -> str:
    instead = instead_of_scan(path)
    return f"is {instead}" if instead else f"cannot be read as an image: {complaint} Expected a slice of a scan."


def _without_copies(slices: Iterable[DicomSlice]) -> Iterator[DicomSlice]:
    """Slices of a series but for files that are the same, byte by byte, as one before, as where a disk was copied twice."""
    # Of time points there are hundreds at one place, and of a file's first bytes some are its own: few are compared to the end.
    alike: dict[tuple[int, bytes], list[Path]] = {}
    for one in slices:
        others = alike.setdefault((one.path.stat().st_size, read_start(one.path, _START_BYTES)), [])
        if not any(filecmp.cmp(one.path, other, shallow=False) for other in others):
            others.append(one.path)
            yield one


def _volumes(slices: list[DicomSlice], folder: Path) -> list[DicomSeries]:
    """The volumes of one series: the files of several frames, each by itself, and what those of one frame make together.

    Scouts among the slices of a scan are none of them.
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
            # It would not be there, and its slice be missing without a word.
            check_length(entry)
        return [entry for entry in entries if entry.exists() and not is_of_system(entry.name)]
    except OSError as error:
        raise InputError(f"Cannot read the folder {folder}: {error.strerror or error}.") from error


def _files_below(folder: Path) -> list[Path]:
    """Ordinary files in all folders below, sorted. Links to folders are passed over: they may lead in a circle."""
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
    """Whether it is Windows' older kind of link, as *My Pictures* in *Documents* is, which nobody may look into."""
    tag = getattr(folder.lstat(), "st_reparse_tag", 0)
    return bool(tag) and tag == getattr(stat, "IO_REPARSE_TAG_MOUNT_POINT", None)


def _is_dicom(path: Path) -> bool:
    return path.name.upper() != "DICOMDIR" and is_dicom_start(read_start(path, DICOM_START_BYTES))
