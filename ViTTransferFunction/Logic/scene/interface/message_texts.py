"""Messages to the user that all front ends share."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from ...core.system.out_of_memory import OUT_OF_MEMORY, is_out_of_memory
from ..mrml.nodes import in_text
from .shortcuts import SHORTCUTS
from .translation import tr as _

CloserLookReason = Literal["vague extent", "small drawing", "small outline"]
"""Why a closer look may help, or, for the last one, why one has begun by itself; see `CloseUpHints`."""

_MOST_NAMES = 5
"""The most names of structures in one message."""
_LONGEST_REASON = 200
"""The most characters of an unexpected error in a message: those of some libraries fill pages."""


def closer_look_text(reason: CloserLookReason | None) -> str:
    """A hint that a closer look may help with a structure or has begun by itself, and why; "" if there is no reason."""
    if reason is None:
        return ""
    key = next(shortcut.key for shortcut in SHORTCUTS if shortcut.action == "lookCloser")
    words = {
        "vague extent": _(
            'In the whole scan, it is unclear how far this reaches. If it is small or thin, "Look closer" ({key}) may help.'
        ),
        "small drawing": _(
            'What you drew is smaller than four cells of the scan. If the structure is compact, "Look closer" ({key}) may help.'
        ),
        "small outline": _(
            'Small, and in the whole scan unlike your outline: so it is looked at closely. "Look at whole" leads back.'
        ),
    }
    return words[reason].format(key=key)


def empty_text(names: Sequence[str]) -> str:
    """A message about structures whose segments are empty."""
    return _(
        "Nothing was found of {names}: nothing is similar enough to the points, or all that is similar belongs to another "
        "structure. Choose a larger size, or check the points and place more of them."
    ).format(names=_listing(names))


def taken_text(names: Sequence[str]) -> str:
    """A message about structures whose segments are empty because other segments have all their voxels."""
    return _(
        "Nothing is left of {names}: all voxels belong to other segments. To have segments overlap, switch "
        '"Do not overlap other segments" off and create the segments again.'
    ).format(names=_listing(names))


def mostly_taken_text(names: Sequence[str]) -> str:
    """A message about structures of whose voxels other segments have more than half."""
    return _(
        "Less than half is left of {names}: most voxels belong to other segments. To have segments overlap, switch "
        '"Do not overlap other segments" off and create the segments again.'
    ).format(names=_listing(names))


def segmentation_removed_text(name: str) -> str:
    """A message that segments were not written, since their segmentation was removed."""
    return _(
        "The segmentation '{name}' was removed meanwhile, so no segments were written. Create them again, in a new one or in "
        "another that you choose."
    ).format(name=in_text(name))


def outdated_text() -> str:
    """A message about segments that do not show the latest changes of the structures."""
    return _("Not in the segments yet: the latest changes.")


def older_segments_text(segmentation_name: str) -> str:
    """A message about older segments, when the user comes back to a frame and has changed the structures for another one."""
    return _(
        "'{name}' is older than the structures, which were changed for another frame: Update segments would replace it. To "
        "keep it, choose New segmentation first."
    ).format(name=in_text(segmentation_name))


def left_behind_text(volume: str, names: Sequence[str], segmentation: str | None) -> str:
    """A message about points or segments that were not moved with the volume.

    Args:
        volume: its name.
        names: of the structures whose points stayed.
        segmentation: the name of the segmentation whose segments stayed; None: there is none.
    """
    if segmentation is None:
        text = _(
            "'{volume}' was moved, and the points of {names} were not: they lie elsewhere in it now. If that is not meant, put "
            "their lists under the same transform, in Slicer's module Data, or move the image back."
        )
    elif names:
        text = _(
            "'{volume}' was moved, and the points of {names} and the segments of '{segmentation}' were not: they lie elsewhere "
            "in it now. If that is not meant, put their lists and the segmentation under the same transform, in Slicer's "
            "module Data, or move the image back."
        )
    else:
        text = _(
            "'{volume}' was moved, and the segments of '{segmentation}' were not: they lie elsewhere in it now. Update the "
            "segments, put the segmentation under the same transform, in Slicer's module Data, or move the image back."
        )
    return text.format(volume=in_text(volume), names=_listing(names), segmentation=in_text(segmentation or ""))


def other_scan_text(volume: str) -> str:
    """A message about points in a volume that were placed on a scan that looks different."""
    return _(
        "Points in '{volume}' were placed on a scan that looks different, perhaps another patient's. Look where they lie "
        "before you trust what they give. If this is the wrong scan, open the right one; its file may have been replaced. If "
        "it is meant, go on, and correct the points."
    ).format(volume=in_text(volume))


def former_model_text(former: str, model: str) -> str:
    """A message about structures that were made with a model that is not available here."""
    return _(
        "The structures of this scene were made with the model {former}, whose weights are not on this computer. With "
        "{model} they come out otherwise. To have them as they were, get the weights of {former}, and choose them "
        "under Advanced. To go on with {model}, look at each structure again."
    ).format(former=former, model=model)


def not_saved_text(point_count: int, names: Sequence[str], when: str) -> str:
    """A message about unsaved points that were kept when the program ended unexpectedly.

    Args:
        point_count: the number of points.
        names: names of their structures.
        when: date and time at which they were kept.
    """
    if point_count == 1:
        text = _("1 point from {when} was not saved: {names}.")
    else:
        text = _("{count} points from {when} were not saved: {names}.")
    return text.format(count=point_count, when=when, names=_listing(names))


def not_kept_text(error: Exception) -> str:
    """A message that unsaved points cannot be kept on this computer, and why."""
    return _(
        "Points are not kept on this computer while you work, and are lost if the program ends before you save them. {error}"
    ).format(error=error)


def unusable_text(path: Path, error: Exception) -> str:
    """A message about kept points that cannot be read."""
    return _(
        "Points of this scan were not saved, and what was kept of them cannot be used. {error} The file stays where it is: "
        "{path}. Delete it, and you will not be told again."
    ).format(error=error, path=path)


def nothing_in_3d_text() -> str:
    """A message that there is no camera without structures in 3D: camera files are relative to them."""
    return _(
        "Cameras are relative to the structures in 3D, of which there are none. Place a point on a structure, and switch the "
        "3D views on."
    )


def not_in_slices_text(volume_name: str) -> str:
    """A message that no slice view shows the scan in which clicks place points, and what to do."""
    return _(
        "No slice view shows '{name}', which is segmented; clicks are points in it all the same. Show it by its eye in the "
        "module Data, or choose the scan that the views show."
    ).format(name=in_text(volume_name))


def no_structure_text(has_volume: bool) -> str:
    """A message for a user who takes a tool while there is no structure: what to do first."""
    if has_volume:
        return _("Points belong to a structure, and there is none yet: add a structure first.")
    return _("Points belong to a structure in a scan, and there is no scan yet: open one first, then add a structure.")


def nothing_hit_text() -> str:
    """Why a click in a 3D view placed no point."""
    return _("Nothing is shown there in the 3D view, so no point was placed: click on what is shown, or in a slice.")


def unexpected_text(error: Exception) -> str:
    """A message about an unexpected error in the background work."""
    if is_out_of_memory(error):
        return OUT_OF_MEMORY
    return _(
        "Something unexpected went wrong ({error}), and the views may not be up to date. Your structures and points are kept. "
        "If it happens again, save your work, start the program anew, and report this message."
    ).format(error=textwrap.shorten(f"{type(error).__name__}: {error}", _LONGEST_REASON, placeholder="…"))


def _listing(names: Sequence[str]) -> str:
    """Names in quotes, at most `_MOST_NAMES` of them."""
    quoted = [f"'{in_text(name)}'" for name in names[:_MOST_NAMES]]
    return ", ".join(quoted) + (" …" if len(names) > _MOST_NAMES else "")
