"""Points of all structures, in files from which `vittf segment` and `vittf cohort` compute the same, and from other scans."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import qt
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.system.file_names import kept_name, with_ending
from ViTTransferFunction.Logic.files.annotation_files import ANNOTATIONS_ENDING, read_annotations, write_annotations
from ViTTransferFunction.Widget.pictures_section import ask_path_to_read, ask_path_to_write
from ViTTransferFunction.Widget.section import Report, Section
from ViTTransferFunction.Widget.wording import in_menu


class PointsSection(Section):
    """The buttons that save points, load them, and take over those of another scan of the scene.

    Args:
        ui: the widgets of the panel, by name.
        report: shows an error to the user.
        on_saved: called when points were saved.
    """

    def __init__(self, ui: Any, report: Report, on_saved: Callable[[], None]) -> None:
        super().__init__(ui, report)
        self._on_saved = on_saved
        self._scans_menu = qt.QMenu(ui.takeOverButton)
        ui.takeOverButton.setMenu(self._scans_menu)
        ui.savePointsButton.clicked.connect(lambda: self.attempt(self._save))
        ui.loadPointsButton.clicked.connect(lambda: self.attempt(self._load))
        self._scans_menu.aboutToShow.connect(self._list_scans)

    def refresh(self) -> None:
        """Enable what can be done now."""
        session = self.session
        classes = session.classes if session else ()
        with_volume = session is not None and session.parameters.volume is not None
        self.ui.loadPointsButton.enabled = with_volume
        self.ui.savePointsButton.enabled = with_volume and any(state.positive for state in classes)
        self.ui.takeOverButton.visible = with_volume and bool(self._scans)

    @property
    def _scans(self) -> dict[str, str]:
        return self.session.other_scans.names if self.session else {}

    def _list_scans(self) -> None:
        self._scans_menu.clear()
        for scan, name in self._scans.items():
            self._offer(scan, name)

    def _offer(self, scan: str, name: str) -> None:
        self._scans_menu.addAction(in_menu(name)).triggered.connect(lambda: self.attempt(lambda: self._take_over(scan)))

    def _take_over(self, scan: str) -> None:
        assert self.session is not None
        self.session.other_scans.take_over(scan)

    def _save(self) -> None:
        assert self.session is not None
        classes, volume = self.session.file_classes.annotated(), self.session.parameters.volume
        # As `vittf cohort` looks for it beside the scan.
        name = kept_name(volume.GetName() or "") + ANNOTATIONS_ENDING
        chosen = ask_path_to_write(_("Save points"), name, _kinds(), self.ui.savePointsButton)
        if chosen:
            write_annotations(classes, with_ending(Path(chosen), (".json",)))
            self._on_saved()

    def _load(self) -> None:
        assert self.session is not None
        geometry = self.session.file_classes.geometry
        chosen = ask_path_to_read(_("Load points"), _kinds(), self.ui.loadPointsButton)
        if chosen:
            self.session.file_classes.add(read_annotations(Path(chosen), geometry))


def _kinds() -> str:
    kinds: str = _("Points") + " (*.json)"
    return kinds
