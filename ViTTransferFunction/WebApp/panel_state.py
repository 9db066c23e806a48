"""What the page shows of a session: values for trame's state, made anew from the session each time."""

from __future__ import annotations

import math
from typing import Any

from ..Logic.core.classes.colors import hex_color
from ..Logic.core.system.progress import WorkProgress
from ..Logic.scene.classes.class_size import stepped
from ..Logic.scene.classes.class_state import ClassState
from ..Logic.scene.feature_wording import cost_text, missing_text, point_warnings, status_text
from ..Logic.scene.interface.cache_contents import CacheContents
from ..Logic.scene.interface.message_texts import closer_look_text, outdated_text
from ..Logic.scene.interface.number_texts import progress_text, size_in_steps, threshold_text, volume_text, volume_unit
from ..Logic.scene.session import SceneSession
from ..Logic.scene.views.exported_renderings import exported_renderings
from .look_state import NO_LOOK, look_state

PARAMETERS = (
    "preset",
    "model",
    "weightsPath",
    "grid",
    "device",
    "refinement",
    "onlyAnnotatedParts",
    "respectOtherSegments",
    "otherSegmentsAreOutside",
    "overlayVisible",
    "overlayOpacity",
    "proposalsVisible",
    "rendering",
    "renderingSolo",
    "context",
    "contextStrength",
    "contextCutAway",
    "renderingCut",
)
"""Those of `SceneParameters` that the page shows and sets."""


def session_state(session: SceneSession, *, with_cache: bool, with_look: bool) -> dict[str, Any]:
    """Everything about the session that the page shows, by the names that the page's templates use.

    Args:
        session: which.
        with_cache: whether to look up what lies in the cache.
        with_look: whether to look at the selected structure's intensities.
    """
    selected = session.selected_class
    volume = session.parameters.volume
    return {
        "phase": session.phase,
        "busy": session.busy,
        "up_to_date": session.up_to_date,
        "volume_name": volume.GetName() if volume else "",
        "estimate": cost_text(session) if session.phase == "no features" else "",
        "missing": missing_text(session),
        "status": "\n".join([*filter(None, [status_text(session, session.phase)]), *point_warnings(session)]),
        "progress": _progress(session),
        "looks_closer": session.looks_closer,
        "classes": [_class(session, state) for state in session.classes],
        "volume_unit": volume_unit(session.body_scale),
        "selected": selected.id if selected else "",
        "settings": _settings(session, selected),
        "can_undo": session.annotations.can_undo,
        "can_redo": session.annotations.can_redo,
        "can_remove_last": selected is not None and bool(selected.positive or selected.negative),
        "annotated": any(state.positive for state in session.classes),
        "can_write": session.segments.can_write,
        "written": session.segments.exist,
        "outdated": outdated_text() if session.segments.outdated else "",
        "segments": [{"id": id_, "name": name} for id_, name in session.segments.names.items()],
        "segments_visible": _segments_visible(session),
        "exported": _exported(session),
        "parameters": {name: session.parameters.get(name) for name in PARAMETERS},
        "network_window": _network_window(session),
        "cache": _cache(session) if with_cache else None,
        "window": shown_window(volume),
        **(look_state(session) if with_look else NO_LOOK),
    }


def window_ends(low: float, high: float) -> dict[str, float]:
    """Both ends of a window of intensities, to four digits of its width: nobody sees more, and no more fit into a field."""
    digits = 3 - math.floor(math.log10(high - low)) if high > low else 3
    return {"low": round(low, max(0, digits)), "high": round(high, max(0, digits))}


def shown_window(volume: Any) -> dict[str, Any] | None:
    """In which intensities the slice views show the volume."""
    display = volume.GetScalarVolumeDisplayNode() if volume else None
    if display is None:
        return None
    return window_ends(display.GetWindowLevelMin(), display.GetWindowLevelMax())


def color_of_hex(text: str) -> tuple[float, float, float]:
    """The colour that HTML writes so. Raises ValueError where it is none."""
    if len(text) != 7 or text[0] != "#":
        raise ValueError(f"{text[:20]!r} is no colour")
    red, green, blue = (int(text[start : start + 2], 16) / 255.0 for start in (1, 3, 5))
    return red, green, blue


def _progress(session: SceneSession) -> dict[str, Any] | None:
    progress = session.progress
    if progress is None and session.phase == "extracting":
        progress = WorkProgress(0, 0, "Starting", None)
    if progress is None:
        return None
    share = min(1.0, progress.done / progress.total) if progress.total else None
    return {"share": share, "text": progress_text(progress)}


def _class(session: SceneSession, state: ClassState) -> dict[str, Any]:
    return {
        "id": state.id,
        "name": state.name,
        "color": hex_color(state.color),
        "visible": state.visible,
        "positive": len(state.positive),
        "negative": len(state.negative),
        "threshold": threshold_text(state.iso, session.chosen_iso(state.id)),
        "volume": volume_text(session.volume_ml(state.id), volume_unit(session.body_scale)),
    }


def _settings(session: SceneSession, selected: ClassState | None) -> dict[str, Any] | None:
    if selected is None:
        return None
    chosen = session.chosen_iso(selected.id)
    threshold = selected.iso if selected.iso is not None else chosen
    return {
        "opacity": selected.look.opacity,
        "style": selected.look.style,
        "threshold": None if threshold is None else round(threshold, 3),
        "automatic": selected.iso is None,
        "proximity": selected.proximity,
        "refine": selected.refine,
        "size": size_in_steps(selected.size, fixed=selected.iso is not None),
        "can_shrink": stepped(selected, -1) != selected,
        "can_grow": stepped(selected, 1) != selected,
        "can_reset": selected.size != 0.0 or selected.iso is not None,
        "close_up": session.close_ups.text(selected),
        "close_up_hint": closer_look_text(session.close_up_hints.of(selected)),
        "can_look_closer": session.phase == "ready" and bool(selected.positive),
        "can_look_at_whole": selected.close_up is not None,
    }


def _segments_visible(session: SceneSession) -> bool:
    node = session.parameters.segmentation
    display = node.GetDisplayNode() if node else None
    return display is None or bool(display.GetVisibility())


def _exported(session: SceneSession) -> list[dict[str, str]]:
    """Renderings that were left to the scene."""
    volumes = exported_renderings(session.parameters.node.GetScene())
    return [{"id": volume.GetID(), "name": volume.GetName()} for volume in volumes]


def _network_window(session: SceneSession) -> dict[str, Any]:
    """The intensities that the network sees."""
    low, high = (round(end, 1) for end in session.parameters.window)
    return {"low": low, "high": high, "automatic": session.parameters.get("windowAutomatic")}


def _cache(session: SceneSession) -> dict[str, Any]:
    cache = CacheContents(session.parameters)
    return {
        "text": cache.text,
        "has_features": cache.has_features,
        "has_model": cache.has_model,
        "features_question": cache.features_question,
        "model_question": cache.model_question,
    }
