"""What a volume's features cost, how far they are, and what has to be downloaded for them: in words for users."""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from ..core.volumes.missing_intensity import without_intensity_text
from ..session.feature_estimate import FeatureEstimate, WeightsDownload
from .interface.number_texts import duration, size
from .interface.translation import tr as _
from .mrml.nodes import in_text
from .volumes.volume_content import Frame

if TYPE_CHECKING:
    from .session import SceneSession

MOST_POINT_WARNINGS = 5
"""Lines of warnings about points: the table of structures is below them, and is to stay in sight."""


def cost_text(session: SceneSession) -> str:
    """What the features will cost, in a few words; "" where that cannot be said: messages tell why."""
    if session.estimate is None:
        return _("Estimating…") if session.busy else ""
    return estimate_text(session.estimate, session.frame)


def estimate_text(estimate: FeatureEstimate, frame: Frame | None = None) -> str:
    """What an estimate says, of a frame where the volume is a sequence."""
    if estimate.cached:
        return _("Computed before: ready at once.")
    parts = [_("{memory} of memory").format(memory=size(estimate.memory_bytes))]
    if estimate.seconds is not None:
        parts.insert(0, _("About {time}").format(time=duration(estimate.seconds)))
    if estimate.download is not None:
        parts.append(_("{download} to download").format(download=size(estimate.download.size_mb * 1e6)))
    cost = ", ".join(parts) + "."
    return _("{frame}: {cost}").format(frame=frame_text(frame), cost=cost) if frame else cost


def frame_text(frame: Frame) -> str:
    """Which frame of a sequence."""
    return _("Frame {number} of {count}").format(number=frame.number, count=frame.count)


def status_text(session: SceneSession | None, phase: str) -> str:
    """Of which voxels the features are, or ""."""
    if session is None or phase not in ("extracting", "ready"):
        return ""
    frame = frame_text(session.frame) if session.frame else ""
    if session.volume_changed:
        if phase == "extracting":
            return _("The image has changed meanwhile: its new features come next.")
        return _("The image has changed: its features follow when it stops changing.")
    if phase == "extracting":
        return frame
    return _("✔ Features are ready: {frame}").format(frame=frame) if frame else _("✔ Features are ready")


def missing_text(session: SceneSession) -> str:
    """What points get without the features, and what with them; "" where these are not to be computed, or nothing waits."""
    to_compute = session.phase == "no features" and session.estimate is not None and not session.estimate.cached
    if not to_compute or not any(state.positive for state in session.classes):
        return ""
    if any(session.chosen_iso(state.id) is not None for state in session.classes):
        return _(
            "What is shown is of coarse features, and rough: compute the features to the end for finer structures, and to "
            "create segments."
        )
    return _("Points show their structure once the features are computed.")


def point_warnings(session: SceneSession) -> list[str]:
    """What is wrong with where points lie: a line for each structure that it is true of, and `MOST_POINT_WARNINGS` at most.

    All structures are concerned if points are used with a scan that they were not placed on.
    """
    names = {state.id: in_text(state.name) for state in session.classes}
    beyond, missing = (
        {names[id_]: count for id_, count in counts.items() if id_ in names}
        for counts in (session.points_beyond, session.points_without_intensity)
    )
    warnings = [
        *(_points_beyond_text(name, count) for name, count in beyond.items()),
        *(f"⚠ {name}: {without_intensity_text(count)}" for name, count in missing.items()),
    ]
    if len(warnings) <= MOST_POINT_WARNINGS:
        return warnings
    told = warnings[: MOST_POINT_WARNINGS - 1]
    return [*told, _("⚠ {count} more warnings of this kind.").format(count=len(warnings) - len(told))]


def _points_beyond_text(name: str, count: int) -> str:
    """That points do not count."""
    if count == 1:
        return _("⚠ {name}: 1 point outside the volume does not count.").format(name=name)
    return _("⚠ {name}: {count} points outside the volume do not count.").format(name=name, count=count)


def download_question(download: WeightsDownload) -> str:
    """What there is to know about weights before they are downloaded."""
    return _(
        "To compute features, the weights of a neural network are needed, which are not on this computer yet.\n\n"
        "Model: {model} ({homepage})\n"
        "Licence: {licence}\n"
        "Download: {size}, once, from {site}\n"
        "Kept as: {target}\n"
        "SHA-256: {sha256}\n\n"
        "Nothing is uploaded: your images stay on this computer. Without a network, press Cancel, get the file on another "
        "computer from {url}, and choose it under Advanced, Weights.\n\n"
        "For research use only. This is not a medical device: do not base diagnosis or treatment on its results."
    ).format(
        model=download.model,
        homepage=download.homepage,
        licence=download.licence,
        size=size(download.size_mb * 1e6),
        site=urlsplit(download.url).hostname,
        target=download.target,
        sha256=download.sha256 or _("not published; the file that comes is trusted, and no other from then on"),
        url=download.url,
    )
