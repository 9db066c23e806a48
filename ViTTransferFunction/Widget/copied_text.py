"""What users copy out of a label, without the marks that let its long words be broken."""

from __future__ import annotations

from typing import Any

import qt

from ViTTransferFunction.Widget.wording import without_breaks

_AS_COPIED = str.maketrans({"\u2029": "\n", "\u2028": "\n", "\u00a0": " "})
"""How Qt copies what a selection has between paragraphs and lines, and in place of spaces that are not broken."""


class CopiedText:
    """Mends the clipboard when something of a label was copied: a path is then the path, and opens.

    Args:
        label: shows a text that is `breakable`.
    """

    def __init__(self, label: Any) -> None:
        self._label = label
        self._clipboard: Any = None

    def watch(self) -> None:
        """Mend from now on what is copied."""
        if self._clipboard is None:
            self._clipboard = qt.QApplication.clipboard()
            self._clipboard.dataChanged.connect(self._on_copied)
            self._clipboard.selectionChanged.connect(self._on_selected)

    def leave(self) -> None:
        """Leave the clipboard alone."""
        if self._clipboard is not None:
            self._clipboard.dataChanged.disconnect(self._on_copied)
            self._clipboard.selectionChanged.disconnect(self._on_selected)
            self._clipboard = None

    def _on_copied(self) -> None:
        self._mend(qt.QClipboard.Clipboard)

    def _on_selected(self) -> None:
        """On Linux, what is selected is copied by that alone."""
        self._mend(qt.QClipboard.Selection)

    def _mend(self, mode: Any) -> None:
        selected = self._label.selectedText.translate(_AS_COPIED)
        mended = without_breaks(selected)
        # Other programs' texts are their own, and come here as well; what is mended comes once more.
        if mended != selected and self._clipboard.text(mode) == selected:
            self._clipboard.setText(mended, mode)
