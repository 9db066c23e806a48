"""Draws the README's pictures: the module's panel, Slicer's own views of public scans, and the app, without a screen.

    python dev.py screenshots --data DIR

Scans that are missing in DIR are downloaded into it, but for the one of the opening picture and the animation, which
docs/RESULTS.md says how to get. Features are taken from the cache or computed. How well the segments on the pictures agree with
the labels of others, where DIR has these, goes into `dice.json`, and the README prints it.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

from ViTTransferFunction.Logic.core.system.atomic_file import replacing

SUBJECTS = ("opening", "clicks", "closer", "outline", "diameter", "estimate", "ct", "mr", "app")


def main() -> int:
    """Draw what is asked for; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with the scans, and labels of them")
    parser.add_argument("--out", type=Path, default=Path("Screenshots"), help="folder for the pictures")
    parser.add_argument("--only", choices=SUBJECTS, help="draw this alone")
    options = parser.parse_args()
    options.data.mkdir(parents=True, exist_ok=True)
    options.out.mkdir(parents=True, exist_ok=True)
    if options.only:
        draw(options.only, options.data, options.out)
        return 0
    # A process for each: an application has one scene.
    command = [sys.executable, "-m", __spec__.name, "--data", options.data, "--out", options.out, "--only"]
    return max(subprocess.run([*command, subject], check=False).returncode for subject in SUBJECTS)


def draw(subject: str, data: Path, out: Path) -> None:
    """Draw one subject's pictures, and note how good the segments on them are."""
    from ViTTransferFunction.Testing.support.readme_pictures.pictures import DRAWINGS

    agreement = DRAWINGS[subject](data, out)
    path = out / "dice.json"
    known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if agreement:
        known[subject] = agreement
        with replacing(path) as part:
            part.write_text(json.dumps(known, indent=2) + "\n", encoding="utf-8")
    print(subject, agreement or "(no labels to compare with)", flush=True)  # noqa: T201


if __name__ == "__main__":
    sys.exit(main())
