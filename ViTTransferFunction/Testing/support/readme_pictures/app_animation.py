"""The app's animation in the README, of the pictures that the test on a real CT keeps of its steps.

VITTF_APP_PICTURES=DIR python dev.py test -k test_organs_of_a_ct
.venv/bin/python -m ViTTransferFunction.Testing.support.readme_pictures.app_animation DIR/test_real_volume OUT.gif
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from ViTTransferFunction.Testing.support.readme_pictures.animation import Animation

WIDTH = 960
STEP_MS = 1400
LAST_MS = 3500
LEFT_OUT = ("features", "end")
"""Steps at which nothing new is to be seen."""


def main(pictures: Path, out: Path) -> int:
    """Write the animation; returns the exit code."""
    steps = [path for path in sorted(pictures.glob("*.png")) if path.stem.partition(" ")[2] not in LEFT_OUT]
    frames = [_frame(path) for path in steps]
    animation = Animation(pointer=(0.3 * WIDTH, 0.5 * WIDTH))
    animation.show(frames[0], STEP_MS)
    for path, before, after in zip(steps[1:], frames, frames[1:], strict=False):
        clicked = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        if clicked:
            scale = WIDTH / Image.open(path).width
            animation.move(before, (scale * clicked[0], scale * clicked[1]))
            animation.click(before)
        animation.show(after, LAST_MS if after is frames[-1] else STEP_MS)
    animation.save(out)
    return 0


def _frame(path: Path) -> np.ndarray:
    picture = Image.open(path).convert("RGB")
    return np.asarray(picture.resize((WIDTH, round(picture.height * WIDTH / picture.width)), Image.Resampling.LANCZOS))


if __name__ == "__main__":
    sys.exit(main(*map(Path, sys.argv[1:])))
