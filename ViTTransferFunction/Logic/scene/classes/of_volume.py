"""Which volume a node of ours belongs to: a class's points, a segmentation. With another volume, it is not seen.

The reference to the volume is saved with the node, and is empty where the volume is gone.
"""

from __future__ import annotations

from typing import Any

from .class_attributes import attribute, set_attribute

VOLUME_ROLE = "ViTTransferFunctionVolume"
"""Reference to the volume that they are of; where that is gone, it refers to none."""

_AWAY = "away"
"""Attribute of what was put away: whether it was "shown" or "hidden" before."""


def volume_of(node: Any) -> Any:
    """The volume that a node belongs to; None where it belongs to none, or to one that is gone."""
    return node.GetNodeReference(VOLUME_ROLE)


def set_volume_of(node: Any, volume: Any) -> None:
    """Have a node belong to a volume."""
    node.SetNodeReferenceID(VOLUME_ROLE, volume.GetID())


def put_away(node: Any) -> None:
    """Show a node no longer, until `bring_back`; what the user does about it meanwhile stays so."""
    if attribute(node, _AWAY) is not None:
        return
    display = node.GetDisplayNode()
    shown = display is not None and bool(display.GetVisibility())
    set_attribute(node, _AWAY, "shown" if shown else "hidden")
    if shown:
        display.SetVisibility(False)


def bring_back(node: Any) -> None:
    """Show a node again that was put away, unless it was hidden before."""
    before = attribute(node, _AWAY)
    if before is None:
        return
    set_attribute(node, _AWAY, None)
    if before == "shown":
        node.CreateDefaultDisplayNodes()
        node.GetDisplayNode().SetVisibility(True)
