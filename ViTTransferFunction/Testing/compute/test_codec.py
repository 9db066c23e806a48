"""Requests and replies become messages and come back as they were; nothing else is ever made from a message."""

from __future__ import annotations

import io
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute import requests
from ViTTransferFunction.Logic.compute.array_files import ArrayFiles
from ViTTransferFunction.Logic.compute.codec import from_message, holds, to_message
from ViTTransferFunction.Logic.compute.messages import Message, read_message, write_message
from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Logic.session.feature_estimate import FeatureEstimate, WeightsDownload
from ViTTransferFunction.Logic.session.settings import SessionSettings

GEOMETRY = Geometry((2, 3, 4), np.array([[0.0, -2.0, 0, 50], [3.0, 0, 0, -7], [0, 0, 4.0, 10], [0, 0, 0, 1.0]]))
ARRAY = np.arange(24, dtype=np.int16).reshape(2, 3, 4)
LIVER = ClassRequest("a", np.array([[1.0, 2.0, 3.0]]), iso=0.25, proximity=0.5, refine=False, name="Leber – größer")
SPLEEN = ClassRequest("b", np.array([[4.0, 5.0, 6.0]]), negative=np.array([[7.0, 8.0, 9.0], [0.1, 0.2, 0.3]]))
REFINEMENT = requests.Refinement("guided", only_annotated_components=False)
BODIES = [
    requests.TakeVolume(ARRAY, GEOMETRY, "CT"),
    requests.Taken("0f"),
    requests.ReleaseVolume(),
    requests.Prepare(SessionSettings(grid=16, window=(-100.0, 200.0), weights_path="/a b/c.pt")),
    requests.Extract(),
    requests.LookCloser((replace(LIVER, close_up=CloseUp((1.0, 2.5, -3.0), (40.0, 50.0, 60.5))), SPLEEN)),
    requests.ComputeMaps((LIVER, SPLEEN)),
    requests.MeasureMaps((LIVER, SPLEEN), only_annotated_components=False),
    requests.RefineMaps((LIVER,), REFINEMENT),
    requests.SegmentClasses((), REFINEMENT),
    requests.Render("transfer function", (True, False), (True, False), True),
    requests.Cancel((3, 4)),
    requests.Started(4711),
    requests.Done(),
    requests.Loaded("The disk is full."),
    requests.FirstMap(ClassMap(ARRAY.astype(np.float32), GEOMETRY, 0.5, prior=0.2)),
    requests.Maps((ClassMap(ARRAY.astype(np.float32), GEOMETRY, 0.5),)),
    requests.Volumes((2.5, 0.0)),
    requests.RefinedMaps((ClassMap(ARRAY.astype(np.uint8), GEOMETRY, 0.1),), (2.5,)),
    requests.Labels(ARRAY.astype(np.uint16), (1, 2, 3)),
    StructureVolume(np.zeros((2, 3, 4, 4), dtype=np.uint8), np.array([[10.0, 200.0]]), np.arange(256.0), True, 1.5, GEOMETRY),
    requests.Progressed(1, 2, "Computing features"),
    requests.CoarseFeatures(),
    requests.GivenUp(),
    requests.Failed("'CT' is constant."),
    FeatureEstimate(
        False, None, 10**10, WeightsDownload("dino", "Apache-2.0", "home", "https://meta", "/cache/dino.pth", 88, None)
    ),
]


def same(one: Any, other: Any) -> bool:
    """Whether two values are equal, arrays and their types included."""
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and one.dtype == other.dtype and np.array_equal(one, other)
    if is_dataclass(one):
        return type(one) is type(other) and all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, tuple):
        return isinstance(other, tuple) and len(one) == len(other) and all(map(same, one, other))
    return type(one) is type(other) and one == other


@pytest.mark.parametrize("body", BODIES, ids=lambda body: type(body).__name__)
def test_what_is_sent_arrives_as_it_was(body: Any, tmp_path: Path) -> None:
    files = ArrayFiles(tmp_path)
    stream = io.BytesIO()
    write_message(stream, to_message(7, body), files)
    stream.seek(0)
    message = read_message(stream, files)
    assert message is not None
    number, arrived = from_message(message)
    assert number == 7
    assert same(body, arrived)


def test_every_request_and_reply_can_be_sent() -> None:
    kinds = {kind for kind in vars(requests).values() if isinstance(kind, type) and kind.__module__ == requests.__name__}
    assert kinds - {requests.Refinement} <= {type(body) for body in BODIES}


def test_the_kind_is_known_without_making_anything() -> None:
    message = to_message(1, requests.Cancel((1,)))
    assert holds(message, requests.Cancel)
    assert not holds(message, requests.Extract)


@pytest.mark.parametrize("name", ["Popen", "Path", "builtins.eval", "ComputeClient"])
def test_nothing_is_made_but_requests_and_replies(name: str) -> None:
    with pytest.raises(ValueError, match=f"no such request or reply: {name}"):
        from_message(Message({"number": 1, "body": {"type": name, "values": {}}}))


@pytest.mark.parametrize(
    "content",
    [
        {"number": "1", "body": {"type": "Done", "values": {}}},
        {"number": 1.5, "body": {"type": "Done", "values": {}}},
        {"number": 1, "body": "Done"},
        {"number": 1, "body": [{"type": "Done", "values": {}}]},
        {"number": 1, "body": {"array": 0}},
        {"number": 1},
    ],
)
def test_a_message_that_is_no_request_and_no_reply_is_refused(content: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="no request or reply"):
        from_message(Message(content, (ARRAY,)))


def test_values_that_a_type_does_not_take_are_refused_in_its_own_words() -> None:
    message = to_message(1, requests.ComputeMaps((LIVER,)))
    message.content["body"]["values"]["classes"][0]["values"]["iso"] = 2.0
    with pytest.raises(InputError, match="'iso' of class 'Leber – größer' is 2"):
        from_message(message)
