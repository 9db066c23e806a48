"""Standard codes (SNOMED CT) of anatomical structures, found by the name that a user gave."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import slicer
from vtkmodules.vtkCommonCore import vtkStringArray


class StandardCodes:
    """Slicer's entries for the names of structures, each looked for once: that takes some hundredths of a second.

    Args:
        app_logic: Slicer's application logic; None: no name is known.
    """

    def __init__(self, app_logic: Any | None) -> None:
        self._logic = app_logic.GetModuleLogic("Terminologies") if app_logic else None
        self._entries: dict[str, str | None] = {}

    def looked_for(self, name: str) -> bool:
        """Whether `entry` answers at once."""
        return self._logic is None or name in self._entries

    def entry(self, name: str) -> str | None:
        """The entry for the structure of that name, in whichever loaded terminology knows it first.

        Args:
            name: such as "liver" or "Left kidney"; upper and lower case and surrounding space do not matter.

        Returns:
            The serialised entry, as segments store it; None where no terminology knows the name.
        """
        if not self.looked_for(name):
            self._entries[name] = _find(self._logic, name.strip().lower())
        return self._entries.get(name)


def _find(logic: Any, wanted: str) -> str | None:
    if not wanted:
        return None
    for context in _contexts(logic):
        entry = slicer.vtkSlicerTerminologyEntry()
        # Labels are lower-case and say the side, such as "left kidney"; code meanings know more structures, but no sides.
        by_label = logic.FindTypeInTerminologyBy3dSlicerLabel(context, wanted, entry)
        if by_label or _find_by_meaning(logic, context, wanted, entry):
            serialised: str = logic.SerializeTerminologyEntry(entry)
            return serialised
    return None


def _contexts(logic: Any) -> list[str]:
    names = vtkStringArray()
    logic.GetLoadedTerminologyNames(names)
    return [names.GetValue(index) for index in range(names.GetNumberOfValues())]


def _find_by_meaning(logic: Any, context: str, wanted: str, entry: Any) -> bool:
    for category, kind in _types(logic, context):
        if kind.GetCodeMeaning().lower() == wanted:
            entry.SetTerminologyContextName(context)
            entry.GetCategoryObject().Copy(category)
            entry.GetTypeObject().Copy(kind)
            return True
    return False


def _types(logic: Any, context: str) -> Iterator[tuple[Any, Any]]:
    """Every category of a terminology with every type in it."""
    for category_index in range(logic.GetNumberOfCategoriesInTerminology(context)):
        category = slicer.vtkSlicerTerminologyCategory()
        logic.GetNthCategoryInTerminology(context, category_index, category)
        for type_index in range(logic.GetNumberOfTypesInTerminologyCategory(context, category)):
            kind = slicer.vtkSlicerTerminologyType()
            logic.GetNthTypeInTerminologyCategory(context, category, type_index, kind)
            yield category, kind
