"""The settings that the page has from the panel: what they do to the session, and that they can be used without a mouse."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

pytest.importorskip("trame_slicer")

from ViTTransferFunction.Logic.scene.mrml.transforms import numpy_matrix
from ViTTransferFunction.Logic.scene.segments.scene_segments import SceneSegments
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.views.rendering import ClassRendering
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import image_of
from ViTTransferFunction.Testing.support.scenes import add_segment
from ViTTransferFunction.WebApp import packing, scene_files
from ViTTransferFunction.WebApp.app import WebApp

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]


def test_the_panels_settings_reach_the_session_and_come_back(opened: Callable[[Journey], None]) -> None:
    settings = {
        "preset": "fine", "model": "dino_vits8", "grid": 48, "device": "cpu", "refinement": "guided",
        "onlyAnnotatedParts": False, "proposalsVisible": False, "respectOtherSegments": False, "renderingCut": "plane",
    }  # fmt: skip

    async def journey(app: WebApp) -> None:
        before = {name: app.session.parameters.get(name) for name in settings}
        for name, value in settings.items():
            app.actions("parameter", name, value)
            assert app.session.parameters.get(name) == value
            assert app.server.state.parameters[name] == value
            app.actions("parameter", name, before[name])

    opened(journey)


def test_corrected_segments_in_arabic_and_hebrew_are_named_side_by_side_without_changing_places(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        with monkeypatch.context() as there:
            there.setattr(app.session.segments, "take_corrected", lambda: ("كبد 2", "כבד", "liver"))
            app.refresh()
        assert app.server.state.corrected == ["\u2068كبد 2\u2069", "\u2068כבד\u2069", "liver"]
        app.server.state.corrected = []

    opened(journey)


@pytest.mark.parametrize("grid", [3, 129, -1])
def test_a_grid_out_of_range_is_refused_with_the_range(opened: Callable[[Journey], None], grid: int) -> None:
    async def journey(app: WebApp) -> None:
        before = app.session.parameters.get("grid")
        app.actions("parameter", "grid", grid)
        assert app.session.parameters.get("grid") == before
        assert f"The grid must have 4 to 128 cells; got {grid}." in app.server.state.message

    opened(journey)


def test_what_a_setting_cannot_be_leaves_it_as_it_is(opened: Callable[[Journey], None]) -> None:
    hostile = {
        "preset": "none such", "model": "", "grid": 129, "device": "tpu", "refinement": None, "overlayOpacity": 1.5,
        "selectedClass": "x", "windowLow": 3.0, "no such setting": 1,
    }  # fmt: skip

    async def journey(app: WebApp) -> None:
        before = dict(app.server.state.parameters)
        for name, value in hostile.items():
            app.actions("parameter", name, value)
        assert app.server.state.parameters == before
        assert app.session.parameters.get("windowLow") != 3.0
        app.actions("addClass")
        structures = app.session.classes
        app.actions("set", "no such field", 1.0)
        assert app.session.classes == structures

    opened(journey)


def test_a_saved_session_comes_with_its_own_settings_but_for_those_of_this_computer(
    opened: Callable[[Journey], None], tmp_path: Path
) -> None:
    weights = tmp_path / "of this computer.pt"
    weights.touch()

    async def journey(app: WebApp) -> None:
        app.actions("parameter", "preset", "fine")
        app.actions("parameter", "weightsPath", "/of/another/computer.pt")
        saved = saved_session(app, tmp_path)
        app.actions("parameter", "preset", "balanced")
        app.actions("parameter", "weightsPath", str(weights))
        await app.opening.open([saved])
        parameters = app.session.parameters
        assert (parameters.get("preset"), parameters.get("weightsPath")) == ("fine", str(weights))
        app.actions("parameter", "preset", "balanced")
        app.actions("parameter", "weightsPath", "")

    opened(journey)


def test_a_setting_of_a_later_version_in_a_saved_session_is_replaced_and_the_page_says_so(
    opened: Callable[[Journey], None], tmp_path: Path
) -> None:
    async def journey(app: WebApp) -> None:
        app.session.parameters.set("refinement", "of tomorrow")
        saved = saved_session(app, tmp_path)
        app.session.parameters.set("refinement", "guided")
        await app.opening.open([saved])
        assert "The saved setting was replaced by the default." in app.server.state.message
        assert app.session.parameters.get("refinement") == "bilateral"

    opened(journey)


def test_the_tool_in_hand_is_put_down_when_a_session_is_opened(opened: Callable[[Journey], None], tmp_path: Path) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        app.actions("brushOn")
        assert app.server.state.tool == "brushOn"
        await app.opening.open([saved_session(app, tmp_path)])
        assert [shown["name"] for shown in app.server.state.classes] == ["Structure 1"]
        assert app.server.state.tool == ""

    opened(journey)


def saved_session(app: WebApp, folder: Path) -> Path:
    """What is open, as a file."""
    scene_files.stage_session(app.scene, folder / "session")
    packing.zip_folder(folder / "session", folder / "session.mrb")
    return folder / "session.mrb"


def test_settings_stay_when_another_volume_is_opened_but_not_its_intensities(
    opened: Callable[[Journey], None], file: Path
) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("parameter", "preset", "fine")
        app.actions("parameter", "weightsPath", "/no/such/file.pt")
        app.actions("networkWindow", -100.0, 200.0, False)
        await app.opening.open([file])
        parameters = app.session.parameters
        names = ("preset", "weightsPath", "windowAutomatic")
        assert [parameters.get(name) for name in names] == ["fine", "/no/such/file.pt", True]
        app.actions("parameter", "preset", "balanced")
        app.actions("parameter", "weightsPath", "")

    opened(journey)


def test_the_network_s_window_is_that_of_the_views_until_it_is_set(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        state, parameters = app.server.state, app.session.parameters
        app.actions("window", -50.0, 150.0)
        assert state.network_window == {"low": -50.0, "high": 150.0, "automatic": True}
        app.actions("networkWindow", None, 200.0, False)
        assert [parameters.get(name) for name in ("windowAutomatic", "windowLow", "windowHigh")] == [False, -50.0, 200.0]
        app.actions("networkWindow", 300.0, None, False)
        assert "lower first" in state.message
        app.actions("networkWindow", None, None, True)
        assert state.network_window["automatic"]

    opened(journey)


def test_without_a_map_there_is_no_threshold_to_see_or_to_keep(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        app.actions("thresholdAutomatic", False)
        assert app.session.classes[0].iso is None
        assert app.server.state.settings["threshold"] is None
        app.actions("set", "iso", 0.25)
        assert app.server.state.settings["threshold"] == 0.25

    opened(journey)


def test_a_threshold_is_kept_as_it_is_chosen_and_let_go_again(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(SceneSession, "chosen_iso", lambda self, id_: 0.375)

    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        assert app.server.state.settings["automatic"]
        for automatic, iso in ((False, 0.375), (True, None)):
            app.actions("thresholdAutomatic", automatic)
            assert (app.session.classes[0].iso, app.server.state.settings["automatic"]) == (iso, automatic)

    opened(journey)


def test_a_structure_is_duplicated_and_moved(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        app.actions("addClass")
        app.actions("duplicate")
        first, second, third = app.session.classes
        assert app.session.selected_class == third
        app.actions("moveUp")
        assert app.session.classes == (first, third, second)
        app.actions("moveUp")
        app.actions("moveDown")
        assert app.session.classes == (first, third, second)

    opened(journey)


def test_the_structure_above_or_below_is_selected(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        for _ in range(3):
            app.actions("addClass")
        first, second, _ = (shown["id"] for shown in app.server.state.classes)
        app.actions("previousClass")
        assert app.server.state.selected == second
        for _ in range(2):
            app.actions("nextClass")
        assert app.server.state.selected == first

    opened(journey)


def test_a_structure_is_made_smaller_and_larger_until_it_is_as_chosen_again(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        def size() -> tuple[float, float | None, bool]:
            (structure,) = app.session.classes
            return structure.size, structure.iso, app.server.state.settings["can_reset"]

        app.actions("addClass")
        for action, expected in (("smaller", -1.0), ("sizeAsChosen", 0.0), ("larger", 1.0)):
            app.actions(action)
            assert size() == (expected, None, expected != 0.0)
        app.actions("set", "iso", 0.25)
        app.actions("sizeAsChosen")
        assert size() == (0.0, None, False)

    opened(journey)


def test_points_are_gone_through_in_the_slices_and_the_last_one_is_removed(opened: Callable[[Journey], None]) -> None:
    points = np.array([[-10.0, -12.0, 8.0], [-14.0, -16.0, 11.0]])

    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        app.session.annotations.add_points(app.session.classes[0].id, points, positive=True)
        for point in (*points, points[0]):
            app.actions("nextPoint")
            for view in app.views.slices:
                assert numpy_matrix(view.get_view_node().GetSliceToRAS())[:3, 3] == pytest.approx(point)
        app.actions("removeLast")
        assert app.session.classes[0].positive == (tuple(points[0]),)

    opened(journey)


def test_a_structure_is_removed_that_is_not_the_selected_one(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        app.actions("addClass")
        first, second = app.session.classes
        app.actions("remove", first.id)
        assert app.session.classes == (second,)

    opened(journey)


def test_a_structure_is_hidden_and_shown(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        for visible in (False, True):
            app.actions("show", app.session.classes[0].id, visible)
            assert app.server.state.classes[0]["visible"] == app.session.classes[0].visible == visible

    opened(journey)


def test_without_a_structure_nothing_happens(opened: Callable[[Journey], None]) -> None:
    asked: list[tuple[Any, ...]] = [
        ("remove",), ("removePoints",), ("removeLast",), ("duplicate",), ("smaller",), ("sizeAsChosen",), ("nextClass",),
        ("nextPoint",), ("set", "opacity", 0.5), ("thresholdAutomatic", False), ("look", 1.0, None, False),
    ]  # fmt: skip

    async def journey(app: WebApp) -> None:
        for action in asked:
            assert app.actions(*action)
        assert (app.server.state.classes, app.server.state.message) == ([], "")

    opened(journey)


def test_a_structure_is_begun_anew(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        (state,) = app.session.classes
        app.session.annotations.add_points(state.id, np.zeros((2, 3)), positive=False)
        app.actions("removePoints")
        assert app.session.classes == (state,)

    opened(journey)


def test_a_segment_of_the_session_is_continued_as_a_structure(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        node = app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode", "of a colleague")
        mask = np.zeros((8, 8, 8), dtype=bool)
        mask[2:6, 2:6, 2:6] = True
        liver = add_segment(node, "liver", mask, np.diag([-1.0, -1.0, 1.0, 1.0]))
        app.session.set_segmentation(node)
        for segment in ("no such segment", liver):
            app.actions("continueSegment", segment)
        app.session.wait()
        app.refresh()
        assert [(shown["name"], shown["positive"] > 0) for shown in app.server.state.classes] == [("liver", True)]

    opened(journey)


@pytest.mark.parametrize("answer", ["keep", "overwrite"])
def test_segments_that_were_corrected_are_written_as_the_user_answers_and_the_question_goes(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    written: list[str] = []
    monkeypatch.setattr(SceneSegments, "write", lambda self, corrections: written.append(corrections))

    async def journey(app: WebApp) -> None:
        app.actions("write")
        app.server.state.corrected = ["liver"]
        app.actions("write", answer)
        assert (written, app.server.state.corrected) == (["ask", answer], [])
        app.actions("write", "no such answer")
        assert written == ["ask", answer]

    opened(journey)


def test_an_exported_rendering_is_removed_and_the_others_stay(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        for name in ("first", "second"):
            rendering = ClassRendering(app.scene, app._slicer.app_logic)
            rendering.show(app.session.parameters.volume, image_of(np.zeros((4, 4, 4, 4), np.uint8)), 1, {}, np.eye(4))
            rendering.export(name)
        app.refresh()
        assert [shown["name"] for shown in app.server.state.exported] == ["first", "second"]
        app.actions("removeExported", app.server.state.exported[0]["id"])
        assert [shown["name"] for shown in app.server.state.exported] == ["second"]

    opened(journey)


def test_without_a_rendering_there_is_nothing_to_export_and_the_page_says_so(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("exportRendering")
        assert "no 3D rendering" in app.server.state.message

    opened(journey)


def test_the_cache_is_looked_at_while_it_is_in_sight_and_emptied_on_demand(
    opened: Callable[[Journey], None], a_cache_of_its_own: Path
) -> None:
    kept = a_cache_of_its_own / "features" / f"{'0' * 64}.npz"
    kept.parent.mkdir(parents=True)
    kept.write_bytes(b"x" * 3_000_000)

    async def journey(app: WebApp) -> None:
        state = app.server.state

        def cache() -> Any:
            return state.cache

        assert cache() is None
        app.actions("advanced", True)
        assert a_cache_of_its_own.as_posix() in cache()["text"]
        assert "Features: 3 MB" in cache()["text"]
        assert "of all volumes from the cache (3 MB)" in cache()["features_question"]
        assert not cache()["has_model"]
        app.actions("removeModel")
        assert "Nothing to remove" in state.message
        app.actions("clearFeatures")
        assert not kept.exists()
        assert not cache()["has_features"]
        app.actions("advanced", False)
        assert cache() is None

    opened(journey)


def test_why_there_is_no_folder_for_the_cache_stands_where_it_is_looked_at(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        monkeypatch.setenv("VITTF_CACHE", "~no-such-user/cache")
        app.actions("advanced", True)
        cache: Any = app.server.state.cache
        assert "no such home folder" in cache["text"]
        assert not cache["has_features"]
        assert not cache["has_model"]
        app.actions("advanced", False)

    opened(journey)


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [("model", "of tomorrow", "'model' cannot be 'of tomorrow'; expected"), ("grid", 500, "must have 4 to 128 cells; got 500")],
)
def test_a_setting_of_another_version_becomes_its_default_and_the_page_says_so(
    opened: Callable[[Journey], None], tmp_path: Path, name: str, value: Any, why: str
) -> None:
    async def journey(app: WebApp) -> None:
        default = app.session.parameters.get(name)
        app.session.parameters.set(name, value)
        path = tmp_path / "session.mrb"
        assert app.scene.WriteToMRB(path.as_posix())
        app.session.parameters.set(name, default)
        await app.opening.open([path])
        assert why in app.server.state.message
        assert "The saved setting was replaced by the default." in app.server.state.message
        assert app.session.parameters.get(name) == default

    opened(journey)


def test_brushes_and_the_unit_of_volumes_suit_the_size_of_the_scan(
    opened: Callable[[Journey], None], file: Path, tmp_path: Path
) -> None:
    image = sitk.ReadImage(str(file))
    image.SetSpacing([0.01 * mm for mm in image.GetSpacing()])
    sitk.WriteImage(image, str(tmp_path / "specimen.nrrd"))

    async def journey(app: WebApp) -> None:
        state, before = app.server.state, app.server.state.brush_mm
        await app.opening.open([file])
        app.refresh()
        body = state.brush_mm, state.brush_range
        state.brush_mm = 2.0 * body[0]
        await app.opening.open([tmp_path / "specimen.nrrd"])
        app.refresh()
        # The form's sizes, times what makes a round number of its step.
        share = state.brush_range["step"] / body[1]["step"]
        assert state.brush_range == pytest.approx({end: share * mm for end, mm in body[1].items()})
        assert state.brush_mm == pytest.approx(2.0 * share * body[0])
        assert f"{state.brush_range['step']:.0e}"[0] in "125"
        assert 0.004 < share < 0.02
        assert state.volume_unit == "mm³"
        state.brush_mm = before

    opened(journey)
