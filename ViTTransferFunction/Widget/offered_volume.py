"""Has a session take up a volume where the user has chosen none: the one in the views, or else the only one there is."""

from __future__ import annotations

from typing import Any

import qt
import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.scene.mrml.nodes import in_text
from ViTTransferFunction.Logic.scene.mrml.observers import SceneObservers
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.offered_volume import choosable_volumes, offered_volume
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import geometry_from_node
from ViTTransferFunction.Widget.section import Report


class OfferedVolume:
    """Has a session without a volume take one up: when the module opens, and when another one is loaded or shown.

    Someone who chose to have none is left alone until then. Where what is shown is no volume to choose, it is told why.
    While the module is not open, nothing is taken up: of several series that are loaded one after the other, it would be the
    first, and Slicer shows the last.

    Args:
        app_logic: the application's logic, which knows what is shown.
        report: tells the user.
    """

    def __init__(self, app_logic: Any, report: Report) -> None:
        self._selection = app_logic.GetSelectionNode()
        self._report = report
        self._session: SceneSession | None = None
        self._known: tuple[Any, ...] = ()
        self._is_open = False
        self._observers = SceneObservers()

    def offer_to(self, session: SceneSession | None) -> None:
        """From now on, it is this session, or none."""
        if session is self._session:
            return
        self._observers.remove_all()
        self._session, self._known = session, ()
        if session is not None:
            self._watch()
            self._offer()

    def resume(self) -> None:
        """The module is open."""
        self._is_open = True
        self._offer()

    def pause(self) -> None:
        """The user goes to another module."""
        self._is_open = False

    def _watch(self) -> None:
        scene = slicer.mrmlScene
        events = (scene.NodeAddedEvent, scene.EndImportEvent, scene.EndBatchProcessEvent)
        self._observers.observe(self._selection, [("ModifiedEvent", self._offer_later)])
        self._observers.observe(scene, [(event, self._offer_later) for event in events])

    def _offer_later(self, *_: Any) -> None:
        # Whoever loads a volume is not done yet.
        qt.QTimer.singleShot(0, self._offer)

    def _offer(self) -> None:
        session = self._session
        if session is None or not self._is_open or slicer.mrmlScene.IsBatchProcessing():
            return
        shown, there = self._shown(), choosable_volumes(slicer.mrmlScene)
        known, self._known = self._known, (shown, *(node.GetID() for node in there))
        if self._known == known or session.parameters.volume is not None:
            return
        volume = offered_volume(slicer.mrmlScene, shown)
        if volume is not None:
            session.set_volume(volume)
        elif reason := _why_not(slicer.mrmlScene.GetNodeByID(shown) if shown else None):
            self._report(reason, solved=lambda: self._is_solved(shown))

    def _shown(self) -> str | None:
        """ID of the volume in the views, or, where none is there, of the label map."""
        return self._selection.GetActiveVolumeID() or self._selection.GetActiveLabelVolumeID()

    def _is_solved(self, shown: str | None) -> bool:
        session = self._session
        return session is None or session.parameters.volume is not None or self._shown() != shown


def _why_not(node: slicer.vtkMRMLVolumeNode | None) -> str:
    """Why a volume is not among those that can be chosen, as one in colour and a label map are not; "" for others."""
    if isinstance(node, slicer.vtkMRMLLabelMapVolumeNode):
        return _(
            "'{name}' is a label map: it says where structures are, and has no intensities to find them by. Load the scan "
            "itself. If this is the scan, load it again with 'LabelMap' unticked in the options of 'Add Data'."
        ).format(name=in_text(node.GetName() or ""))
    image = node.GetImageData() if node is not None else None
    try:
        if image is not None and image.GetNumberOfScalarComponents() > 1:
            geometry_from_node(node)
    except InputError as error:
        return str(error)
    return ""
