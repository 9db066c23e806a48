"""Selectors of nodes, which the keyboard reaches like any other list."""

from __future__ import annotations

from typing import Any

import qt
import slicer


def fill_selector(selector: Any) -> None:
    """Have a selector list the scene's nodes, and let Tab reach it and arrows choose.

    Slicer's has the list within it pass the keyboard on to its frame, which Tab leaves out and which has no use for keys: the
    arrows do nothing there, and Space closes the section around it.
    """
    selector.setMRMLScene(slicer.mrmlScene)
    selector.findChild(qt.QComboBox).setFocusProxy(None)
