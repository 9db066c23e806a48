"""Words for users, in their language where Slicer's application has it; elsewhere in English."""

from __future__ import annotations

try:
    from slicer.i18n import tr as tr
except ImportError:  # Slicer's scene without its application.

    def tr(text: str) -> str:
        """The text itself."""
        return text
