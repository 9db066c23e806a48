"""Points of all structures in a file, from which `vittf segment` and `vittf cohort` compute the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.file_names import kept_name, with_ending
from ViTTransferFunction.Logic.files.annotation_files import ANNOTATIONS_ENDING, read_annotations, write_annotations
from ViTTransferFunction.Widget.pictures_section import ask_path_to_read, ask_path_to_write
from ViTTransferFunction.Widget.section import Report, Section


class PointsSection(Section):
    """The buttons that save points and load them."""

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        ui.savePointsButton.clicked.connect(lambda: self.attempt(self._save))
        ui.loadPointsButton.clicked.connect(lambda: self.attempt(self._load))

    def refresh(self) -> None:
        """Enable what can be done now."""
        session = self.session
        classes = session.classes if session else ()
        with_volume = session is not None and session.parameters.volume is not None
        self.ui.loadPointsButton.enabled = with_volume
        self.ui.savePointsButton.enabled = with_volume and any(state.positive for state in classes)

    def _save(self) -> None:
        assert self.session is not None
        classes, volume = self.session.annotated_classes(), self.session.parameters.volume
        # As `vittf cohort` looks for it beside the scan.
        name = kept_name(volume.GetName() or "") + ANNOTATIONS_ENDING
        chosen = ask_path_to_write(_("Save points"), name, _kinds(), self.ui.savePointsButton)
        if chosen:
            write_annotations(classes, with_ending(Path(chosen), (".json",)))

    def _load(self) -> None:
        assert self.session is not None
        geometry = self.session.file_geometry
        chosen = ask_path_to_read(_("Load points"), _kinds(), self.ui.loadPointsButton)
        if chosen:
            self.session.add_annotated_classes(read_annotations(Path(chosen), geometry))


def _kinds() -> str:
    kinds: str = _("Points") + " (*.json)"
    return kinds
