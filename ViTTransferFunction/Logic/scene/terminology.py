"""Standard codes (SNOMED CT) of anatomical structures, found by the name that a user gave."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import slicer
from vtkmodules.vtkCommonCore import vtkStringArray


def terminology_entry(terminologies_logic: Any, name: str) -> str | None:
    """Slicer's entry for the structure of that name, in whichever loaded terminology knows it first.

    Args:
        terminologies_logic: the logic of Slicer's module Terminologies.
        name: such as "liver" or "Left kidney"; upper and lower case and surrounding space do not matter.

    Returns:
        The serialised entry, as segments store it; None where no terminology knows the name.
    """
    wanted = name.strip().lower()
    if not wanted:
        return None
    for context in _contexts(terminologies_logic):
        entry = slicer.vtkSlicerTerminologyEntry()
        # Labels are lower-case and say the side, such as "left kidney"; code meanings know more structures, but no sides.
        if terminologies_logic.FindTypeInTerminologyBy3dSlicerLabel(context, wanted, entry) or _find_by_meaning(
            terminologies_logic, context, wanted, entry
        ):
            return terminologies_logic.SerializeTerminologyEntry(entry)
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
