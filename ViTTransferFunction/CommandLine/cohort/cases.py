"""Finds the cases of a cohort, each with a name, a volume and an annotations file, in a table or a folder."""

from __future__ import annotations

import csv
import io
import logging
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ViTTransferFunction.CommandLine.options import spelled_out
from ViTTransferFunction.Logic.core.system.errors import InputError, shown
from ViTTransferFunction.Logic.core.system.file_names import LONGEST_NAME_BYTES, is_device
from ViTTransferFunction.Logic.core.system.regular_file import cannot_read, check_regular_file
from ViTTransferFunction.Logic.files.annotation_files import ANNOTATIONS_ENDING
from ViTTransferFunction.Logic.files.dicom_folder import FOLDERS_OF_SYSTEMS, holds_dicom
from ViTTransferFunction.Logic.files.image_formats import VOLUME_ENDINGS, image_ending, volume_ending

logger = logging.getLogger(__name__)

COLUMNS = ("case", "volume", "annotations")
"""Required columns of the table; it may have others as well."""
SERIES_COLUMN = "series"
"""Optional column of the table, for volumes that are folders with several DICOM series."""
FOLDER_ANNOTATIONS = "annotations.json"
"""Annotations file in a folder of DICOM files. A single `NAME.annotations.json` is accepted as well, since panel and app name
it after the series."""

_ABOVE_HEADING = re.compile(r'(("?)sep=.?\2)?[\s,;]*', re.IGNORECASE)
"""Lines that may precede a table's heading: empty ones, and the one that tells Excel the separator of columns."""


@dataclass(frozen=True)
class Case:
    """One volume of a cohort.

    Attributes:
        name: unique in the cohort; files are named after it, unless there is a `name_problem`.
        volume: absolute path of an image, or of a folder with DICOM series.
        annotations: absolute path of an annotations file (`read_annotations`).
        series: selects one of the folder's series, as for `choose_series`; None: the only one that can be a volume.
    """

    name: str
    volume: Path
    annotations: Path
    series: str | None = None


def read_cases(source: Path) -> list[Case]:
    """Read the cases that are listed in a table or contained in a folder.

    Args:
        source: a CSV file with the columns `COLUMNS` and optionally `SERIES_COLUMN`, whose relative paths refer to the file's
            own folder; or a folder. In a folder, `scan.nii.gz` with `scan.annotations.json` is a case, and so is a folder of
            DICOM files with an annotations file in it, or beside it with the folder's name.

    Raises:
        InputError: there are no cases, the table cannot be read or is incomplete, names are not unique, a volume has
            several annotations files, or an annotations file has several volumes or none.
    """
    if source.is_dir():
        cases = list(_cases_in_folder(source.resolve()))
        expected = f"scan.nii.gz with scan{ANNOTATIONS_ENDING}, or folders of DICOM files with {FOLDER_ANNOTATIONS} in them"
    else:
        cases = list(_cases_in_table(source))
        expected = f"a line for each case below the heading {','.join(COLUMNS)}"
    if not cases:
        raise InputError(f"{source} has no cases; expected {expected}.")
    _check_names(cases, source)
    return cases


def name_problem(name: str) -> str:
    """Explain to users why files cannot be named after a case; "" if they can.

    File names must neither lead to another folder, nor be refused by any operating system, nor be formulas to a spreadsheet.
    """
    fits = (name[:1].isalnum() or name[:1] == "_") and name[-1] not in ". "
    plain = all(character.isalnum() or character in "_-+., ()" for character in name)
    if fits and plain and len(name.encode()) <= LONGEST_NAME_BYTES and not is_device(name):
        return ""
    return (
        f"{shown(name)} cannot be the name of a case, since files are named after it. Begin with a letter or digit, use "
        "letters, digits, spaces and _ - + . , ( ) only, a hundred at most, and no name of a device, such as con."
    )


def told_name(name: str) -> str:
    """A name with a `name_problem` as the table shows it: with unprintable characters escaped, and not as a formula."""
    text = "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in name)
    return f"'{text}'" if text.startswith(("=", "+", "-", "@")) else text


def _cases_in_table(path: Path) -> Iterator[Case]:
    check_regular_file(path)
    if image_ending(path) is not None or path.suffix.lower() == ".json":
        raise InputError(
            f"{path} is no table, by its ending; expected a CSV file with a line for each case, or the folder that holds "
            "volumes with their points. One volume alone is segmented by `vittf segment`."
        )
    try:
        # Spreadsheets write a byte order mark before UTF-8.
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise cannot_read(path, error) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not text in UTF-8; save the table as 'CSV UTF-8'.") from error
    lines = text.split("\n")
    above = next((number for number, line in enumerate(lines) if not _ABOVE_HEADING.fullmatch(line)), 0)
    # Spreadsheets write semicolons in languages with decimal commas, and tabs where cells are copied.
    delimiter = max(",;\t", key=lines[above].count)
    # Strict, since after a quotation mark that is never closed, all further cases would be taken for part of one field.
    reader = csv.DictReader(io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True, strict=True)
    for _ in range(above):
        next(reader.reader)
    try:
        yield from _cases_of_rows(reader, path)
    except csv.Error as error:
        raise InputError(
            f"{path}, line {reader.line_num + 1}: {error}; is there a quotation mark that is never closed, or in the middle "
            "of a quoted field?"
        ) from error


def _cases_of_rows(reader: csv.DictReader[str], path: Path) -> Iterator[Case]:
    reader.fieldnames = [column.strip().casefold() for column in reader.fieldnames or ()]
    missing = [column for column in COLUMNS if column not in reader.fieldnames]
    if missing:
        raise InputError(f"{path} has no column '{missing[0]}'; expected a first line with {','.join(COLUMNS)}.")
    twice = [column for column in (*COLUMNS, SERIES_COLUMN) if reader.fieldnames.count(column) > 1]
    if twice:
        raise InputError(
            f"{path} has several columns called '{twice[0]}', with capitals or without; expected one. Rename the others."
        )
    folder = path.resolve().parent
    for row in reader:
        if not any("".join(value or "") for value in row.values()):
            continue  # A line of separators only, which spreadsheets write for a cleared line.
        name, volume, annotations = ((row[column] or "").strip() for column in COLUMNS)
        if not (name and volume and annotations) or "\0" in volume + annotations:
            raise InputError(f"{path}, line {reader.line_num}: a case needs a name, a volume and annotations; got {row}.")
        # Joining keeps absolute paths unchanged.
        scan, points = (folder / spelled_out(Path(text)) for text in (volume, annotations))
        yield Case(name, scan, points, (row.get(SERIES_COLUMN) or "").strip() or None)


def _cases_in_folder(folder: Path) -> Iterator[Case]:
    volumes: dict[str, list[Path]] = {}
    visible = [path for path in sorted(folder.iterdir()) if not _is_hidden(path)]
    for path in visible:
        if path.is_dir():
            inside = _points_in(path)
            beside = [points for points in visible if points.name == f"{path.name}{ANNOTATIONS_ENDING}"]
            if len(inside) + len(beside) > 1:
                listing = ", ".join(str(points) for points in (*inside, *beside))
                raise InputError(
                    f"The folder {path} has several annotations files: {listing}. Leave one of them, or list "
                    "the cases in a CSV file."
                )
            if beside:
                volumes.setdefault(path.name, []).append(path)
            elif inside:
                yield Case(path.name, path, inside[0])
            elif _holds_series(path):
                volumes.setdefault(path.name, []).append(path)
        elif path.is_file() and (ending := volume_ending(path)):
            volumes.setdefault(path.name[: -len(ending)], []).append(path)
    for points in (path for path in visible if path.name.endswith(ANNOTATIONS_ENDING)):
        name = points.name[: -len(ANNOTATIONS_ENDING)]
        found = volumes.pop(name, [])
        if len(found) != 1:
            listing = f"found {', '.join(path.name for path in found)}" if found else f"found none called {name}"
            raise InputError(
                f"{points} needs one volume beside it, ending in {', '.join(VOLUME_ENDINGS)}, or one folder of that name; "
                f"{listing}. Move what does not belong, or list the cases in a CSV file."
            )
        yield Case(name, found[0], points)
    if volumes:
        logger.warning("%s: left out, without an annotations file: %s", folder, ", ".join(sorted(volumes)))


def _is_hidden(path: Path) -> bool:
    """Whether a path is ignored in the search for cases.

    Macs put a file with the prefix `._` beside each file that they copy to a shared disk.
    """
    return path.name.startswith(".") or path.name.lower() in FOLDERS_OF_SYSTEMS


def _holds_series(folder: Path) -> bool:
    """Whether a folder or one below has DICOM files; false for a folder that cannot be searched."""
    try:
        return holds_dicom(folder)
    except InputError:
        return False


def _points_in(folder: Path) -> list[Path]:
    """The annotations files in a folder of DICOM files, whatever name the volume had when they were saved.

    An annotations file beside a volume of its name belongs to that volume, which is another case.
    """
    files = sorted(path for path in folder.iterdir() if path.is_file() and not _is_hidden(path))
    volumes = {path.name[: -len(ending)] for path in files if (ending := volume_ending(path))}
    named = [path for path in files if path.name.endswith(ANNOTATIONS_ENDING)]
    others = [path for path in named if path.name[: -len(ANNOTATIONS_ENDING)] not in volumes]
    return [*(path for path in files if path.name == FOLDER_ANNOTATIONS), *others]


def _check_names(cases: list[Case], source: Path) -> None:
    seen: dict[str, str] = {}
    for case in cases:
        # Many file systems do not distinguish upper and lower case, or composed and decomposed accents.
        key = unicodedata.normalize("NFKC", case.name).casefold()
        if key in seen:
            raise InputError(
                f"{source} has two cases that would be written to one file: '{seen[key]}' and '{case.name}'. "
                "Give each a name of its own."
            )
        seen[key] = case.name
