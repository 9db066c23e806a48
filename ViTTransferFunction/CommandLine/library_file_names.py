"""Names of files as libraries in C and C++ get them: in UTF-8."""

from __future__ import annotations

import locale
import sys
from contextlib import suppress


def take_utf8_file_names() -> None:
    """Have the C library take names of files for UTF-8 on Windows, too, as it does everywhere else.

    There it takes them for the code page of the user's language, unless it is told otherwise: SimpleITK, which hands it UTF-8
    for all formats but DICOM, finds nothing in the folders of a user called Jürgen, and neither does Slicer's scene. This is
    the way that SimpleITK's documentation names. Windows has it since 2018; an older one stays as it is.
    """
    if sys.platform == "win32":
        with suppress(locale.Error):
            locale.setlocale(locale.LC_CTYPE, ".utf8")
