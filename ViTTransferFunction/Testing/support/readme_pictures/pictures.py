"""What is to be seen on each picture: the opening, three clicks that move, and the steps of the two tutorials."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from Benchmarks.shared.segmentation_metrics import dice
from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Testing.support.readme_pictures.animation import Animation
from ViTTransferFunction.Testing.support.readme_pictures.composition import captioned, column, row, save_small
from ViTTransferFunction.Testing.support.readme_pictures.desk import Desk
from ViTTransferFunction.Testing.support.readme_pictures.exhibits import ANNOTATIONS
from ViTTransferFunction.Testing.support.readme_pictures.scans import ABDOMEN_CT, BRAIN, TORSO, Scan
from ViTTransferFunction.Testing.support.scenes import segment_masks

VIEW = 475
PANEL_HEIGHT = 2 * VIEW + 2
STEP_VIEW = 400
TURNS = 16
START = -0.3
CLICKS_LOOK = replace(ABDOMEN_CT.look, width_mm=360.0, centre_3d_ras=(8.0, -245.0, 1150.0), height_3d_mm=300.0)
CLOSER_LOOK = replace(
    ABDOMEN_CT.look, centre_ras=(30.0, -250.0, 1115.0), width_mm=220.0, centre_3d_ras=(30.0, -250.0, 1120.0), height_3d_mm=260.0
)
DIAMETER_LOOK = replace(ABDOMEN_CT.look, centre_ras=(78.0, -222.0, 1130.0), width_mm=150.0)
GALLBLADDER_CLICK = (79.0, -231.0, 1130.0)
GALLBLADDER_ENDS = ((68.5, -239.0, 1130.0), (86.5, -211.0, 1130.0))
OUTLINE_LOOK = replace(BRAIN.look, centre_ras=(0.0, -60.0, -34.0), width_mm=150.0)
CEREBELLUM_CLICK = (-27.0, -65.0, -34.0)
CEREBELLUM_OUTLINE = tuple(
    (float(right), float(anterior), -34.0)
    for right, anterior in (
        (17, -25), (13, -42), (0, -47), (-13, -42), (-17, -25), (-34, -31), (-50, -43), (-57, -60), (-50, -75), (-36, -88),
        (-22, -94), (-6, -90), (0, -80), (6, -90), (22, -94), (36, -88), (50, -75), (57, -60), (50, -43), (34, -31), (18, -26),
    )
)  # fmt: skip

Dice = dict[str, float]


def opening(data: Path, out: Path) -> Dice:
    """The panel and four views with six organs."""
    desk, classes = _ready_desk(ABDOMEN_CT, "amos_0336.json", data)
    desk.annotate(classes)
    desk.session.select_class(desk.session.classes[0].id)
    desk.look_at(classes[0].request.positive[0])
    desk.settle()
    save_small(_panel_and_views(desk), out / "module.webp")
    return _finish(desk, ABDOMEN_CT, data)


def three_clicks(data: Path, out: Path) -> Dice:
    """Three organs, one click each, as they happen."""
    desk, classes = _ready_desk(ABDOMEN_CT, "amos_0336_three_clicks.json", data)
    desk.look = CLICKS_LOOK
    desk.look_at(classes[0].request.positive[0])
    size = STEP_VIEW
    animation = Animation(pointer=(size * 0.55, size * 0.9))

    def frame(text: str) -> np.ndarray:
        return captioned(text, row(desk.view("axial", size, size), desk.view("3d", size, size)))

    animation.show(frame("Three clicks on an abdominal CT"), 1200)
    for number, given in enumerate(classes, start=1):
        text = f"Click {number}: {given.name}"
        place = given.request.positive[0]
        id_ = desk.add_structure(given)
        desk.settle()
        before = frame(text)
        x, y = desk.place_in_view("axial", size, size, place)
        target = x, y + len(before) - size
        animation.move(before, target)
        animation.click(before)
        desk.click(id_, place, positive=True)
        desk.wait_for_overlay(id_)
        animation.show(frame(text), 400)
        desk.settle()
        animation.show(frame(text), 1300)
    for turn in np.linspace(0.0, 2.0 * np.pi, TURNS + 1)[1:]:
        desk.look = replace(desk.look, from_ras=(np.sin(turn + START), np.cos(turn + START), 0.1))
        animation.show(frame("Three organs, one click each"), 120)
    animation.show(frame("Three organs, one click each"), 2500)
    animation.save(out / "three_clicks.webp")
    return _finish(desk, ABDOMEN_CT, data)


def closer_look(data: Path, out: Path) -> Dice:
    """Three structures that are small or thin, one click each: in the whole scan, and looked at closely."""
    desk, classes = _ready_desk(ABDOMEN_CT, "amos_0336_closer.json", data)
    desk.look = CLOSER_LOOK
    desk.annotate(classes)
    desk.look_at(classes[1].request.positive[0])
    desk.settle()
    size = STEP_VIEW
    before = captioned("One or two clicks each", column(desk.view("coronal", size, size), desk.view("3d", size, size)))
    for state in desk.session.classes:
        desk.session.close_ups.look_closer(state.id)
    desk.settle()
    # Once more, as the README says: by now its box is far too large.
    desk.session.close_ups.look_closer(desk.session.classes[1].id)
    desk.settle()
    after = captioned(
        "The same clicks, looked at closely", column(desk.view("coronal", size, size), desk.view("3d", size, size))
    )
    save_small(row(before, after), out / "closer_look.webp")
    return _finish(desk, ABDOMEN_CT, data)


def outline(data: Path, out: Path) -> Dice:
    """A cerebellum by one click, and by a line dragged around it."""
    desk, (*_, cerebellum) = _ready_desk(BRAIN, "brain_mr.json", data)
    desk.look = OUTLINE_LOOK
    draw = partial(desk.drag_outline, outline_ras=CEREBELLUM_OUTLINE)
    _click_or_draw(desk, cerebellum, CEREBELLUM_CLICK, "its outline, dragged around", draw, out / "outline.webp")
    return _finish(desk, BRAIN, data)


def diameter(data: Path, out: Path) -> Dice:
    """A gallbladder by one click, and by a line dragged across it."""
    desk, (gallbladder, *_) = _ready_desk(ABDOMEN_CT, "amos_0336_closer.json", data)
    desk.look = DIAMETER_LOOK
    draw = partial(desk.drag_diameter, ends_ras=GALLBLADDER_ENDS)
    _click_or_draw(desk, gallbladder, GALLBLADDER_CLICK, "its diameter, dragged across", draw, out / "diameter.webp")
    return _finish(desk, ABDOMEN_CT, data)


def _click_or_draw(
    desk: Desk,
    given: AnnotatedClass,
    click_ras: Sequence[float],
    drawing: str,
    draw: Callable[[str, str, int, int], np.ndarray],
    path: Path,
) -> None:
    """Three axial views of a structure: what one click finds, how it is drawn instead, and what that finds."""
    view = ("axial", STEP_VIEW, STEP_VIEW)
    desk.look_at(click_ras)
    id_ = desk.add_structure(given)
    desk.click(id_, click_ras, positive=True)
    desk.settle()
    clicked = captioned("One click", desk.view(*view))
    desk.session.annotations.remove_last_point(id_)
    desk.settle()
    drawn = captioned(f"Instead: {drawing}", draw(id_, *view))
    desk.settle()
    save_small(row(clicked, drawn, captioned("What that finds", desk.view(*view))), path)


def estimate(data: Path, out: Path) -> Dice:
    """The tutorial's first step: the panel says what the features of the torso CT will cost."""
    with tempfile.TemporaryDirectory() as folder:
        # An empty cache, as the reader has it.
        os.environ["VITTF_CACHE"] = folder
        desk = Desk(TORSO.read(data), TORSO.look)
        desk.settle()
        desk.look_at((98.0, 164.0, 394.0))
        save_small(row(desk.panel(STEP_VIEW), desk.view("axial", STEP_VIEW, STEP_VIEW)), out / "ct_1_compute_features.webp")
        desk.close()
    return {}


def ct_tutorial(data: Path, out: Path) -> Dice:
    """The steps of the tutorial on the torso CT."""
    desk, classes = _ready_desk(TORSO, "torso_ct.json", data)
    liver, others = classes[0], classes[1:]
    first, *further = liver.request.positive
    id_ = desk.add_structure(liver)
    desk.click(id_, first, positive=True)
    desk.look_at(first)
    desk.settle()
    save_small(_views_in_a_row(desk), out / "ct_2_first_click.webp")
    for point in further:
        desk.click(id_, point, positive=True)
    desk.settle()
    save_small(_views_in_a_row(desk), out / "ct_3_liver.webp")
    desk.annotate(others)
    desk.look_at(others[2].request.positive[0])
    desk.settle()
    save_small(_panel_and_views(desk), out / "ct_4_all_structures.webp")
    desk.create_segments()
    desk.session.parameters.set("rendering", "off")
    desk.session.parameters.set("overlayVisible", False)
    desk.settle()
    save_small(_views_in_a_row(desk), out / "ct_5_segments.webp")
    return _finish(desk, TORSO, data)


def mr_tutorial(data: Path, out: Path) -> Dice:
    """The steps of the tutorial on the brain MR."""
    desk, classes = _ready_desk(BRAIN, "brain_mr.json", data)
    first, *others = classes
    desk.annotate([first])
    desk.look_at(first.request.positive[0])
    desk.settle()
    save_small(_views_in_a_row(desk), out / "mr_1_ventricles.webp")
    desk.annotate(others)
    desk.look_at(others[0].request.positive[0])
    desk.settle()
    save_small(_panel_and_views(desk), out / "mr_2_all_structures.webp")
    return _finish(desk, BRAIN, data)


def app(data: Path, out: Path) -> Dice:
    """The page with six organs."""
    from ViTTransferFunction.Testing.support.readme_pictures.app_picture import draw_app

    draw_app(data, out, ANNOTATIONS / "amos_0336.json")
    return {}


DRAWINGS: dict[str, Callable[[Path, Path], Dice]] = {
    "opening": opening,
    "clicks": three_clicks,
    "closer": closer_look,
    "outline": outline,
    "diameter": diameter,
    "estimate": estimate,
    "ct": ct_tutorial,
    "mr": mr_tutorial,
    "app": app,
}


def _ready_desk(scan: Scan, annotations: str, data: Path) -> tuple[Desk, Sequence[AnnotatedClass]]:
    """A desk with computed features, and what is to be annotated."""
    volume = scan.read(data)
    desk = Desk(volume, scan.look)
    desk.compute_features()
    return desk, read_annotations(ANNOTATIONS / annotations, volume.geometry)


def _panel_and_views(desk: Desk) -> np.ndarray:
    upper = row(desk.view("axial", VIEW, VIEW), desk.view("3d", VIEW, VIEW))
    lower = row(desk.view("coronal", VIEW, VIEW), desk.view("sagittal", VIEW, VIEW))
    return row(desk.panel(PANEL_HEIGHT), column(upper, lower))


def _views_in_a_row(desk: Desk) -> np.ndarray:
    return row(*(desk.view(name, STEP_VIEW, STEP_VIEW) for name in ("axial", "coronal", "3d")))


def _finish(desk: Desk, scan: Scan, data: Path) -> Dice:
    """How well the segments agree with the labels that come with the scan."""
    segmentation = desk.session.parameters.segmentation or desk.create_segments()
    masks = segment_masks(segmentation, desk.session.parameters.volume)
    desk.close()
    return {name: round(dice(masks[name], truth), 2) for name, truth in scan.truth(data).items() if name in masks}
