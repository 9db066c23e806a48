"""The rooms of the Logic and the arrows between them, written down once: the test of the walls and the drawing go by it."""

from __future__ import annotations

import sys

ARROWS: dict[str, tuple[str, ...]] = {
    "core": (),
    "files": ("core",),
    "weights": ("core",),
    "features": ("core", "weights"),
    "similarity": ("core", "features"),
    "refinement": ("core",),
    "rendering": ("core",),
    "session": ("core", "weights", "features", "similarity", "refinement"),
    "compute": ("core", "features", "refinement", "rendering", "session"),
    "scene": ("core", "weights", "features", "refinement", "rendering", "session", "compute"),
}
"""Room → the rooms that its files may import."""

FRONT_ENDS: dict[str, tuple[str, ...]] = {
    "Widget": ("core", "files", "weights", "features", "refinement", "rendering", "session", "scene"),
    "WebApp": ("core", "files", "rendering", "session", "scene"),
    "CommandLine": tuple(ARROWS),
}
"""Folder beside the Logic → the rooms that its files may import. Of each other, only `CommandLine` knows `WebApp`."""

KNOWS_MRML = {"scene"}
"""Rooms that know VTK and Slicer's scene, and no PyTorch; all others are the other way round."""

CONTENT = {
    "core": "volumes, geometry, cameras, intensities, requests and maps of classes, resampling, errors, progress, atomic files",
    "files": "volumes, annotations, segmentations, cameras and films from and to files",
    "weights": "the models, and where their weights come from",
    "features": "from a volume to its feature volume F",
    "similarity": "from annotations to maps S_L and thresholds",
    "refinement": "from S_L to S_H: intensity likelihood, bilateral solver, guided filter, threshold dynamics",
    "rendering": "from maps or masks to one volume of structures, and how it looks",
    "session": "one volume being segmented",
    "compute": "the process that computes, and its proxy",
    "scene": "all that knows MRML",
}


def drawing() -> str:
    """The rooms and their arrows as a Mermaid diagram, in Markdown."""
    boxes = [f'    {room}["<b>{room}</b><br/>{CONTENT[room]}"]' for room in ARROWS]
    arrows = [f"    {room} --> {entered}" for room, allowed in ARROWS.items() for entered in _direct(allowed)]
    return "\n".join(["```mermaid", "flowchart TB", *boxes, *arrows, "```"])


def _direct(allowed: tuple[str, ...]) -> list[str]:
    """Those that none of the others leads to: fewer arrows say the same."""
    led_to = {further for room in allowed for further in _reachable(room)}
    return [room for room in allowed if room not in led_to]


def _reachable(room: str) -> set[str]:
    return {step for entered in ARROWS[room] for step in (entered, *_reachable(entered))}


if __name__ == "__main__":
    sys.stdout.write(drawing() + "\n")
