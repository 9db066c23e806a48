"""What DICOM files hold that is no scan, though ITK may make a volume of it: segmentations, doses, films, mosaics, raw SPECT.

Everything would run on such a volume, and nothing of it would mean anything. What a file is, its SOP class says (DICOM PS3.4,
B.5), which stands at its beginning, in elements of explicit types whatever follows.
"""

from __future__ import annotations

import re
from pathlib import Path

import SimpleITK as sitk  # noqa: N813

from .file_start import read_start

_START_BYTES = 4096
"""Behind the SOP class in these are a few identifiers at most."""

_CLASS = re.compile(rb"\x02\x00\x02\x00UI(..)([0-9.]+)", re.DOTALL)
_STORAGE = "1.2.840.10008.5.1.4.1.1."

_SCAN_OF_IT = "expected the scan that it is of. Name the folder with the slices of that."
_SCAN = "expected a scan. Name the folder with its slices."

_BY_CLASS = {
    "1.2.840.10008.1.3.10": f"the directory of a disk (DICOMDIR); {_SCAN}",
    f"{_STORAGE}9.": f"a recording of signals; {_SCAN}",
    f"{_STORAGE}11.": f"a note of how other images are shown; {_SCAN}",
    f"{_STORAGE}66": f"raw data of a scanner; {_SCAN}",
    f"{_STORAGE}66.4": f"a segmentation; {_SCAN_OF_IT}",
    f"{_STORAGE}66.5": f"a segmentation; {_SCAN_OF_IT}",
    f"{_STORAGE}66.7": f"a segmentation; {_SCAN_OF_IT}",
    f"{_STORAGE}66.": f"a note about other images; {_SCAN}",
    f"{_STORAGE}77.1.6": f"a picture of a microscope's slide, cut into tiles; {_SCAN}",
    f"{_STORAGE}88.": f"a report; {_SCAN}",
    f"{_STORAGE}104.": f"a document; {_SCAN}",
    f"{_STORAGE}481.2": f"the dose of a radiotherapy; {_SCAN_OF_IT}",
    f"{_STORAGE}481.3": f"a set of outlines, of a radiotherapy; {_SCAN_OF_IT}",
    f"{_STORAGE}481.": f"a part of the plan or course of a radiotherapy; {_SCAN_OF_IT}",
}
"""By SOP class, or by its beginning up to a dot; what fits first counts."""

_GAMMA_CAMERA = f"{_STORAGE}20"
_NOT_RECONSTRUCTED = re.compile(rb"\\(STATIC|WHOLE BODY|DYNAMIC|GATED|TOMO|GATED TOMO|RECON GATED TOMO)\\")
"""In the image type: all but what is one volume (DICOM PS3.3, C.8.4.9.1.1.3)."""

_MOSAIC_TYPES = {"MOSAIC", "VFRAME"}
"""Values of the image type, of Siemens and of United Imaging."""
_FRAME_TIMES = ("(0018,1063)", "(0018,1065)")
"""Elements that frames follow each other by, where they are moments."""


def instead_of_scan(path: Path, header: sitk.ImageFileReader | None = None) -> str:
    """What a DICOM file is instead of a scan, what was expected and what to do.

    It is the end of a sentence that begins with the file and "is"; "" where it may be a scan.

    Args:
        path: of the file.
        header: ITK's, which has read it; None: it cannot.

    Raises:
        InputError: the file cannot be read.
    """
    start = read_start(path, _START_BYTES)
    found = _CLASS.search(start)
    sop_class = found[2].decode() if found else ""
    fits = (told for key, told in _BY_CLASS.items() if sop_class == key or (key[-1] == "." and sop_class.startswith(key)))
    told = next(fits, "") or (_of_gamma_camera(start) if sop_class == _GAMMA_CAMERA else "")
    return told or ("" if header is None else _by_header(header))


def _of_gamma_camera(start: bytes) -> str:
    kind = _NOT_RECONSTRUCTED.search(start)
    if kind is None:
        return ""
    if kind[1].startswith(b"RECON"):
        return "several volumes of a heartbeat, one after the other; expected one. Export one of them, or their sum, alone."
    return f"a set of pictures of a gamma camera, from which a scan is reconstructed; {_SCAN}"


def _by_header(header: sitk.ImageFileReader) -> str:
    if _MOSAIC_TYPES.intersection(_value(header, "0008|0008").split("\\")):
        return (
            "of mosaics, pictures with all slices of a volume side by side; expected a picture for each slice. Convert it to "
            "NIfTI, by dcm2niix say, and save one time point alone."
        )
    # Cone-beam CTs of some makers have their slices follow each other in milliseconds.
    in_time = _value(header, "0028|0009") in _FRAME_TIMES and _value(header, "0008|0060") != "CT"
    if in_time and header.GetSize()[2] > 1:
        return f"a film, whose pictures follow each other in time; {_SCAN}"
    return ""


def _value(header: sitk.ImageFileReader, tag: str) -> str:
    return header.GetMetaData(tag).strip() if header.HasMetaDataKey(tag) else ""
