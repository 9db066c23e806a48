"""Requests and replies as messages, and back: dataclasses of known types, whose fields are plain values and arrays."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from ..core.classes.class_map import ClassMap
from ..core.classes.class_request import ClassRequest
from ..core.classes.close_up import CloseUp
from ..core.classes.iso_proposals import IsoProposals
from ..core.volumes.geometry import Geometry
from ..rendering.structure_volume import StructureVolume
from ..session.feature_estimate import FeatureEstimate, WeightsDownload
from ..session.settings import SessionSettings
from . import requests
from .messages import Message

_TYPES: dict[str, type] = {
    kind.__name__: kind
    for kind in (
        requests.TakeVolume,
        requests.Taken,
        requests.ReleaseVolume,
        requests.Prepare,
        requests.Extract,
        requests.LookCloser,
        requests.ComputeMaps,
        requests.MeasureMaps,
        requests.RefineMaps,
        requests.SegmentClasses,
        requests.Render,
        requests.Cancel,
        requests.Started,
        requests.Done,
        requests.Loaded,
        requests.FirstMap,
        requests.Maps,
        requests.Volumes,
        requests.RefinedMaps,
        requests.Labels,
        requests.Progressed,
        requests.CoarseFeatures,
        requests.GivenUp,
        requests.Failed,
        requests.Refinement,
        ClassMap,
        ClassRequest,
        CloseUp,
        FeatureEstimate,
        Geometry,
        IsoProposals,
        SessionSettings,
        StructureVolume,
        WeightsDownload,
    )
}
"""All that is ever made from a message, whatever it says."""


def to_message(number: int, body: Any) -> Message:
    """A request or a reply as a message.

    Args:
        number: of the request.
        body: a dataclass of `requests`.
    """
    arrays: list[np.ndarray] = []
    return Message({"number": number, "body": _encoded(body, arrays)}, tuple(arrays))


def from_message(message: Message) -> tuple[int, Any]:
    """Number of the request, and the request or reply itself.

    Raises:
        InputError: a value in it is not one that its type takes.
        ValueError: it is not a message of ours.
    """
    try:
        number, body = message.content["number"], _decoded(message.content["body"], message.arrays)
    except (LookupError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise _stranger(message) from error
    if not isinstance(number, int) or type(body) not in _TYPES.values():
        raise _stranger(message)
    return number, body


def holds(message: Message, kind: type) -> bool:
    """Whether a message's request or reply is of this type; nothing is made of it yet."""
    body = message.content.get("body")
    return isinstance(body, dict) and body.get("type") == kind.__name__


def _stranger(message: Message) -> ValueError:
    return ValueError(f"no request or reply: {str(message.content)[:100]}")


def _encoded(value: Any, arrays: list[np.ndarray]) -> Any:
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, (list, tuple)):
        return [_encoded(entry, arrays) for entry in value]
    if is_dataclass(value):
        values = {field.name: _encoded(getattr(value, field.name), arrays) for field in fields(value)}
        return {"type": type(value).__name__, "values": values}
    return value


def _decoded(value: Any, arrays: tuple[np.ndarray, ...]) -> Any:
    if isinstance(value, list):
        return tuple(_decoded(entry, arrays) for entry in value)
    if isinstance(value, dict) and "array" in value:
        return arrays[value["array"]]
    if isinstance(value, dict):
        values = {name: _decoded(entry, arrays) for name, entry in value["values"].items()}
        return _type(value["type"])(**values)
    return value


def _type(name: str) -> type:
    if name not in _TYPES:
        raise ValueError(f"no such request or reply: {name}")
    return _TYPES[name]
