"""The panel: its parts, the session that they show, and the timer that has the session take in what was computed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import qt
import slicer

from ViTTransferFunction.Logic.scene.classes import ClassState
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Widget.advanced_section import AdvancedSection
from ViTTransferFunction.Widget.annotation_tools import AnnotationTools
from ViTTransferFunction.Widget.class_settings import ClassSettings
from ViTTransferFunction.Widget.class_table import ClassTable
from ViTTransferFunction.Widget.message_area import MessageArea
from ViTTransferFunction.Widget.output_section import OutputSection
from ViTTransferFunction.Widget.parameters import BoundParameters
from ViTTransferFunction.Widget.pytorch_section import PyTorchSection
from ViTTransferFunction.Widget.shortcuts import Shortcuts
from ViTTransferFunction.Widget.volume_section import VolumeSection

POLL_MS = 20
"""How often the session is asked for news while something runs."""
IDLE_POLL_MS = 500
"""And while nothing does: soon enough to tell that the compute process was lost."""


class Panel:
    """Everything below the module's title.

    Args:
        ui: the widgets of the panel, by name.
        window: in which shortcuts work.
        icons: folder with the tools' icons.

    Attributes:
        session: the session that is shown; None while the scene is being closed.
        tools: what places, brushes and erases.
        shortcuts: the keys.
    """

    def __init__(self, ui: Any, window: Any, icons: Path) -> None:
        self.session: SceneSession | None = None
        self._ui = ui
        self._bound: BoundParameters | None = None
        self._messages = MessageArea(ui)
        report = self._report
        self.tools = AnnotationTools(ui, report)
        self._table = ClassTable(ui, report, on_added=self._on_class_added)
        self._sections = (
            PyTorchSection(ui, report, on_installed=self.refresh),
            VolumeSection(ui, report),
            self._table,
            self.tools,
            ClassSettings(ui, report),
            OutputSection(ui, report),
            AdvancedSection(ui, report),
        )
        self.shortcuts = Shortcuts(ui, window, self._actions())
        for name in ("PointOn", "PointOff", "BrushOn", "BrushOff", "Eraser", "Undo", "Redo", "RemoveLast"):
            getattr(ui, f"{name[0].lower()}{name[1:]}Button").icon = qt.QIcon(str(icons / f"{name}.svg"))
        self._timer = qt.QTimer()
        self._timer.timeout.connect(self._on_timer)
        self.refresh()

    def open(self, parameter_node: slicer.vtkMRMLScriptedModuleNode) -> None:
        """Show the state that a parameter node holds."""
        self.close()
        self.session = SceneSession(slicer.mrmlScene, slicer.app.applicationLogic(), parameter_node)
        self.session.add_observer(self.refresh)
        for section in self._sections:
            section.session = self.session
        self.bind_parameters()
        self.refresh()

    def close(self) -> None:
        """Stop what runs and show nothing; what the user decided stays in the scene."""
        self.tools.put_down()
        self.release_parameters()
        self._timer.stop()
        if self.session is not None:
            self.session.close()
            self.session = None
            for section in self._sections:
                section.session = None
            self.refresh()

    def bind_parameters(self) -> None:
        """Keep widgets and parameter node equal."""
        if self.session is not None and self._bound is None:
            self._bound = BoundParameters(self.session.parameters, self._ui)

    def release_parameters(self) -> None:
        """Leave widgets and parameter node to themselves, while the node is in the hands of others."""
        if self._bound is not None:
            self._bound.release()
            self._bound = None

    def refresh(self) -> None:
        """Show everything as it is now."""
        session = self.session
        error = session.take_error() if session else None
        if session and error:
            self._messages.show(error, lambda: self.session is not session or error not in session.errors)
        self._messages.refresh()
        for section in self._sections:
            section.refresh()
        self._set_pace()

    def _report(self, message: str, solved: Callable[[], bool] | None = None) -> None:
        """Show why something that the user asked for was not done; by default until the structures are changed next."""
        before = self.session, self._classes()
        self._messages.show(message, solved or (lambda: (self.session, self._classes()) != before))

    def _classes(self) -> tuple[ClassState, ...]:
        return self.session.classes if self.session else ()

    def _set_pace(self) -> None:
        if self.session is None:
            return
        pace_ms = POLL_MS if self.session.busy else IDLE_POLL_MS
        if not self._timer.active or self._timer.interval != pace_ms:
            self._timer.interval = pace_ms
            self._timer.start()

    def _on_timer(self) -> None:
        if self.session is not None:
            self.session.poll()
            self._set_pace()

    def _on_class_added(self) -> None:
        """The next click in a view is the first point."""
        if self.tools.tool != "pointOn":
            self.tools.toggle("pointOn")

    def _actions(self) -> dict[str, Any]:
        tools = self.tools
        return {
            "pointOn": lambda: tools.toggle("pointOn"),
            "pointOff": lambda: tools.toggle("pointOff"),
            "brushOn": lambda: tools.toggle("brushOn"),
            "brushOff": lambda: tools.toggle("brushOff"),
            "eraser": lambda: tools.toggle("eraser"),
            "putDown": tools.put_down,
            "undo": tools.undo,
            "redo": tools.redo,
            "removeLast": tools.remove_last,
            "previousClass": lambda: self._table.select_neighbour(-1),
            "nextClass": lambda: self._table.select_neighbour(+1),
        }
