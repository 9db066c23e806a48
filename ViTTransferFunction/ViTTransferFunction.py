"""The Slicer module: its entry in the list of modules, the life cycle of its panel, its sample data, and its self-test.

This file must also run on Python 3.9 of older Slicers, where it says which Slicer is needed. No other file does.
"""

from __future__ import annotations

import sys
import unittest
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import slicer
import vtk
from slicer.i18n import tr as _
from slicer.i18n import translate
from slicer.ScriptedLoadableModule import (
    ScriptedLoadableModule,
    ScriptedLoadableModuleLogic,
    ScriptedLoadableModuleTest,
    ScriptedLoadableModuleWidget,
)
from slicer.util import VTKObservationMixin
from vtk.util.numpy_support import vtk_to_numpy

# Slicer loads this file as a module of its own, not as part of a package. With this, the folders beside it are found by the
# same names as everywhere else, and none of them claims a name such as "Logic", which other extensions have as well.
__path__ = [str(Path(__file__).parent)]

OLDEST_SLICER = (5, 10)
"""Earlier versions have Python 3.9, on which the rest of the module does not run."""

WEIGHTS_MB, FEATURES_GB = 88, 20
"""Size of the default model's weights; size of the cache at which the least recently used features are removed."""

SAMPLE = "ViTTransferFunctionChestCT"
SAMPLE_SHA256 = "4507b664690840abb6cb9af2d919377ffc4ef75b167cb6fd0f747befdb12e38e"
SAMPLE_URL = f"https://github.com/Slicer/SlicerTestingData/releases/download/SHA256/{SAMPLE_SHA256}"


class ViTTransferFunction(ScriptedLoadableModule):
    """The module's entry in Slicer: name, category and help."""

    def __init__(self, parent: Any) -> None:
        ScriptedLoadableModule.__init__(self, parent)
        parent.title = _("ViT Transfer Function")
        parent.categories = [translate("qSlicerAbstractCoreModule", "Segmentation")]
        parent.dependencies = []
        parent.contributors = [_("The ViT Transfer Function contributors")]
        parent.helpText = help_text()
        parent.acknowledgementText = _(
            "After D. Engel, L. Sick and T. Ropinski, Leveraging Self-Supervised Vision Transformers for Segmentation-based "
            "Transfer Function Design, IEEE TVCG 2024."
        )
        slicer.app.connect("startupCompleted()", register_sample_data)
        slicer.app.connect("startupCompleted()", _register_tutorial_data)
        slicer.app.connect("startupCompleted()", _watch_for_added_scenes)


def _register_tutorial_data() -> None:
    """Offer the scans of the README's tutorials in the module Sample Data."""
    from ViTTransferFunction.Widget.tutorial_data import register_tutorial_data

    register_tutorial_data()


def _watch_for_added_scenes() -> None:
    scene = slicer.mrmlScene
    scene.AddObserver(scene.StartImportEvent, _on_start_import)


def _on_start_import(scene: Any, event: str) -> None:
    """Keep the scene's classes when a saved scene is added, if there is no session yet that does."""
    widget = getattr(slicer.modules, "ViTTransferFunctionWidget", None)
    session_keeps_it = widget is not None and widget.panel is not None and widget.panel.session is not None
    parameter_node = scene.GetSingletonNode("ViTTransferFunction", "vtkMRMLScriptedModuleNode")
    if parameter_node is not None and not session_keeps_it and not slicer_is_too_old():
        from ViTTransferFunction.Logic.scene.classes.added_scene import keep_work

        keep_work(scene, parameter_node)


class ViTTransferFunctionLogic(ScriptedLoadableModuleLogic):
    """Finds or makes the module's parameter node; everything else is in the folder Logic."""


class ViTTransferFunctionWidget(ScriptedLoadableModuleWidget, VTKObservationMixin):
    """Keeps the panel in step with Slicer: opens and closes it with the module and the scene.

    Attributes:
        panel: everything below the module's title; None if Slicer is too old for it.
    """

    def __init__(self, parent: Any = None) -> None:
        ScriptedLoadableModuleWidget.__init__(self, parent)
        VTKObservationMixin.__init__(self)
        self.panel: Any = None

    def setup(self) -> None:
        """The module is opened for the first time, or was reloaded."""
        ScriptedLoadableModuleWidget.setup(self)
        if slicer_is_too_old():
            self.layout.addWidget(_label(too_old_text()))
            return
        from ViTTransferFunction.Widget.panel import Panel

        widget = slicer.util.loadUI(self.resourcePath("UI/ViTTransferFunction.ui"))
        self.layout.addWidget(widget)
        self.logic = ViTTransferFunctionLogic()
        self.ui = slicer.util.childWidgetVariables(widget)
        window = slicer.util.mainWindow() or self.parent
        self.panel = Panel(self.ui, window, Path(self.resourcePath("Icons")))
        scene = slicer.mrmlScene
        self.addObserver(scene, scene.StartCloseEvent, self.onSceneStartClose)
        self.addObserver(scene, scene.EndCloseEvent, self.onSceneEndClose)
        self.addObserver(scene, scene.StartImportEvent, self.onSceneStartImport)
        self.addObserver(scene, scene.EndImportEvent, self.onSceneEndImport)
        # After a reload, Slicer does not call `enter` if the module is open.
        if self.parent.isEntered:
            self.enter()

    def cleanup(self) -> None:
        """Slicer ends, or reloads the module."""
        self.removeObservers()
        if self.panel is not None:
            self.panel.leave_input()
            self.panel.close(is_asked=_user_was_asked())

    def enter(self) -> None:
        """The user opens the module."""
        if self.panel is not None:
            if self.panel.session is None:
                self._open()
            self.panel.take_input()
            self.panel.refresh()

    def exit(self) -> None:
        """The user goes to another module; computing continues."""
        if self.panel is not None:
            self.panel.leave_input()
            self.panel.shortcut_help.close()
            self.panel.tools.put_down()

    def onSceneStartClose(self, caller: Any, event: str) -> None:  # noqa: N802
        """The scene is about to be closed."""
        self.panel.close()

    def onSceneEndClose(self, caller: Any, event: str) -> None:  # noqa: N802
        """The scene is empty."""
        if self.parent.isEntered:
            self._open()

    def onSceneStartImport(self, caller: Any, event: str) -> None:  # noqa: N802
        """A scene is being loaded or added, which may change the parameter node step by step."""
        self.panel.release_parameters()

    def onSceneEndImport(self, caller: Any, event: str) -> None:  # noqa: N802
        """The scene has been loaded or added."""
        self.panel.bind_parameters()

    def onReload(self) -> None:  # noqa: N802
        """Reload the module with all of its files."""
        if self.panel is not None:
            # Before `cleanup`: the scene stays as it is, so that there are no unsaved points to restore.
            self.panel.close()
        for name in [name for name in sys.modules if name.startswith(f"{self.moduleName}.")]:
            del sys.modules[name]
        ScriptedLoadableModuleWidget.onReload(self)

    def _open(self) -> None:
        self.panel.open(self.logic.getParameterNode())


def help_text() -> str:
    """What the module does, that it is for research, how to begin, and what it needs; as HTML."""
    purpose = _(
        "Segments structures of a CT or MR volume, and renders them in 3D, from a few points: features of a vision transformer "
        "tell which voxels are similar to those that were clicked. Nothing is trained, and no image leaves this computer."
    )
    research = _("For research use only. This is not a medical device: do not base diagnosis or treatment on its results.")
    steps = (
        _("Choose the scan, and press <i>Compute features</i>: once for each scan."),
        _("Press <i>Add structure</i>, and click on the structure in a slice."),
        _("Click where something is missing. Where too much is shown, take <i>Outside</i>, and click there."),
        _("Begin what is small with <i>Outline</i>: drag once around it. Where it is thin, <i>Look closer</i> may help."),
        _("<i>Create segments</i> makes an ordinary segmentation of all structures, for Slicer's other modules."),
    )
    needs = (
        _("Slicer {version} or later").format(version=".".join(map(str, OLDEST_SLICER))),
        _("PyTorch, which the panel installs: a download of up to 3 GB"),
        _("the weights of a neural network: a download of {size} MB, once, or a file that you have").format(size=WEIGHTS_MB),
        # Benchmarks/results/memory.md.
        _("memory beside Slicer: 1.6 GB for 512×512×300 voxels, 2.9 GB for 512×512×1200"),
        _("disk space for features, which are kept: up to {size} GB, and you can clear them").format(size=FEATURES_GB),
        # Benchmarks/results/features.md, seconds on AVX2.
        _("no graphics card: the features of 512×512×300 voxels took 7 seconds on two ordinary processor cores"),
    )
    numbered, listed = ("".join(f"<li>{line}</li>" for line in lines) for lines in (steps, needs))
    return f"<p>{purpose}</p><p><b>{research}</b></p><ol>{numbered}</ol><p>{_('It needs:')}</p><ul>{listed}</ul>"


def slicer_is_too_old() -> bool:
    """Whether this Slicer's Python is too old for the module."""
    return (slicer.app.majorVersion, slicer.app.minorVersion) < OLDEST_SLICER


def too_old_text() -> str:
    """A message that says which Slicer is needed."""
    return _("ViT Transfer Function needs Slicer {needed} or later, and this is Slicer {found}: install a newer one.").format(
        needed=".".join(map(str, OLDEST_SLICER)), found=f"{slicer.app.majorVersion}.{slicer.app.minorVersion}"
    )


def _user_was_asked() -> bool:
    """Whether Slicer, which ends, has asked the user to save: it does if its window is closed, but not before a restart."""
    window = slicer.util.mainWindow()
    return window is None or not window.visible


def _label(text: str) -> Any:
    import qt

    label = qt.QLabel(text)
    label.wordWrap = True
    return label


def register_sample_data() -> None:
    """Offer the self-test's data, Slicer's own chest CT, in the module Sample Data."""
    import SampleData

    SampleData.SampleDataLogic.registerCustomSampleDataSource(
        category="ViT Transfer Function",
        sampleName=SAMPLE,
        uris=SAMPLE_URL,
        fileNames="CT-chest.nrrd",
        nodeNames="CTChest",
        checksums=f"SHA256:{SAMPLE_SHA256}",
    )


class ViTTransferFunctionTest(ScriptedLoadableModuleTest):
    """The whole path on sample data, from the volume to segments. Skipped without PyTorch, or without a needed network."""

    GRID = 16
    """Coarse, to take less than a minute."""

    def setUp(self) -> None:
        """Begin with an empty scene."""
        if slicer_is_too_old():
            self.skipTest(too_old_text())
        slicer.mrmlScene.Clear()

    def runTest(self, **options: Any) -> None:  # noqa: N802
        """Run the test, and print the outcome in one line, since Slicer's exit code does not tell it."""
        verdict = "FAILED"
        try:
            self.setUp()
            self.test_annotations_become_segments()
            verdict = "PASSED"
        except unittest.SkipTest as reason:
            verdict = f"SKIPPED: {reason}"
        finally:
            print(f"VITTF SELF-TEST {verdict}", flush=True)  # noqa: T201
            self.delayDisplay(f"Self-test: {verdict}")

    def test_annotations_become_segments(self) -> None:
        """Points on both lungs and the spine become three segments, beside a segment that stays as it is."""
        from ViTTransferFunction.Widget.pytorch_installation import pytorch_is_installed

        if not pytorch_is_installed():
            self.skipTest("PyTorch is not installed.")
        widget = self._open_widget()
        session = widget.panel.session
        volume = self._load_sample()
        session.parameters.set("grid", self.GRID)
        widget.ui.volumeSelector.setCurrentNode(volume)
        assert session.parameters.volume is volume, "the panel did not tell the session of its volume"
        self._compute_features(widget)
        names = self._annotate(session, volume)
        self._undo_and_redo(session)
        self._write_segments(session, volume, names)

    def _open_widget(self) -> Any:
        self.delayDisplay("Opening the panel")
        if slicer.util.mainWindow():
            slicer.util.selectModule("ViTTransferFunction")
        representation = slicer.modules.vittransferfunction.widgetRepresentation()
        if not representation.isEntered:
            representation.enter()
        return representation.self()

    def _load_sample(self) -> Any:
        import SampleData

        self.delayDisplay("Loading the chest CT")
        register_sample_data()
        try:
            return SampleData.downloadSample(SAMPLE)
        except IndexError:  # After a failed download, SampleData takes the first node of an empty list.
            self._skip_if_offline(SAMPLE_URL)
            raise

    def _compute_features(self, widget: Any) -> None:
        self.delayDisplay("Computing features")
        session = widget.panel.session
        session.wait()
        download = session.estimate.download if session.estimate else None
        session.start_extraction()
        session.wait()
        if session.phase != "ready" and download is not None:
            self._skip_if_offline(download.url)
        assert session.phase == "ready", widget.ui.messageLabel.text

    def _skip_if_offline(self, url: str) -> None:
        try:
            urllib.request.urlopen(urllib.request.Request(url, method="HEAD"), timeout=10.0).close()
        except urllib.error.HTTPError:
            return  # The network is there; what failed is something else.
        except OSError as error:
            self.skipTest(f"{url} is not reached ({error}).")

    def _annotate(self, session: Any, volume: Any) -> list[str]:
        from ViTTransferFunction.Logic.files.annotation_files import read_annotations
        from ViTTransferFunction.Logic.scene.volumes.volume_nodes import geometry_from_node

        self.delayDisplay("Placing points")
        path = Path(__file__).parent / "Resources" / "Annotations" / "ct_chest.json"
        annotated = read_annotations(path, geometry_from_node(volume))
        for given in annotated:
            state = session.annotations.add_class(given.name, given.color)
            session.annotations.add_points(state.id, given.request.positive, positive=True)
            session.annotations.add_points(state.id, given.request.negative, positive=False)
        session.wait()
        for state in session.classes:
            assert session.chosen_iso(state.id) is not None, f"{state.name} has no map"
        return [given.name for given in annotated]

    def _undo_and_redo(self, session: Any) -> None:
        self.delayDisplay("Undoing and redoing")
        before = session.classes
        session.annotations.undo()
        assert session.classes != before, "undo did nothing"
        session.annotations.redo()
        assert session.classes == before, "redo did not bring back what was undone"

    def _write_segments(self, session: Any, volume: Any, names: list[str]) -> None:
        self.delayDisplay("Writing segments")
        segmentation = self._segmentation_with_a_block(volume)
        (block,) = self._voxels(segmentation)
        session.set_segmentation(segmentation)
        session.segments.write()
        session.wait()
        error = session.take_error()
        assert error is None, error
        segments = segmentation.GetSegmentation()
        written = [segments.GetNthSegment(n).GetName() for n in range(1, segments.GetNumberOfSegments())]
        assert written == names, written
        kept, *sizes = self._voxels(segmentation)
        assert kept == block, f"the segment that was there has {kept} voxels, and had {block}"
        assert min(sizes) > 100, sizes

    def _segmentation_with_a_block(self, volume: Any) -> Any:
        """A segmentation with one segment, a block in the middle of the volume."""
        array = np.zeros_like(slicer.util.arrayFromVolume(volume), dtype=np.uint8)
        k, j, i = (n // 2 for n in array.shape)
        array[k - 4 : k + 4, j - 4 : j + 4, i - 4 : i + 4] = 1
        matrix = vtk.vtkMatrix4x4()
        volume.GetIJKToRASMatrix(matrix)
        labelmap = slicer.util.addVolumeFromArray(array, matrix, "block", "vtkMRMLLabelMapVolumeNode")
        segmentation = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLSegmentationNode", "Self-test")
        slicer.vtkSlicerSegmentationsModuleLogic.ImportLabelmapToSegmentationNode(labelmap, segmentation)
        slicer.mrmlScene.RemoveNode(labelmap)
        return segmentation

    def _voxels(self, segmentation: Any) -> list[int]:
        """Number of voxels of each segment."""
        counts = []
        for segment_id in segmentation.GetSegmentation().GetSegmentIDs():
            image = slicer.vtkOrientedImageData()
            segmentation.GetBinaryLabelmapRepresentation(segment_id, image)
            scalars = image.GetPointData().GetScalars()
            counts.append(int((vtk_to_numpy(scalars) != 0).sum()) if scalars else 0)
        return counts
