"""The window in which slice views show a volume: that of its display node."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.volumes.intensity_window import IntensityWindow, display_window
from .volume_nodes import volume_from_node


def set_window(node: Any, low: float, high: float) -> None:
    """Show a volume node in the slice views from black at `low` to white at `high`.

    Raises:
        InputError: that is no window.
    """
    window = IntensityWindow(low, high)
    display = node.GetScalarVolumeDisplayNode()
    display.SetAutoWindowLevel(False)
    display.SetWindowLevelMinMax(window.low, window.high)


def replace_impossible_window(node: Any) -> None:
    """Show a volume node in the window of its finite voxels where its own is none.

    Slicer chooses one from the range of all voxels, which is no number where one of them is infinite: the views stay black, and
    the panel has no window to begin with.

    Raises:
        InputError: the node is no scalar volume, or there is nothing to be seen in it.
    """
    display = node.GetScalarVolumeDisplayNode()
    if display is None or np.isfinite([display.GetWindowLevelMin(), display.GetWindowLevelMax()]).all():
        return
    window = display_window(volume_from_node(node))
    set_window(node, window.low, window.high)
