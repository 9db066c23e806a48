"""What has to hold after every case: done with a whole and valid result, or refused in one sentence; all else as it was."""

from __future__ import annotations

import gzip
import hashlib
import json
import os
import re
import stat
import zlib
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import SimpleITK as sitk  # noqa: N813
import slicerio

from ViTTransferFunction.CommandLine.library_output import silenced_libraries
from ViTTransferFunction.Testing.attack.calls import Call, Outcome
from ViTTransferFunction.Testing.attack.cases import INPUT_OPTIONS, OUTPUT_OPTIONS, Case, Place, Step
from ViTTransferFunction.Testing.attack.scans import NIFTI_HEADER, Scan

LONGEST_SENTENCE = 1500
REFUSED, INTERRUPTED, TERMINATED = 2, 130, 143
"""Exit codes."""
_PROGRESS = re.compile(r"^[^|]*\d+%\|[^|]*\|[^\[\]]*\[[^\]]*\] ?|^\d+it \[[^\]]*\] ?")
_OURS = re.compile(r"^WARNING: (?!In )|^[A-Z].*\.\.\.$")
"""Warnings, and what is being done, which `ProgressBar` names."""
_JARGON = re.compile(r"0x[0-9a-f]{6,}|\.[ch]xx|object at |\.writing-|<class ")

OF_LIBRARIES = (".cache", ".config")
"""Matplotlib and the system's fonts keep their own cache in a user's home."""

Snapshot = dict[Path, str]


def snapshot(folder: Path) -> Snapshot:
    """Everything in a folder: what it is, and a digest of its content."""
    found = {}
    for root, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(root, name)
            found[path] = _described(path)
    return found


def _described(path: Path) -> str:
    status = path.lstat()
    if stat.S_ISLNK(status.st_mode):
        return f"link to {path.readlink()}"
    if stat.S_ISREG(status.st_mode):
        return f"file {hashlib.sha256(path.read_bytes()).hexdigest()}"
    return {stat.S_IFDIR: "folder", stat.S_IFIFO: "pipe"}.get(stat.S_IFMT(status.st_mode), "device")


def violations(case: Case, step: Step, outcomes: Sequence[Outcome], place: Place, before: Snapshot) -> list[str]:
    """What is wrong after a step; empty where all is well.

    Args:
        case: the case.
        step: the step that was just made.
        outcomes: of its calls.
        place: the case's folder.
        before: what was there before the step.
    """
    wrong = [fault for call, outcome in zip(step.calls, outcomes, strict=True) for fault in _said_wrong(call, outcome, step)]
    killed = any(outcome.code == -9 for outcome in outcomes)
    wrong += _changed_wrongly(step, outcomes, snapshot(place.work), before, killed)
    for call, outcome in zip(step.calls, outcomes, strict=True):
        if outcome.code == 0 and call.program == "vittf":
            wrong += _results_wrong(call, case.scan)
    if not killed:
        done = [call for call, outcome in zip(step.calls, outcomes, strict=True) if outcome.code == 0]
        asked_for = {path for call in done for path in outputs(call)}
        left = [path for folder in (place.home, place.temporary) for path in folder.iterdir() if not _is_of(path, asked_for)]
        wrong += [f"left in {path.parent.name}: {path.name}" for path in left if path.name not in OF_LIBRARIES]
    return wrong


def _said_wrong(call: Call, outcome: Outcome, step: Step) -> list[str]:
    if outcome.hung:
        return ["it hangs"]
    allowed = step.codes
    if call.signal_name:
        # Asked to end before it listens, it is gone at once; whether it leaves something is looked at elsewhere.
        allowed |= {"SIGKILL": {-9}, "SIGINT": {INTERRUPTED}, "SIGTERM": {TERMINATED, -15}}[call.signal_name]
    wrong = [] if outcome.code in allowed else [f"{outcome}, expected {' or '.join(map(str, sorted(allowed)))}"]
    return wrong if call.program == "compute" else [*wrong, *_lines_wrong(said(outcome.stderr), outcome.code)]


def _lines_wrong(lines: Sequence[str], code: int) -> list[str]:
    """One failure for an error stream that says anything but our own warnings and, where it is due, one sentence."""
    if any("Traceback" in line for line in lines):
        return [f"a traceback: {lines[-1][:200]}"]
    if lines and lines[0].startswith("usage: "):
        # Python's own parser of arguments says how the command is used, and then what is wrong.
        return [] if code == REFUSED and re.match(r"vittf.*: error: ", lines[-1]) else [f"says {lines[-1][:200]!r}"]
    sentences = [line for line in lines if not _OURS.match(line)]
    if code in (INTERRUPTED, TERMINATED):
        return [] if len(sentences) == 1 else [f"says {len(sentences)} lines, expected one"]
    if code != REFUSED:
        return [f"says {len(sentences)} lines, such as {sentences[0][:200]!r}"] if sentences else []
    others = [line for line in sentences if not line.startswith("error: ")]
    if len(sentences) != 1 or others:
        return [f"says {len(sentences)} lines, expected 'error: …' alone: {' / '.join(line[:150] for line in others[:2])}"]
    if _JARGON.search(sentences[0]):
        return [f"says {sentences[0][:300]!r}"]
    return [f"says a sentence of {len(sentences[0])} characters"] if len(sentences[0]) > LONGEST_SENTENCE else []


def said(stderr: str) -> list[str]:
    """The lines of an error stream, without progress bars."""
    lines = (_PROGRESS.sub("", line) for line in re.split(r"[\r\n]+", stderr))
    return [line for line in lines if line.strip()]


def option(call: Call, *names: str) -> list[str]:
    """The values of an option, in which the user's home is spelled out, as `vittf` does it."""
    given, home = call.arguments, call.environment.get("HOME", "~")
    values = [given[at + 1] for at, argument in enumerate(given[:-1]) if argument in names]
    return [home + value[1:] if value == "~" or value.startswith("~/") else value for value in values]


def outputs(call: Call) -> set[Path]:
    """What a run may write; folders stand for what is in them."""
    folder = Path(call.folder)
    named = {folder / value for value in option(call, *OUTPUT_OPTIONS)}
    if call.arguments[:1] == ("render",) and not option(call, "--3d"):
        slices = [folder / value for value in option(call, "-o", "--output")]
        named |= {path.with_name(f"{path.stem}_3d{path.suffix}") for path in slices}
    return named


def inputs(call: Call) -> set[Path]:
    """What a run reads."""
    folder, positional = Path(call.folder), [value for value in call.arguments[1:3] if not value.startswith("-")]
    named = [value.partition("=")[2] or value for value in option(call, *INPUT_OPTIONS)]
    return {folder / value for value in (*positional, *named)}


def _changed_wrongly(step: Step, outcomes: Sequence[Outcome], after: Snapshot, before: Snapshot, killed: bool) -> list[str]:
    if any(call.program == "compute" for call in step.calls):
        return []
    of_inputs = {_real(path) for call in step.calls for path in inputs(call)}
    allowed = {path for call in step.calls for path in outputs(call)}
    done = any(outcome.code == 0 or call.signal_name for call, outcome in zip(step.calls, outcomes, strict=True))
    wrong = []
    for path in sorted(before.keys() | after.keys()):
        if before.get(path) == after.get(path):
            continue
        if path in before and _real(path) in of_inputs:
            wrong.append(f"changed its input {path.name}")
        elif path not in after:
            wrong.append(f"removed {path.name}")
        elif path.name.startswith(".writing-"):
            wrong += [] if killed else [f"left {path.name}"]
        elif not _is_of(path, allowed):
            wrong.append(f"{'changed' if path in before else 'left'} {path.name}")
        elif not done and after[path] != "folder" and not (step.late and _is_whole(path)):
            wrong.append(f"{'changed' if path in before else 'left'} its output {path.name} though it refused")
    return wrong


def _is_whole(path: Path) -> bool:
    """Whether a result can be read to its end."""
    try:
        if path.suffix == ".json":
            json.loads(path.read_text())
        else:
            _read_whole(path)
    except (OSError, ValueError, RuntimeError, EOFError, zlib.error):
        return False
    return True


def _read_whole(path: Path) -> None:
    """Read an image; ITK takes missing voxels of some formats for zeros, which their length tells."""
    array = label_map(path)
    if path.name.lower().endswith((".nii", ".nii.gz")):
        content = gzip.decompress(path.read_bytes()) if path.suffix.lower() == ".gz" else path.read_bytes()
        if len(content) < array.nbytes + NIFTI_HEADER.itemsize:
            raise ValueError(f"{path.name} is cut off")


def _is_of(path: Path, outputs: set[Path]) -> bool:
    """Whether it is an output, in one, or a folder that leads to one."""
    return any(
        os.path.normpath(path) == os.path.normpath(output) or output in path.parents or path in output.parents
        for output in outputs
    )


def _real(path: Path) -> str:
    try:
        return os.path.realpath(path)
    except (OSError, ValueError):
        return str(path)


def _results_wrong(call: Call, scan: Scan | None) -> list[str]:
    command, folder = call.arguments[0], Path(call.folder)
    if "--help" in call.arguments:
        return []
    try:
        if command == "segment":
            path = folder / option(call, "-o", "--output")[-1]
            for report in option(call, "--report")[-1:]:
                json.loads((folder / report).read_text())
            others = {folder / name for name in option(call, "-o", "--output", "--report")}
            for maps in option(call, "--similarity-dir")[-1:]:
                for path_of_map in {*(folder / maps).glob("*.nii.gz")} - others:
                    _check_map(path_of_map)
            _read_whole(path)
            return _labels_wrong(path, scan or _scan_of(folder / call.arguments[1]))
        if command == "render":
            pictures = [path for path in outputs(call) if path.suffix.lower() == ".png"]
            return [f"{path.name} is no PNG" for path in pictures if not path.read_bytes().startswith(b"\x89PNG")]
    except (OSError, ValueError, RuntimeError, EOFError, IndexError, KeyError, zlib.error) as error:
        return [f"its result cannot be read: {str(error).strip().splitlines()[-1]}"]
    return []


def _check_map(path: Path) -> None:
    array = sitk.GetArrayFromImage(sitk.ReadImage(str(path)))
    if not (array.min() >= 0.0 and array.max() <= 1.0):
        raise ValueError(f"{path.name} is from {array.min()} to {array.max()}")


def _labels_wrong(path: Path, scan: Scan | None) -> list[str]:
    image = read_image(path)
    array = sitk.GetArrayFromImage(image)
    wrong = []
    if array.dtype not in (np.uint8, np.uint16):
        wrong.append(f"labels are {array.dtype}")
    if path.name.lower().endswith(".seg.nrrd"):
        segments = slicerio.read_segmentation(str(path))["segments"]
        if int(array.max()) > len(segments):
            wrong.append(f"label {array.max()} of {len(segments)} segments")
    if scan is not None:
        wrong += _grid_wrong(image, scan)
    return wrong


def _grid_wrong(image: sitk.Image, scan: Scan) -> list[str]:
    if image.GetSize() != scan.array.shape[::-1]:
        return [f"labels are {image.GetSize()}, the volume {scan.array.shape[::-1]}"]
    matrix = np.array(image.GetDirection()).reshape(3, 3) * image.GetSpacing()
    wanted = scan.direction * scan.spacing
    near = np.allclose(image.GetOrigin(), scan.origin, rtol=1e-5, atol=1e-3)
    if near and np.allclose(matrix, wanted, rtol=0.0, atol=1e-4 * scan.spacing.max()):
        return []
    return ["labels lie elsewhere than the volume"]


def _scan_of(path: Path) -> Scan | None:
    """The volume as SimpleITK reads it; None where that needs more than a file, or slices at a slant are put straight."""
    if not path.is_file():
        return None
    image = read_image(path)
    direction = np.array(image.GetDirection()).reshape(3, 3)
    if not np.allclose(direction.T @ direction, np.eye(3), atol=1e-3):
        return None
    return Scan(
        sitk.GetArrayFromImage(image), np.array(image.GetSpacing()), direction, np.array(image.GetOrigin()), ([0] * 3, [0] * 3)
    )


def read_image(path: Path) -> sitk.Image:
    """Read an image, in silence. ITK knows few endings in upper case, and its Python ends at names that are no text."""
    # Whatever needs a second file is read where it lies.
    by_link = path.suffix.lower() in (".nii", ".gz") or path.suffix != path.suffix.lower() or not str(path).isprintable()
    with silenced_libraries(), TemporaryDirectory() as folder:
        link = Path(folder, f"image{''.join(path.suffixes[-2:]).lower()}")
        link.symlink_to(path.absolute())
        return sitk.ReadImage(str(link if by_link else path))


def label_map(path: Path) -> np.ndarray:
    """Labels (K, J, I) of a file."""
    return sitk.GetArrayFromImage(read_image(path))
