"""What the panel keeps and shows of settings: in the parameter node, in saved scenes, in the cache, in words."""

from __future__ import annotations

import gc
import re
import weakref
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer

from ViTTransferFunction.Testing.support.standin.host import Host
from ViTTransferFunction.Testing.support.widgets import add_class, place, text, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]


def test_widgets_and_parameters_stay_equal(widget: Any) -> None:
    ui, parameters = widget.ui, widget.panel.session.parameters
    ui.presetComboBox.setCurrentText("As in the paper (many times slower)")
    ui.modelComboBox.setCurrentText("dino_vits8")
    ui.deviceComboBox.setCurrentText("Processor (CPU)")
    ui.refinementComboBox.setCurrentText("Guided filter")
    ui.renderingComboBox.setCurrentText("Transfer function")
    ui.gridSpinBox.setValue(48)
    ui.overlayOpacitySlider.value = 0.25
    boxes = ("onlyAnnotatedParts", "respectOtherSegments", "overlayVisible", "proposalsVisible")
    for name in boxes:
        getattr(ui, f"{name}CheckBox").click()
    names = ("preset", "model", "device", "refinement", "rendering", "grid", "overlayOpacity")
    written = ("paper", "dino_vits8", "cpu", "guided", "transfer function", 48, 0.25)
    assert tuple(parameters.get(name) for name in names) == written
    assert not any(parameters.get(name) for name in boxes)
    for name in names:
        parameters.set(name, parameters.DEFAULTS[name])
    shown = (ui.presetComboBox, ui.modelComboBox, ui.deviceComboBox, ui.refinementComboBox, ui.renderingComboBox)
    assert [box.currentText() for box in shown] == [
        "Balanced",
        "as in the preset",
        "Automatic",
        "Bilateral solver",
        "Similarity",
    ]
    assert (ui.gridSpinBox.value(), ui.overlayOpacitySlider.value) == (0, 0.5)


def test_widgets_that_are_bound_anew_are_forgotten_before(widget: Any) -> None:
    """Each scene that is opened binds them twice; what observed the node for them must not stay with it."""
    bound = weakref.ref(widget.panel._bound._parameters)
    widget.panel.release_parameters()
    widget.panel.bind_parameters()
    gc.collect()
    assert bound() is None
    widget.panel.session.parameters.set("overlayOpacity", 0.75)
    assert widget.ui.overlayOpacitySlider.value == 0.75


def test_the_panels_grid_ends_where_that_of_the_features_does(widget: Any) -> None:
    from ViTTransferFunction.Logic.features.settings import LARGEST_GRID, SMALLEST_GRID

    assert (widget.ui.gridSpinBox.minimum(), widget.ui.gridSpinBox.maximum()) == (0, LARGEST_GRID)
    assert widget.ui.gridSpinBox.singleStep() >= SMALLEST_GRID


def test_values_that_a_saved_scene_cannot_mean_become_defaults(host: Host) -> None:
    node = slicer.vtkMRMLScriptedModuleNode()
    node.SetSingletonTag("ViTTransferFunction")
    node = slicer.mrmlScene.AddNode(node)
    for name, value in {"model": "of tomorrow", "rendering": "", "grid": "many", "overlayOpacity": "nan"}.items():
        node.SetParameter(name, value)
    parameters = host.open_panel().panel.session.parameters
    assert [parameters.get(name) for name in ("model", "rendering", "grid", "overlayOpacity")] == ["", "similarity", 0, 0.5]


def test_a_grid_that_a_saved_scene_has_out_of_range_is_told_with_the_range(host: Host) -> None:
    node = slicer.vtkMRMLScriptedModuleNode()
    node.SetSingletonTag("ViTTransferFunction")
    node = slicer.mrmlScene.AddNode(node)
    node.SetParameter("grid", "500")
    widget = host.open_panel()
    assert widget.panel.session.parameters.get("grid") == 0
    assert "The grid must have 4 to 128 cells; got 500. The saved setting was replaced" in widget.ui.messageLabel.text()
    assert widget.panel.session.take_error() is None


def test_the_window_is_the_views_until_it_is_touched(widget: Any, volume: Any) -> None:
    ui, parameters = widget.ui, widget.panel.session.parameters
    display = volume.GetScalarVolumeDisplayNode()
    display.SetAutoWindowLevel(False)
    display.SetWindowLevelMinMax(-50.0, 150.0)
    ui.volumeSelector.setCurrentNode(volume)
    ui.advancedCollapsibleButton.click()
    numbers = ui.windowLowSpinBox, ui.windowHighSpinBox
    # What is chosen from the image is not this window, which is only what one begins with.
    assert [box.isVisible() for box in (*numbers, ui.windowChosenLabel)] == [False, False, True]
    ui.windowAutomaticCheckBox.click()
    assert [box.isVisible() for box in (*numbers, ui.windowChosenLabel)] == [True, True, False]
    assert [box.value() for box in numbers] == [-50.0, 150.0]
    ui.windowHighSpinBox.setValue(200.0)
    assert [parameters.get(f"window{name}") for name in ("Automatic", "Low", "High")] == [False, -50.0, 200.0]
    assert not ui.windowAutomaticCheckBox.isChecked()
    ui.windowAutomaticCheckBox.click()
    assert parameters.get("windowAutomatic")
    assert not ui.messageFrame.isVisible()


def see_by_its_window(widget: Any, volume: Any, low: float, high: float) -> None:
    """Choose a volume that is displayed between two intensities, and have the network see it so."""
    widget.ui.advancedCollapsibleButton.collapsed = False
    volume.GetScalarVolumeDisplayNode().SetAutoWindowLevel(False)
    volume.GetScalarVolumeDisplayNode().SetWindowLevelMinMax(low, high)
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.windowAutomaticCheckBox.click()


def test_the_window_of_a_map_of_small_numbers_is_not_rounded_to_nothing(widget: Any, volume: Any) -> None:
    see_by_its_window(widget, volume, 0.0004, 0.0025)
    assert widget.panel.session.parameters.window == pytest.approx((0.0004, 0.0025), abs=1e-6)
    widget.ui.windowHighSpinBox.setValue(0.0021)
    assert widget.panel.session.parameters.window == pytest.approx((0.0004, 0.0021), abs=1e-6)


def test_the_window_of_a_scan_of_large_numbers_is_not_cut_off(widget: Any, volume: Any) -> None:
    """As of PET in Bq/ml."""
    see_by_its_window(widget, volume, 0.0, 5e6)
    assert widget.panel.session.parameters.window == (0.0, 5e6)
    widget.ui.windowHighSpinBox.setValue(8e6)
    assert widget.panel.session.parameters.window == (0.0, 8e6)


def test_an_inverted_window_is_reported_in_the_panel(widget: Any, volume: Any) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.advancedCollapsibleButton.click()
    widget.ui.windowLowSpinBox.setValue(5000.0)
    assert "lower first" in widget.ui.messageLabel.text()
    add_class(widget)
    assert widget.ui.messageFrame.isVisible()
    widget.ui.windowHighSpinBox.setValue(6000.0)
    assert not widget.ui.messageFrame.isVisible()


def test_own_weights_are_chosen_and_cleared(widget: Any, tmp_path: Path) -> None:
    parameters = widget.panel.session.parameters
    widget.ui.advancedCollapsibleButton.click()
    widget.ui.weightsPathLineEdit.currentPath = str(tmp_path)
    wait_until(lambda: parameters.get("weightsPath"))
    assert parameters.get("weightsPath") == str(tmp_path)
    widget.ui.clearWeightsButton.click()
    assert parameters.get("weightsPath") == ""
    assert widget.ui.weightsPathLineEdit.currentPath == ""
    assert not widget.ui.clearWeightsButton.isEnabled()


def test_weights_that_were_named_once_are_named_in_the_next_scene_until_they_are_cleared(widget: Any, tmp_path: Path) -> None:
    def of_next_scene() -> str:
        slicer.mrmlScene.Clear(False)
        return str(widget.panel.session.parameters.get("weightsPath"))

    weights = tmp_path / "weights"
    weights.mkdir()
    widget.ui.advancedCollapsibleButton.click()
    widget.ui.weightsPathLineEdit.currentPath = str(weights)
    wait_until(lambda: widget.panel.session.parameters.get("weightsPath"))
    assert of_next_scene() == str(weights)
    assert widget.ui.weightsPathLineEdit.currentPath == str(weights)
    weights.rename(tmp_path / "elsewhere")
    assert of_next_scene() == ""
    (tmp_path / "elsewhere").rename(weights)
    assert of_next_scene() == str(weights)
    widget.ui.clearWeightsButton.click()
    assert of_next_scene() == ""


def test_weights_that_were_named_once_do_not_replace_those_of_a_scene(widget: Any, tmp_path: Path) -> None:
    slicer.app.userSettings().setValue("ViTTransferFunction/WeightsPath", str(tmp_path))
    panel, parameters = widget.panel, widget.panel.session.parameters
    own = str(tmp_path.parent)
    for path, model, named in ((own, "", own), ("", "dinov2_vits14", ""), ("", "", str(tmp_path))):
        panel.release_parameters()
        parameters.set("weightsPath", path)
        parameters.set("usedModel", model)
        panel.bind_parameters()
        assert parameters.get("weightsPath") == named


def test_a_path_that_is_typed_is_taken_when_it_is_complete(widget: Any, tmp_path: Path) -> None:
    ui, parameters = widget.ui, widget.panel.session.parameters
    taken = []
    parameters.node.AddObserver("ModifiedEvent", lambda *_: taken.append(parameters.get("weightsPath")))
    ui.advancedCollapsibleButton.click()
    path = str(tmp_path / "weights.pt")
    for end in range(1, len(path) + 1):
        ui.weightsPathLineEdit.currentPath = path[:end]
        widget.panel.refresh()
    assert ui.weightsPathLineEdit.currentPath == path
    wait_until(lambda: bool(taken))
    assert set(taken) == {path}


def test_what_was_being_typed_is_cleared_with_the_path_that_was_taken(widget: Any, tmp_path: Path) -> None:
    ui, parameters = widget.ui, widget.panel.session.parameters
    ui.advancedCollapsibleButton.click()
    parameters.set("weightsPath", str(tmp_path / "mine.pt"))
    ui.weightsPathLineEdit.currentPath = str(tmp_path / "mine")
    ui.clearWeightsButton.click()
    assert ui.weightsPathLineEdit.currentPath == parameters.get("weightsPath") == ""


def test_a_folder_of_weights_is_chosen_by_its_own_button(widget: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ViTTransferFunction.Widget import advanced_section

    monkeypatch.setattr(advanced_section, "ask_folder", lambda title, path, parent: str(tmp_path))
    widget.ui.advancedCollapsibleButton.click()
    widget.ui.weightsFolderButton.click()
    assert widget.panel.session.parameters.get("weightsPath") == str(tmp_path)
    assert widget.ui.weightsPathLineEdit.currentPath == str(tmp_path)
    monkeypatch.setattr(advanced_section, "ask_folder", lambda title, path, parent: "")
    widget.ui.weightsFolderButton.click()
    assert widget.panel.session.parameters.get("weightsPath") == str(tmp_path)


def test_the_cache_is_shown_and_emptied_on_confirmation(
    widget: Any, volume: Any, a_cache_of_its_own: Path, questions: list[str]
) -> None:
    widget.ui.advancedCollapsibleButton.click()
    assert a_cache_of_its_own.as_posix() in widget.ui.cacheFolderLabel.text()
    assert widget.ui.clearFeaturesButton.isEnabled()
    assert not widget.ui.removeModelButton.isEnabled()
    widget.ui.clearFeaturesButton.click()
    assert list((a_cache_of_its_own / "features").iterdir()) == []
    assert "Delete the features of all volumes" in questions[0]
    assert not widget.ui.clearFeaturesButton.isEnabled()


@pytest.mark.parametrize(
    ("folder", "words"), [("~no-such-user/cache", "no such home folder"), ("a" * 300, "File name too long")]
)
def test_without_a_folder_for_the_cache_the_section_says_why(
    widget: Any, monkeypatch: pytest.MonkeyPatch, folder: str, words: str
) -> None:
    monkeypatch.setenv("VITTF_CACHE", folder)
    widget.ui.advancedCollapsibleButton.click()
    assert words in widget.ui.cacheFolderLabel.text()
    assert not widget.ui.clearFeaturesButton.isEnabled()
    assert not widget.ui.removeModelButton.isEnabled()


def test_a_model_is_removed_from_the_cache_on_confirmation(widget: Any, a_cache_of_its_own: Path, questions: list[str]) -> None:
    weights = a_cache_of_its_own / "weights" / "dino_deitsmall8_pretrain.pth"
    weights.parent.mkdir()
    weights.write_bytes(b"weights")
    widget.ui.advancedCollapsibleButton.click()
    widget.panel.session.parameters.set("model", "dino_vits8")
    assert widget.ui.removeModelButton.isEnabled()
    widget.ui.removeModelButton.click()
    assert not weights.exists()
    assert "dino_vits8" in questions[0]


def test_a_model_that_is_not_downloaded_is_offered_as_ones_own_file_and_not_removed_lightly(
    widget: Any, a_cache_of_its_own: Path, questions: list[str]
) -> None:
    weights = a_cache_of_its_own / "weights" / "dinov3_vits16.pth"
    weights.parent.mkdir()
    weights.write_bytes(b"weights")
    widget.ui.advancedCollapsibleButton.click()
    widget.ui.modelComboBox.setCurrentText("dinov3_vits16 (your own file)")
    assert widget.panel.session.parameters.get("model") == "dinov3_vits16"
    widget.ui.removeModelButton.click()
    assert "cannot download them again" in questions[0]


def test_a_scene_closed_in_another_module_leaves_an_empty_panel_on_return(widget: Any, host: Host) -> None:
    add_class(widget)
    host.representation.exit()
    slicer.mrmlScene.Clear()
    assert not widget.panel.session
    host.representation.enter()
    assert widget.panel.session.classes == ()


def test_a_saved_scene_brings_everything_back(widget: Any, volume: Any, tmp_path: Path) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    add_class(widget, "liver")
    place(widget, (1.0, 2.0, 3.0))
    widget.ui.opacitySlider.value = 0.5
    widget.ui.renderingComboBox.setCurrentIndex(0)
    path = str(tmp_path / "scene.mrml")
    slicer.mrmlScene.SetURL(path)
    slicer.mrmlScene.Commit(path)
    slicer.mrmlScene.Clear()
    slicer.mrmlScene.Import()
    (state,) = widget.panel.session.classes
    assert (state.name, state.look.opacity) == ("liver", 0.5)
    assert text(widget.ui.classTable, 0, 1) == "liver"
    assert widget.ui.renderingComboBox.currentText() == "Off"
    widget.ui.renderingComboBox.setCurrentIndex(1)
    assert widget.panel.session.parameters.get("rendering") == "similarity"


def test_sample_data_is_offered_with_its_checksum(host: Host) -> None:
    import SampleData

    (source,) = (source for source in SampleData.SampleDataLogic.sources if source["nodeNames"] == "CTChest")
    assert source["uris"].endswith(source["checksums"].removeprefix("SHA256:"))


def test_the_scans_of_the_tutorials_are_offered_at_one_commit_with_their_checksums(host: Host) -> None:
    import SampleData

    sources = {source["sampleName"]: source for source in SampleData.SampleDataLogic.sources}
    for name in ("TorsoCT", "BrainMR"):
        assert re.fullmatch(r"https://raw\.githubusercontent\.com/\w+/\w+/[0-9a-f]{40}/\S+", sources[name]["uris"])
        assert re.fullmatch(r"SHA256:[0-9a-f]{64}", sources[name]["checksums"])
        assert sources[name]["fileNames"].rpartition(".")[2] == sources[name]["uris"].rpartition(".")[2]
        assert sources[name]["category"] == sources["ViTTransferFunctionChestCT"]["category"]


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.2, "1 s"), (12, "12 s"), (43, "45 s"), (100, "2 min"), (3500, "58 min"), (4200, "1 h 10 min")]
)
def test_durations_are_shown_in_round_units(host: Host, seconds: float, words: str) -> None:
    from ViTTransferFunction.Logic.scene.interface.number_texts import duration

    assert duration(seconds) == words


def test_the_estimate_is_shown_in_a_few_words(host: Host) -> None:
    from ViTTransferFunction.Logic.scene.feature_wording import estimate_text
    from ViTTransferFunction.Logic.scene.volumes.volume_content import Frame
    from ViTTransferFunction.Logic.session.feature_estimate import FeatureEstimate
    from ViTTransferFunction.Testing.support.downloads import DOWNLOAD

    assert estimate_text(FeatureEstimate(cached=True, seconds=None, memory_bytes=1)) == "Computed before: ready at once."
    costly = FeatureEstimate(cached=False, seconds=125.0, memory_bytes=1_230_000_000, download=DOWNLOAD)
    assert estimate_text(costly) == "About 2 min, 1.2 GB of memory, 88 MB to download."
    assert estimate_text(costly, Frame(3, 10)) == "Frame 3 of 10: About 2 min, 1.2 GB of memory, 88 MB to download."
