"""The panel: its sections, the session that they show, and the timer that polls the session."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import qt
import slicer

from ViTTransferFunction.Logic.scene.annotation_tool import TOOL_ICONS, TOOLS
from ViTTransferFunction.Logic.scene.classes.class_state import Classes
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Widget.advanced_section import AdvancedSection
from ViTTransferFunction.Widget.annotation_tools import AnnotationTools
from ViTTransferFunction.Widget.appearance_section import AppearanceSection
from ViTTransferFunction.Widget.class_actions import ClassActions
from ViTTransferFunction.Widget.class_settings import ClassSettings
from ViTTransferFunction.Widget.class_table import ClassTable
from ViTTransferFunction.Widget.close_up_controls import CloseUpControls
from ViTTransferFunction.Widget.copied_text import CopiedText
from ViTTransferFunction.Widget.message_area import ErrorReport, MessageArea
from ViTTransferFunction.Widget.output_section import OutputSection
from ViTTransferFunction.Widget.panel_height import PanelHeight
from ViTTransferFunction.Widget.parameters import BoundParameters
from ViTTransferFunction.Widget.pictures_section import PicturesSection
from ViTTransferFunction.Widget.points_section import PointsSection
from ViTTransferFunction.Widget.pytorch_installation import pytorch_is_installed
from ViTTransferFunction.Widget.pytorch_section import PyTorchSection
from ViTTransferFunction.Widget.remembered_weights import name_remembered_weights
from ViTTransferFunction.Widget.section_headers import SectionHeaders
from ViTTransferFunction.Widget.shortcut_help import ShortcutHelp
from ViTTransferFunction.Widget.shortcuts import Shortcuts
from ViTTransferFunction.Widget.size_controls import SizeControls
from ViTTransferFunction.Widget.spoken_names import name_as_labelled
from ViTTransferFunction.Widget.unsaved_points import UnsavedPoints
from ViTTransferFunction.Widget.views import DrawingOrder, points_of_3d_views, view_windows
from ViTTransferFunction.Widget.volume_section import VolumeSection

POLL_MS = 10
"""Interval at which the session is polled while something runs, in milliseconds."""
CLICK_POLL_MS = 2
"""The same while the answer to a click is under way."""
IDLE_POLL_MS = 500
"""The same while nothing runs: often enough to notice soon that the compute process has ended."""

SEGMENT_EDITOR = "SegmentEditor"
"""The module in which users correct segments."""

ICONS = (*TOOL_ICONS.values(), "Undo", "Redo", "RemoveLast")
"""Icons, by file name without ending; the buttons that have them are named after them."""


class Panel:
    """Everything below the module's title.

    Args:
        ui: the widgets of the panel, by name.
        window: the window in which shortcuts work.
        icons: folder with the icons of `ICONS`.

    Attributes:
        session: the session that is shown; None while the scene is being closed.
        tools: the tools that place, brush and erase points.
        size: the controls that make a structure smaller or larger.
        close_up: the controls for a closer look at a structure.
        shortcuts: the keyboard shortcuts.
        shortcut_help: the window that lists them.
    """

    def __init__(self, ui: Any, window: Any, icons: Path) -> None:
        self.session: SceneSession | None = None
        self._ui = ui
        self._bound: BoundParameters | None = None
        self._messages = MessageArea(ui)
        self._height = PanelHeight(ui.messageFrame.parent())
        self._copied = CopiedText(ui.messageLabel)
        self._headers = SectionHeaders(ui)
        name_as_labelled(ui)
        report = ErrorReport(self._messages, lambda: (self.session, self._classes()))
        self.tools = AnnotationTools(ui, report)
        self._table = ClassTable(ui, report, on_added=self._on_class_added)
        self._class_actions = ClassActions(ui, report, change_color=self._table.change_color)
        self.size = SizeControls(ui, report)
        self.close_up = CloseUpControls(ui, report)
        self._unsaved = UnsavedPoints(ui, report)
        self._volume = VolumeSection(ui, report, on_leave=self._unsaved.keep)
        self._sections = (
            PyTorchSection(ui, report, on_change=self._on_pytorch),
            self._volume,
            self._unsaved,
            self._table,
            self._class_actions,
            self.tools,
            ClassSettings(ui, report),
            AppearanceSection(ui, report),
            PicturesSection(ui, report),
            self.size,
            self.close_up,
            OutputSection(ui, report),
            PointsSection(ui, report, on_saved=self._unsaved.mark_saved),
            AdvancedSection(ui, report),
        )
        self.shortcut_help = ShortcutHelp(window)
        self.shortcuts = Shortcuts(ui, window, self._actions())
        for name in ICONS:
            getattr(ui, f"{name[0].lower()}{name[1:]}Button").icon = qt.QIcon(str(icons / f"{name}.svg"))
        self._start_due = False
        self._drawing = DrawingOrder()
        self._timer = qt.QTimer()
        self._timer.timeout.connect(self._on_timer)
        self._layout_manager = slicer.app.layoutManager()
        main_window = slicer.util.mainWindow()
        self._module_selector = main_window.moduleSelector() if main_window is not None else None
        self.refresh()

    def open(self, parameter_node: slicer.vtkMRMLScriptedModuleNode) -> None:
        """Show the state that a parameter node holds."""
        self.close()
        app_logic = slicer.app.applicationLogic()
        self.session = SceneSession(
            slicer.mrmlScene,
            app_logic,
            parameter_node,
            windows_3d=view_windows,
            points_3d=points_of_3d_views,
            have_views_wait=self._drawing.have_wait,
            may_compute=pytorch_is_installed,
        )
        self.session.add_observer(self.refresh)
        if self._layout_manager is not None:
            self._layout_manager.layoutChanged.connect(self._on_layout_changed)
        if self._module_selector is not None:
            self._module_selector.moduleSelected.connect(self._on_module_selected)
        self._start_due = True
        for section in self._sections:
            section.session = self.session
        self.bind_parameters()

    def close(self, is_asked: bool = True) -> None:
        """Stop what runs and show nothing; what the user decided stays in the scene.

        Args:
            is_asked: the user was asked whether to save the scene; otherwise, what is not saved is kept.
        """
        self.tools.put_down()
        self.shortcut_help.close()
        self.release_parameters()
        self._timer.stop()
        if self.session is not None:
            if self._layout_manager is not None:
                self._layout_manager.layoutChanged.disconnect(self._on_layout_changed)
            if self._module_selector is not None:
                self._module_selector.moduleSelected.disconnect(self._on_module_selected)
            self._unsaved.end(is_asked)
            self.session.close()
            self.session = None
            self._drawing.draw()
            for section in self._sections:
                section.session = None
            self.refresh()

    def take_input(self) -> None:
        """When the module is entered: handle keys, the wheel, new volumes and copying from messages, and watch colours."""
        self.shortcuts.install()
        self.size.take_wheel()
        self.tools.watch_colours()
        self.tools.end_unfinished()
        self._copied.watch()
        self._volume.offered.resume()

    def leave_input(self) -> None:
        """When the module is left: leave all of these to Slicer."""
        self.shortcuts.remove()
        self.size.leave_wheel()
        self.tools.leave_colours()
        self._copied.leave()
        self._volume.offered.pause()

    def bind_parameters(self) -> None:
        """Keep widgets and parameter node equal from now on, and end what was unfinished when the scene was saved."""
        if self.session is not None and self._bound is None:
            self._bound = BoundParameters(self.session.parameters, self._ui)
            name_remembered_weights(self.session.parameters)
            for message in self._bound.replaced:
                self._messages.show(message, partial(self._is_over, self.session))
            self.tools.end_unfinished()
            self.refresh()

    def release_parameters(self) -> None:
        """Stop keeping widgets and parameter node equal, while Slicer changes the node."""
        if self._bound is not None:
            self._bound.release()
            self._bound = None

    def refresh(self) -> None:
        """Show everything as it is now."""
        told = self._tell_errors()
        self._messages.refresh()
        for section in self._sections:
            section.refresh()
        if told:
            # A button that can no longer be pressed passes the keyboard on, and the panel is scrolled to who has it.
            self._messages.bring_into_sight()
        self._set_pace()

    def _tell_errors(self) -> bool:
        """Show the errors since the last call; returns whether there were any."""
        session, told = self.session, False
        while session and (error := session.take_error()):
            self._messages.show(error, partial(self._is_solved, session, error))
            told = True
        return told

    def _is_solved(self, session: SceneSession, error: str) -> bool:
        return self._is_over(session) or error not in session.errors

    def _is_over(self, session: SceneSession) -> bool:
        return self.session is not session

    def _classes(self) -> Classes:
        return self.session.classes if self.session else ()

    def _set_pace(self) -> None:
        if self.session is None:
            return
        pace_ms = (
            CLICK_POLL_MS if self.session.awaits_maps else POLL_MS if self.session.busy or self._unsaved.busy else IDLE_POLL_MS
        )
        if not self._timer.active or self._timer.interval != pace_ms:
            self._timer.interval = pace_ms
            self._timer.start()

    def _on_timer(self) -> None:
        session = self.session
        if session is None:
            return
        try:
            self._start_computing()
            session.poll()
            self._unsaved.advance()
            if not session.busy:
                # The session is not told of what views show: of a scan, say, that is dropped on them.
                self.tools.tell_of_other_scans()
                self._messages.refresh()
        except Exception as error:
            # The timer goes on, a hundred times a second; Slicer's console gets the traceback once.
            if session.tell_of_defect(error):
                raise
        finally:
            self._set_pace()

    def _on_layout_changed(self) -> None:
        # Its views are about to be shown.
        qt.QTimer.singleShot(0, self._look_in_new_views)

    def _look_in_new_views(self) -> None:
        if self.session is not None:
            self.session.views.look_in_new_views()

    def _on_module_selected(self, name: str) -> None:
        if self.session is not None:
            self.session.give_way_to_segments(name == SEGMENT_EDITOR)

    def _start_computing(self) -> None:
        """Start the compute process, once, at the first tick after the panel was opened: the user still chooses a volume."""
        if self.session is not None and self._start_due:
            self._start_due = False
            self.session.start_computing()

    def _on_pytorch(self) -> None:
        """An installation of PyTorch began or ended: if it is there now, take up the volume that was chosen without it."""
        session = self.session
        if session is not None and session.estimate is None and not session.busy and pytorch_is_installed():
            session.estimate_again()
        self.refresh()

    def _on_class_added(self) -> None:
        """The next click in a view is the first point."""
        if self.tools.tool != "pointOn":
            self.tools.toggle("pointOn")

    def _put_down(self) -> None:
        """Close the list of keys, which lies over the views; put the tool down if the list is not open."""
        if not self.shortcut_help.close():
            self.tools.put_down()

    def _actions(self) -> dict[str, Any]:
        tools = self.tools
        return {
            **{tool: partial(tools.toggle, tool) for tool in TOOLS},
            "putDown": self._put_down,
            "undo": tools.undo,
            "redo": tools.redo,
            "removeLast": tools.remove_last,
            "smaller": self.size.make_smaller,
            "larger": self.size.make_larger,
            "lookCloser": self.close_up.look_closer,
            "previousClass": lambda: self._table.select_neighbour(-1),
            "nextClass": lambda: self._table.select_neighbour(+1),
            "nextPoint": self._class_actions.show_next_point,
            "help": self.shortcut_help.toggle,
        }
