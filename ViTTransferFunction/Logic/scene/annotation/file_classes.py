"""The classes of the volume that is chosen, to annotation files and from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from ...core.classes.annotated_class import AnnotatedClass, scan_of
from ...core.system.errors import InputError
from ...core.volumes.geometry import Geometry
from ..classes.annotated_classes import annotated_classes, class_states, restored_states
from ..classes.class_state import ClassState
from ..interface.notices import Notices
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..volumes.opened_volume import OpenedVolume
from .annotations import SceneAnnotations
from .asked_maps import AskedMaps
from .scan_of_points import ScanOfPoints
from .selected_class import SelectedClass


class FileClasses:
    """Gives what files have of classes, and takes it.

    Args:
        parameters: say which volume.
        annotations: hold the classes.
        selected: which class.
        volume: as it was opened.
        maps: that were asked for.
        scan_of_points: knows which scan points were placed on.
        problems: are told what a file asks for that the user has to do.
        notices: front ends hear of that.
        on_model: is called with the model that restored classes were made with, "" if that is not known.
    """

    def __init__(
        self,
        parameters: SceneParameters,
        annotations: SceneAnnotations,
        selected: SelectedClass,
        volume: OpenedVolume,
        maps: AskedMaps,
        scan_of_points: ScanOfPoints,
        problems: Problems,
        notices: Notices,
        on_model: Callable[[str], None],
    ) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._selected = selected
        self._volume = volume
        self._maps = maps
        self._scan_of_points = scan_of_points
        self._problems = problems
        self._notices = notices
        self._on_model = on_model

    @property
    def geometry(self) -> Geometry:
        """The volume's grid as its file has it, without transforms of the scene: what annotation files speak of.

        Raises:
            InputError: there is no volume that could be annotated.
        """
        if self._parameters.volume is None or self._volume.content is None:
            raise InputError("There is no scan that the points could belong to; open it first.")
        return self._volume.content.geometry

    def annotated(self) -> list[AnnotatedClass]:
        """What is asked about the classes as they are now, for an annotation file: `vittf segment` asks the same by it.

        Points of other segments that count as outside are among it.

        Raises:
            InputError: there is no volume, no class has a point in it, or two classes have one name.
        """
        annotated = annotated_classes(self._annotations.classes, self._maps.requests, self.geometry)
        return [replace(each, placed_on=self._scan_of_points.thumbnail) for each in annotated]

    def to_keep(self) -> list[AnnotatedClass]:
        """As `annotated`, but none where no class has a point in the volume any more, or yet.

        Raises:
            InputError: two classes have one name.
        """
        has_points = any(self._maps.requests.of(state.id) is not None for state in self._annotations.classes)
        return self.annotated() if has_points else []

    def add(self, annotated: Sequence[AnnotatedClass]) -> None:
        """Add classes as an annotation file has them, unless they are there already, and select the first; one step for undo.

        Whose box is still to be chosen begins in the whole volume, and the user is told; as of points placed on another scan.

        Raises:
            InputError: there is no volume, no class, none that is not there already, two of one name, or a point outside the
                volume.
        """
        states = class_states(annotated, self._annotations.classes, self._parameters.volume, self.geometry)
        self._annotations.add_classes(states)
        self._scan_of_points.add([state.id for state in states], scan_of(annotated))
        self._selected.select(states[0].id)
        unchosen = [each.name for each in annotated if each.close_up_from_map]
        if unchosen:
            self._problems.put(
                "close-up",
                f"The file asks to look closer at {', '.join(unchosen)}. Select each, and press Look closer once it is shown; "
                "until then, it is looked at in the whole scan.",
            )
            self._notices.tell()

    def restore(self, annotated: Sequence[AnnotatedClass], model: str, opened: Sequence[ClassState]) -> None:
        """Have classes again that were not saved, in place of those that the scene was opened with; one step for undo.

        Args:
            annotated: as an annotation file has them.
            model: that they were made with; "": not known.
            opened: the classes that the scene was opened with (`restored_states`).

        Raises:
            InputError: there is no volume, nothing to restore that is not there already, or a point outside the volume.
        """
        states = restored_states(annotated, self._annotations.classes, opened, self._parameters.volume, self.geometry)
        self._on_model(model)
        self._annotations.set_classes(states)
