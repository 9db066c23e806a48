"""The rooms of the Logic and the arrows between them, written down once: the test of the walls and the drawing go by it.

A room is a folder of files. `core` and `scene` are too large for one room and have several; those of `scene` that have no name
of their own, `scene/*.py`, are the room above the others.
"""

from __future__ import annotations

import sys

_CORE = ("core/system", "core/volumes", "core/classes")
_UNDER_SCENE = (
    "scene/mrml",
    "scene/interface",
    "scene/volumes",
    "scene/classes",
    "scene/segments",
    "scene/annotation",
    "scene/views",
    "scene/tools",
)

ARROWS: dict[str, tuple[str, ...]] = {
    "core/system": (),
    "core/volumes": ("core/system",),
    "core/classes": ("core/system", "core/volumes"),
    "files": _CORE,
    "weights": ("core/system", "core/volumes"),
    "features": ("core/system", "core/volumes", "weights"),
    "similarity": (*_CORE, "features"),
    "refinement": _CORE,
    "rendering": _CORE,
    "session": (*_CORE, "weights", "features", "similarity", "refinement"),
    "compute": (*_CORE, "features", "refinement", "rendering", "session"),
    "scene/mrml": ("core/system", "core/volumes"),
    "scene/interface": (*_CORE, "weights", "features", "refinement", "rendering", "session", "compute", "scene/mrml"),
    "scene/volumes": ("core/system", "core/volumes", "session", "compute", "scene/mrml", "scene/interface"),
    "scene/classes": (*_CORE, "rendering", "scene/mrml", "scene/interface", "scene/volumes"),
    "scene/segments": (*_CORE, "compute", "scene/mrml", "scene/interface", "scene/volumes", "scene/classes"),
    "scene/annotation": (
        *_CORE,
        "compute",
        "scene/mrml",
        "scene/interface",
        "scene/volumes",
        "scene/classes",
        "scene/segments",
    ),
    "scene/views": (
        *_CORE,
        "rendering",
        "session",
        "compute",
        "scene/mrml",
        "scene/interface",
        "scene/volumes",
        "scene/classes",
    ),
    "scene/tools": ("core/volumes", "core/classes", "scene/mrml", "scene/classes"),
    "scene": ("core/system", "core/volumes", "session", "compute", *_UNDER_SCENE),
}
"""Room → the rooms that its files may import."""

_ABOVE_SCENE = (
    *_CORE,
    "files",
    "rendering",
    "session",
    "scene",
    "scene/mrml",
    "scene/interface",
    "scene/volumes",
    "scene/classes",
    "scene/views",
    "scene/tools",
)

FRONT_ENDS: dict[str, tuple[str, ...]] = {
    "Widget": (*_ABOVE_SCENE, "scene/segments"),
    "WebApp": _ABOVE_SCENE,
    "CommandLine": (*_CORE, "files", "weights", "features", "refinement", "rendering", "session", "scene/views"),
}
"""Folder beside the Logic → the rooms that its files may import. Of each other, only `CommandLine` knows `WebApp`."""

KNOWS_MRML = {"scene", *_UNDER_SCENE}
"""Rooms that know VTK and Slicer's scene, and no PyTorch; all others are the other way round."""

CONTENT = {
    "core/system": "files that are whole or not at all, folders, memory, threads, errors, progress",
    "core/volumes": "volumes, geometry, orientation, intensities, resampling, cameras",
    "core/classes": "requests and maps of classes, close-ups, points that shapes stand for",
    "files": "volumes, annotations, segmentations, cameras and films from and to files",
    "weights": "the models, and where their weights come from",
    "features": "from a volume to its feature volume F",
    "similarity": "from annotations to maps S_L and thresholds",
    "refinement": "from S_L to S_H: intensity likelihood, bilateral solver, guided filter, threshold dynamics",
    "rendering": "from maps or masks to one volume of structures, and how it looks",
    "session": "one volume being segmented",
    "compute": "the process that computes, and its proxy",
    "scene/mrml": "nodes of the scene, whatever they are for",
    "scene/interface": "settings, keys and words of every front end; problems and notices",
    "scene/volumes": "volume nodes, and the one that is open",
    "scene/classes": "classes as values, and as lists of points",
    "scene/segments": "labels to segments, and what others made",
    "scene/annotation": "what the user does to classes and points",
    "scene/views": "slices, 3D, pictures and films",
    "scene/tools": "the mouse in a view",
    "scene": "a volume of the scene being segmented: what front ends talk to",
}


def drawing() -> str:
    """The rooms and their arrows as a Mermaid diagram, in Markdown."""
    halls: dict[str, list[str]] = {}
    for room in ARROWS:
        halls.setdefault(room.partition("/")[0], []).append(room)
    boxes = [line for hall, rooms in halls.items() for line in _boxes(hall, rooms)]
    arrows = [f"    {_id(room)} --> {_id(entered)}" for room, allowed in ARROWS.items() for entered in _direct(allowed)]
    return "\n".join(["```mermaid", "flowchart TB", *boxes, *arrows, "```"])


def _boxes(hall: str, rooms: list[str]) -> list[str]:
    """The rooms of a folder of the Logic: a box each, in a frame where they are several."""
    boxes = [f'    {_id(room)}["<b>{room}</b><br/>{CONTENT[room]}"]' for room in rooms]
    if len(rooms) == 1:
        return boxes
    return [f"    subgraph {hall}_rooms [{hall}]", *(f"    {box}" for box in boxes), "    end"]


def _id(room: str) -> str:
    return room.replace("/", "_")


def _direct(allowed: tuple[str, ...]) -> list[str]:
    """Those that none of the others leads to: fewer arrows say the same."""
    led_to = {further for room in allowed for further in _reachable(room)}
    return [room for room in allowed if room not in led_to]


def _reachable(room: str) -> set[str]:
    return {step for entered in ARROWS[room] for step in (entered, *_reachable(entered))}


if __name__ == "__main__":
    sys.stdout.write(drawing() + "\n")
