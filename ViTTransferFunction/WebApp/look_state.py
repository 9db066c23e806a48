"""What the page shows of the selected structure's transfer function: its numbers, and the histogram that they lie on."""

from __future__ import annotations

import base64
from typing import Any

from ..Logic.rendering.appearance import effective
from ..Logic.scene.session import SceneSession

NO_LOOK: dict[str, Any] = {"look": None, "histogram": ""}


def look_state(session: SceneSession) -> dict[str, Any]:
    """Values for trame's state, by name. They take their time, so they are for when somebody sees them.

    "look" has the intensities between which the selected structure gets brighter ("low", "high"), whether they are its own
    ("automatic"), the sliders in [0, 1], whether there is an inside that has edges ("inside"), and the axis of the histogram;
    "histogram" is the picture's address. Both are empty where no structure is selected, or it is not in 3D yet.
    """
    selected = session.selected_class
    window = session.views.window(selected) if selected else None
    histogram = session.views.histogram(selected) if selected else None
    picture = session.views.histogram_svg(selected) if selected else None
    if selected is None or window is None or histogram is None or picture is None:
        return NO_LOOK
    style = effective(session.views.look(selected))
    first, last = histogram.ends
    low, high = (round(end, histogram.decimals) for end in window)
    look = {
        "low": low,
        "high": high,
        "automatic": selected.look.low is None and selected.look.high is None,
        "tone": style.tone,
        "fade": 1.0 - style.low,
        "edges": style.edges,
        "inside": style.density > 0.0,
        "axis": {"min": first, "max": last, "step": histogram.step},
    }
    return {"look": look, "histogram": _address(picture)}


def _address(svg: str) -> str:
    """A picture as its own address: an image runs no scripts, and asks for nothing else."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode()}"
