"""Runs the module's self-test inside Slicer, and says how that went by a last line of its own.

    Slicer --testing --no-splash --additional-module-paths ViTTransferFunction \
           --python-script ViTTransferFunction/Testing/run_in_slicer.py

Slicer's exit code also tells of errors in other modules and of crashes on the way out, so whoever starts this goes by that
line: where it is missing, the test did not get that far. The file that VITTF_SELF_TEST_LOG names takes the place of the
console, which Slicer does not have on Windows.
"""

from __future__ import annotations

import os
import sys
import unittest
from contextlib import nullcontext
from pathlib import Path


def main() -> None:
    """Run the self-test and write what happened, the verdict last."""
    log = os.environ.get("VITTF_SELF_TEST_LOG")
    with Path(log).open("w", encoding="utf-8") if log else nullcontext(sys.stdout) as stream:
        # Imported here and not by name at the top: an error in there belongs in the log like any other.
        suite = unittest.defaultTestLoader.loadTestsFromName("ViTTransferFunction.ViTTransferFunctionTest")
        result = unittest.TextTestRunner(stream, verbosity=2).run(suite)
        stream.write(f"VITTF SELF-TEST {_verdict(result)}\n")


def _verdict(result: unittest.TestResult) -> str:
    if not result.wasSuccessful() or not result.testsRun:
        return "FAILED"
    return f"SKIPPED: {result.skipped[0][1]}" if result.skipped else "PASSED"


if __name__ == "__main__":
    main()
