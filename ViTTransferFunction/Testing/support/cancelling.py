"""A user who cancels as soon as there is progress."""

from __future__ import annotations

from ViTTransferFunction.Logic.core.system.errors import Cancelled


def cancel_at_once(done: int, total: int, what: str) -> None:
    """Progress that cancels the work which reports it."""
    raise Cancelled
