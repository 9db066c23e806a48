"""The files that a benchmark leaves: what was measured for programs, and tables and pictures of it for people."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ViTTransferFunction.Logic.core.system.atomic_file import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = 64
"""Every version of a picture stays in the repository: with so few colours, they take less than half."""
WEBP_QUALITY = 75
"""At which outlines of one pixel are still sharp."""


def write_results(folder: Path, name: str, report: dict[str, Any], text: str) -> None:
    """Write NAME.json with all of a report and NAME.md with its text, and print the text."""
    write_text(folder / f"{name}.json", as_json(report))
    write_text(folder / f"{name}.md", text)
    print(text)


def as_json(report: dict[str, Any]) -> str:
    """One figure a line, but of `runs`, if there are any, one run a line: there are thousands of figures in them."""
    rest = json.dumps({key: value for key, value in report.items() if key != "runs"}, indent=1)
    if "runs" not in report:
        return f"{rest}\n"
    runs = ",\n".join(f"  {json.dumps(run)}" for run in report["runs"])
    return f'{rest[:-2]},\n "runs": [\n{runs}\n ]\n}}\n'


def write_text(path: Path, text: str) -> None:
    """Write a file that is there whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure, and close it: a plot to a PNG file of `COLORS` colours, slices to a WebP file, half as large."""
    import matplotlib.pyplot as plt
    from PIL import Image

    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=120)
    plt.close(figure)
    with replacing(path) as temporary, Image.open(drawn) as image:
        plain = image.convert("RGB")
        if path.suffix == ".webp":
            plain.save(temporary, "WEBP", quality=WEBP_QUALITY, method=6)
        else:
            plain.quantize(COLORS, dither=Image.Dither.NONE).save(temporary, "PNG", optimize=True)
