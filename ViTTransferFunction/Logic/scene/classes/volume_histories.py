"""Undo and redo of the classes of each volume: that of other volumes waits until theirs is chosen."""

from __future__ import annotations

from collections.abc import Callable

from .class_state import Classes
from .history import AnnotationHistory


class VolumeHistories:
    """The history of the chosen volume's classes, and those of the other volumes.

    While no volume is chosen, it is of the classes that belong to none.

    Attributes:
        volume_id: of the chosen volume; "" while there is none.
    """

    def __init__(self) -> None:
        self.volume_id = ""
        self._histories: dict[str, AnnotationHistory[Classes]] = {"": AnnotationHistory(())}

    @property
    def current(self) -> AnnotationHistory[Classes]:
        """That of the chosen volume."""
        return self._histories[self.volume_id]

    def restart(self, classes: Classes) -> None:
        """Forget all of them: the scene is another one, in which there are these classes."""
        self._histories = {self.volume_id: AnnotationHistory(classes)}

    def begin_anew(self, classes: Classes) -> None:
        """Forget what was done to the chosen volume's classes."""
        self._histories[self.volume_id] = AnnotationHistory(classes)

    def follow(self, volume_id: str, before: Classes, classes: Classes) -> bool:
        """Take up the history of the volume that is chosen now; returns whether that is another one.

        Args:
            volume_id: of the volume.
            before: the classes of the one that was chosen until now.
            classes: of this one.
        """
        left, self.volume_id = self.volume_id, volume_id
        if volume_id == left:
            return False
        if not left:
            # Classes without a volume go to the one that is chosen, and so does their undo.
            history = self._histories.pop(left)
            if [state.id for state in before] == [state.id for state in classes]:
                self._histories.setdefault(volume_id, history)
        self._histories.setdefault(volume_id, AnnotationHistory(classes))
        self.current.seal()
        self.current.record(classes)  # Somebody may have changed them in another module meanwhile.
        return True

    def forget(self, volume_id: str) -> None:
        """Forget that of a volume which is not chosen."""
        self._histories.pop(volume_id, None)

    def keep(self, is_there: Callable[[str], bool]) -> None:
        """Forget those of volumes that are not there any more: another one may get the identifier of one that is gone."""
        self._histories = {id_: history for id_, history in self._histories.items() if not id_ or is_there(id_)}
