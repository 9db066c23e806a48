"""Small structures that begin with an outline: `python dev.py bench small_structures --volumes DIR [--paths N] [--cases …]`.

Each structure is annotated alone, on several paths: an outline as in `bench gestures`, then clicks on what is wrong, once in
the whole scan, and once with a close-up as soon as the outline is answered. Which of both panel, app and `vittf` choose, the
agreement of outline and whole scan says (`unasked_close_up`). Measured are outlines that are small for the cells, drawn in a
slice that shows much of the structure; and, since people may do that as well, in one that shows a third of its largest area or
less, as near the pole of an organ. Of a structure that has several large parts, as both sides of a brain have, one is meant.

What lies in DIR as `NAME.seg.nrrd` with its scan is measured as well. With `--keep`, what was measured is kept in a folder and
not measured again. Writes `small_structures.json` and `small_structures.md`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from Benchmarks.accuracy.runs import run_with_own_clicks
from Benchmarks.close_up.looking_user import LookingUser, shown_maps
from Benchmarks.own_scans.own_scan import asked_and_own
from Benchmarks.shared.aim import Aim, persons_aims
from Benchmarks.shared.arguments import scan_parser, weights_of
from Benchmarks.shared.drawn_gestures import drawn_outline, outline_mm
from Benchmarks.shared.every_structure import EVERY_STRUCTURE
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume, classes_of
from Benchmarks.shared.machine import machine
from Benchmarks.shared.regions import largest_component
from Benchmarks.shared.simulated_clicker import Gesture
from Benchmarks.small_structures.report import CLOSELY, MUCH, SLICES, WAYS, write_report
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Logic.core.classes.small_outlines import agreement, is_small, reach_mm
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.features.settings import grid_shape
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.sources import WeightsFile

PATHS = 2
FIRST_PATH = 1
ROUNDS = 3
LITTLE_AREAS = (0.05, 0.35)
"""Of its largest area, what a slice shows that shows little of a structure."""
ALIKE = 0.25
"""A structure whose second part has more than so much of the first one's voxels has several large parts."""

Run = dict[str, Any]


def main() -> None:
    """Measure on every case, and write what was measured."""
    parser = scan_parser(__doc__, [case.name for case in EVERY_STRUCTURE], cases=EVERY_STRUCTURE)
    parser.add_argument("--paths", type=int, default=PATHS, help=f"paths of clicks on a structure (default {PATHS})")
    options = parser.parse_args()
    cases = asked_and_own(EVERY_STRUCTURE, options)
    weights, kept = weights_of(options), KeptResults(options.keep)
    runs: list[Run] = []
    for case in cases:
        labelled = case.read(options.volumes)
        name = f"small structures, {case.name}, {options.paths} paths, {ROUNDS} rounds"
        measured = kept.get(name, partial(_measure, labelled, weights, options.paths))
        runs += [{"case": case.name, **run} for run in measured["runs"]]
    write_report({"model": weights.model.name, "machine": machine(), "paths": options.paths, "runs": runs}, options.results)


def _measure(labelled: LabelledVolume, weights: WeightsFile, paths: int) -> dict[str, Any]:
    """All small outlines of one labelled volume. Nothing is computed where there are none."""
    drawn = list(_small_outlines(labelled, paths))
    if not drawn:
        return {"runs": []}
    settings = SessionSettings(model=weights.model.name, weights_path=str(weights.path))
    with tempfile.TemporaryDirectory() as cache:
        session = open_session(labelled.volume, settings, FeatureCache(Path(cache)))
        session.load_features()
        return {"runs": [_run(session, *of_one) for of_one in drawn]}


def _small_outlines(labelled: LabelledVolume, paths: int) -> Iterator[tuple[Run, LabelledVolume, Gesture, np.ndarray, Aim]]:
    """What to say of an outline; the structure alone; the outline's points; itself, RAS millimetres; and where one clicks."""
    for index, name in enumerate(labelled.names):
        alone = _meant(labelled.alone(index))
        for shows in SLICES:
            structure = alone.truth == 1 if shows == MUCH else _little(alone.truth == 1)
            for path in range(FIRST_PATH, FIRST_PATH + paths) if structure.any() else ():
                outline = outline_mm(structure, labelled.spacing_mm, path, index + 1)
                clicks = drawn_outline(structure, labelled.spacing_mm, path, index + 1)
                if outline is None or not clicks or not clicks[0].positive:
                    continue
                geometry = labelled.volume.geometry
                outline_ras = geometry.ijk_to_ras_points(outline[:, ::-1] / geometry.spacing_mm)
                if is_small(np.concatenate(points_of_outline(outline_ras, geometry.body_scale)), _cell_mm(labelled)):
                    said: Run = {"structure": name, "slice": shows, "path": path}
                    yield said, alone, clicks, outline_ras, persons_aims(path, len(labelled.names))[index]


def _run(
    session: SegmentationSession, said: Run, alone: LabelledVolume, clicks: Gesture, outline_ras: np.ndarray, aim: Aim
) -> Run:
    """Both ways of one outline."""
    print(", ".join(map(str, said.values())), flush=True)
    (shown,) = shown_maps(session, classes_of(alone.names, [clicks], alone.volume.geometry))
    run = {**said, "agreement": round(agreement(shown, outline_ras), 3)}
    for way in WAYS:
        user = LookingUser(
            session, alone.names if way == CLOSELY else (), reach_mm(outline_ras, session.volume.geometry.body_scale)
        )
        rounds, _ = run_with_own_clicks(alone, user, ROUNDS, True, [aim], [[clicks]])
        run[way] = {count: structures[alone.names[0]]["dice"] for count, structures in rounds.items()}
    return run


def _meant(alone: LabelledVolume) -> LabelledVolume:
    """A structure, or the largest of its parts where it has several large ones."""
    components, _ = ndimage.label(alone.truth)
    sizes = np.sort(np.bincount(components.ravel())[1:])
    if len(sizes) < 2 or sizes[-2] <= ALIKE * sizes[-1]:
        return alone
    return replace(alone, truth=largest_component(alone.truth == 1).astype(alone.truth.dtype))


def _little(structure: np.ndarray) -> np.ndarray:
    """What slices show of a structure (K, J, I) that show little of it."""
    areas = structure.sum(axis=(1, 2))
    least, most = LITTLE_AREAS
    shows_little = (areas >= least * areas.max()) & (areas <= most * areas.max())
    return structure & shows_little[:, None, None]


def _cell_mm(labelled: LabelledVolume) -> float:
    geometry = labelled.volume.geometry
    return float(geometry.resized(grid_shape(geometry, PRESETS[DEFAULT_PRESET].features)).spacing_mm.max())


if __name__ == "__main__":
    main()
