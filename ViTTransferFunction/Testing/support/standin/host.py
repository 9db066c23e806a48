"""Slicer's application, as far as a scripted module's panel needs one: see the README beside this file."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import shiboken6
import slicer
import slicer.util
from PySide6.QtCore import Property, Qt
from PySide6.QtWidgets import QApplication, QLayoutItem, QMainWindow, QScrollArea, QSizePolicy, QVBoxLayout, QWidget

from ViTTransferFunction.Testing.support.standin import (
    ctk,
    i18n,
    parameter_node_wrapper,
    qt,
    sample_data,
    scripted_loadable_module,
)
from ViTTransferFunction.Testing.support.standin.markups_tool_bar import keep_markups_tool_bar
from ViTTransferFunction.Testing.support.standin.node_combo_box import qMRMLNodeComboBox
from ViTTransferFunction.Testing.support.standin.segmentation_widgets import ModuleSelector, SegmentEditor
from ViTTransferFunction.Testing.support.standin.subject_hierarchy import keep_subject_hierarchy
from ViTTransferFunction.Testing.support.standin.views import LayoutManager

MODULE_FILE = Path(__file__).parents[3] / "ViTTransferFunction.py"
NAME = MODULE_FILE.stem
PANEL_WIDTH = 430

_MODULES: dict[str, ModuleType] = {
    "qt": qt,
    "ctk": ctk,
    "SampleData": sample_data,
    "slicer.i18n": i18n,
    "slicer.parameterNodeWrapper": parameter_node_wrapper,
    "slicer.ScriptedLoadableModule": scripted_loadable_module,
}


def _qt_application() -> QApplication:
    application = QApplication([])
    # On every system, as Slicer's own style is one of this kind.
    application.setStyle("Fusion")
    return application


class Host:
    """A Slicer with one module, ViTTransferFunction.

    Args:
        app: trame-slicer's application, with the scene and the logics.

    Attributes:
        window: the main window, with the module's panel in it.
        representation: the panel's outermost widget; its `python_widget` is the module's own widget class.
    """

    def __init__(self, app: Any) -> None:
        qt_application = QApplication.instance() or _qt_application()
        self._replaced = {name: sys.modules.get(name) for name in (*_MODULES, NAME)}
        sys.modules.update(_MODULES)
        self._attributes = {
            "app": Application(app, qt_application),
            "mrmlScene": app.scene,
            "modules": SimpleNamespace(),
            "qMRMLNodeComboBox": qMRMLNodeComboBox,
            "i18n": i18n,
        }
        for name, value in self._attributes.items():
            setattr(slicer, name, value)
        _read_properties_as_pythonqt_does()
        keep_subject_hierarchy(app.scene)
        keep_markups_tool_bar(app.scene)
        self.window = MainWindow()
        slicer.app.layoutManager().setViewport(self.window)
        self.representation = Representation()
        slicer.modules.segmenteditor = SegmentEditor(app.scene)
        modules = {NAME: self.representation, "SegmentEditor": slicer.modules.segmenteditor}
        self.window.module_selector = ModuleSelector(modules, NAME)
        slicer.modules.vittransferfunction = SimpleNamespace(
            path=str(MODULE_FILE), widgetRepresentation=lambda: self.representation
        )
        _load_module()
        self.module = sys.modules[NAME].ViTTransferFunction(SimpleNamespace(path=str(MODULE_FILE)))
        slicer.app.start()

    def selectModule(self, name: str) -> None:  # noqa: N802
        """What the user chooses in the list of modules, which here has one."""
        assert name == NAME
        if not self.representation.isEntered:
            self.representation.enter()

    def open_panel(self) -> Any:
        """Show the module's panel, as when a user chooses the module; returns its widget class's object."""
        area = QScrollArea()
        area.setWidgetResizable(True)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        contents = QWidget()
        layout = QVBoxLayout(contents)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addStretch()
        self.representation.panel = layout
        self.representation.put_into_panel()
        # What the module would like to have is the least that it gets: the panel is made wider for it.
        self.representation.setSizePolicy(QSizePolicy.Policy.Minimum, self.representation.sizePolicy().verticalPolicy())
        area.setWidget(contents)
        self.window.setCentralWidget(area)
        self.window.resize(PANEL_WIDTH, 1200)
        self.window.show()
        self.representation.reload()
        self.selectModule(NAME)
        slicer.app.processEvents()
        return self.representation.python_widget

    @property
    def wanted_width(self) -> int:
        """How wide Slicer makes the panel at least, but for its scroll bar; 0 where it is not open."""
        contents = self.representation.parentWidget()
        return contents.minimumSizeHint().width() if contents is not None else 0

    def close(self) -> None:
        """End the application, and leave Python as it was."""
        if self.representation.isEntered:
            self.representation.exit()
        slicer.app.moduleManager().unload(NAME)
        slicer.app.layoutManager().close()
        self.representation.delete()
        shiboken6.delete(self.window)
        for name in (*self._attributes, "selfTests"):
            delattr(slicer, name)
        for name, module in self._replaced.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module


class MainWindow(QMainWindow):
    """Slicer's main window."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("qSlicerMainWindow")
        self.module_selector: ModuleSelector | None = None

    def moduleSelector(self) -> ModuleSelector | None:  # noqa: N802
        """What has the user go from module to module."""
        return self.module_selector


class Application:
    """`slicer.app`."""

    applicationName = "Slicer"  # noqa: N815
    majorVersion, minorVersion = 5, 10  # noqa: N815

    def __init__(self, app: Any, qt_application: Any) -> None:
        self._app = app
        self._qt_application = qt_application
        self._layout_manager = LayoutManager(app.scene)
        logic = app.app_logic
        logic.AddObserver(logic.PauseRenderEvent, lambda *_: self._layout_manager.setRenderPaused(True))
        logic.AddObserver(logic.ResumeRenderEvent, lambda *_: self._layout_manager.setRenderPaused(False))
        self._module_manager = ModuleManager()
        self._at_startup: list[Callable[[], None]] = []
        self._settings = UserSettings()
        self.paletteChanged = qt_application.paletteChanged

    def start(self) -> None:
        """Notify all observers that the start is over."""
        for callback in self._at_startup:
            callback()

    def connect(self, signal: str, callback: Callable[[], None]) -> None:
        """Call back when the start is over."""
        assert signal == "startupCompleted()"
        self._at_startup.append(callback)

    def mrmlScene(self) -> Any:  # noqa: N802
        """The scene."""
        return self._app.scene

    def applicationLogic(self) -> Any:  # noqa: N802
        """The application's logic."""
        return self._app.app_logic

    def layoutManager(self) -> LayoutManager:  # noqa: N802
        """The views."""
        return self._layout_manager

    def moduleManager(self) -> ModuleManager:  # noqa: N802
        """Announces that modules are unloaded."""
        return self._module_manager

    def userSettings(self) -> UserSettings:  # noqa: N802
        """What is kept for the next start."""
        return self._settings

    def testingEnabled(self) -> bool:  # noqa: N802
        """Questions are answered by OK, and messages are not shown."""
        return True

    def topLevelWidgets(self) -> list[QWidget]:  # noqa: N802
        """All windows."""
        return self._qt_application.topLevelWidgets()

    def processEvents(self) -> None:  # noqa: N802
        """Let Qt do what is due."""
        self._qt_application.processEvents()


class UserSettings:
    """`slicer.app.userSettings()`: of a QSettings what the panel and Slicer's self-test use. They last as long as the host."""

    def __init__(self) -> None:
        # How long the messages of a self-test stay, in milliseconds.
        self._values = {"Developer/SelfTestDisplayMessageDelay": "0"}

    def value(self, key: str) -> str | None:
        """What was set, None for nothing."""
        return self._values.get(key)

    def setValue(self, key: str, value: str) -> None:  # noqa: N802
        """Keep a text."""
        assert type(value) is str
        self._values[key] = value


class ModuleManager:
    """`slicer.app.moduleManager()`."""

    def __init__(self) -> None:
        self._slots: list[Callable[[str], None]] = []

    def connect(self, signal: str, slot: Callable[[str], None]) -> None:
        """Call back before a module is unloaded."""
        assert signal == "moduleAboutToBeUnloaded(QString)"
        self._slots.append(slot)

    def disconnect(self, signal: str, slot: Callable[[str], None]) -> None:
        """Call back no longer."""
        self._slots.remove(slot)

    def unload(self, name: str) -> None:
        """Announce that the application lets go of a module."""
        for slot in list(self._slots):
            slot(name)


class Representation(QWidget):
    """The widget that the application puts a module's panel in: it calls what the class of the module's file has now."""

    def __init__(self) -> None:
        super().__init__()
        QVBoxLayout(self)
        self.python_widget: Any = None
        self.panel: QVBoxLayout | None = None
        self._entered = False
        self._former_items: list[QLayoutItem] = []

    isEntered = Property(bool, lambda self: self._entered)  # noqa: N815

    def self(self) -> Any:
        """The module's own widget class's object."""
        return self.python_widget

    def reload(self) -> None:
        """Make the panel from the module's class, as it is now. Nobody is told whether the module is open."""
        self.python_widget = sys.modules[NAME].ViTTransferFunctionWidget(self)
        slicer.modules.ViTTransferFunctionWidget = self.python_widget
        self.python_widget.setup()

    def put_into_panel(self) -> None:
        """Lay it in the module panel, if there is one, above what keeps modules at the panel's top."""
        if self.panel is not None and self.panel.indexOf(self) < 0:
            self.panel.insertWidget(0, self, 1)
            self.setVisible(True)

    def _take_out_of_panel(self) -> None:
        if self.panel is not None and (index := self.panel.indexOf(self)) >= 0:
            # The layout's item is lost, but not deleted: the next one will not be told when the panel wants another height.
            if (item := self.panel.takeAt(index)) is not None:
                self._former_items.append(item)
            self.setVisible(False)
            self.setParent(None)

    def delete(self) -> None:
        """Delete the widget, and before it what knows it."""
        self._former_items.clear()
        shiboken6.delete(self)

    def enter(self) -> None:
        """The user opens the module."""
        assert not self._entered
        self._entered = True
        self.put_into_panel()
        self.python_widget.enter()

    def exit(self) -> None:
        """The user goes to another module."""
        assert self._entered
        self._entered = False
        self.python_widget.exit()
        self._take_out_of_panel()


def _load_module() -> None:
    spec = importlib.util.spec_from_file_location(NAME, MODULE_FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[NAME] = module
    spec.loader.exec_module(module)


def _read_properties_as_pythonqt_does() -> None:
    """In the module's files and in Slicer's, `button.checked` is a value, and setting it sets it."""
    # PySide looks through all modules that are loaded, and some of PyTorch's fail when they are.
    hidden = {name: sys.modules.pop(name) for name in list(sys.modules) if name.partition(".")[0] == "torch"}
    parts = (f"{NAME}.Widget.{path.stem}" for path in (MODULE_FILE.parent / "Widget").glob("*.py"))
    for name in ("slicer.util", NAME, *parts):
        exec("from __feature__ import true_property", {"__name__": name})
    sys.modules.update(hidden)
