"""How large the brushes are that front ends offer: some millimetres in a scan of a body, and less in a small one."""

from __future__ import annotations

from ...core.volumes.measures import round_number

STEP_MM = 0.5
"""Of a body, from one size to the next; the form of the panel says it as well."""


def brush_scale(body_scale: float) -> float:
    """By what the sizes of the form are multiplied in a scan, so that its steps stay round numbers; 1 in that of a body.

    Args:
        body_scale: of lengths that are meant for bodies, in the scan.
    """
    # A scan that is turned is as large as before but for rounding errors.
    return round_number(1.000001 * body_scale * STEP_MM) / STEP_MM


def brush_size(size_mm: float, scale: float) -> float:
    """A size of the form in a scan whose sizes are multiplied by `scale`, without the digits that come of computing."""
    return round(size_mm * scale, 9)
