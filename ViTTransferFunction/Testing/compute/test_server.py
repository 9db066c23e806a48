"""Requests to a real compute process, and what happens when it is cancelled or dies."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute.client import ComputeClient
from ViTTransferFunction.Logic.compute.messages import Message
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET
from ViTTransferFunction.Testing.session.test_segmentation_session import centre_ras, dice
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features

SETTINGS: dict[str, Any] = {
    "preset_name": DEFAULT_PRESET,
    "grid": GRID,
    "window": None,
    "model": None,
    "weights_path": None,
    "device": "cpu",
}


@pytest.fixture
def client() -> Iterator[ComputeClient]:
    client = ComputeClient()
    yield client
    client.close()


def reply_to(client: ComputeClient, number: int) -> Message:
    """The final reply to a request; its progress is skipped."""
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        for reply in client.replies():
            if reply.content["request"] == number and reply.content["reply"] != "progress":
                return reply
        assert client.alive, client.last_words()
        time.sleep(0.005)
    raise TimeoutError


def open_spheres(client: ComputeClient, spheres: tuple[Volume, np.ndarray]) -> None:
    volume, labels = spheres
    cache_known_features(volume, labels)
    client.request("volume", [volume.array], ijk_to_ras=volume.geometry.ijk_to_ras.tolist(), name="spheres")
    prepared = reply_to(client, client.request("prepare", **SETTINGS))
    assert prepared.content["cached"]
    assert reply_to(client, client.request("extract")).content["cached"]


def classes_of(spheres: tuple[Volume, np.ndarray]) -> list[dict[str, object]]:
    return [{"name": f"sphere {n}", "positive": centre_ras(spheres, n).tolist()} for n in (1, 2, 3)]


def test_a_volume_is_segmented_from_clicks(client: ComputeClient, spheres: tuple[Volume, np.ndarray]) -> None:
    open_spheres(client, spheres)
    maps = reply_to(client, client.request("maps", classes=classes_of(spheres)))
    assert maps.arrays[0].shape == (3, 16, 13, 16)
    assert len(maps.content["isos"]) == 3
    arguments: dict[str, Any] = {"classes": classes_of(spheres), "method": "bilateral", "only_annotated": True}
    refined = reply_to(client, client.request("refine", **arguments))
    (labels,) = reply_to(client, client.request("segment", **arguments)).arrays
    for label in (1, 2, 3):
        assert dice(labels == label, spheres[1] == label) > 0.9
        told, crop = refined.content["maps"][label - 1], refined.arrays[label - 1]
        # The crop's iso-surface encloses what the label map holds.
        assert (crop / 255.0 >= told["iso"]).sum() == pytest.approx((labels == label).sum(), rel=0.02)


def test_bad_input_is_told_in_words_and_the_process_goes_on(client: ComputeClient, spheres: tuple[Volume, np.ndarray]) -> None:
    volume = spheres[0]
    constant = np.zeros_like(volume.array)
    matrix = volume.geometry.ijk_to_ras.tolist()
    refused = reply_to(client, client.request("volume", [constant], ijk_to_ras=matrix, name="empty"))
    assert refused.content["reply"] == "failed"
    assert "'empty' is constant" in refused.content["message"]
    assert reply_to(client, client.request("prepare", **SETTINGS)).content["reply"] == "failed"
    open_spheres(client, spheres)


def test_what_was_cancelled_is_not_done_and_what_follows_is(client: ComputeClient, spheres: tuple[Volume, np.ndarray]) -> None:
    open_spheres(client, spheres)
    arguments: dict[str, Any] = {"classes": classes_of(spheres), "method": "bilateral", "only_annotated": True}
    cancelled = [client.request("refine", **arguments) for _ in range(2)]
    client.cancel(cancelled)
    after = client.request("maps", classes=classes_of(spheres))
    replies: dict[int, str] = {}
    until = time.monotonic() + 60.0
    while len(replies) < 3 and time.monotonic() < until:
        for reply in client.replies():
            if reply.content["reply"] != "progress":
                replies[reply.content["request"]] = reply.content["reply"]
        time.sleep(0.005)
    assert replies[cancelled[1]] == "cancelled"
    assert replies[after] == "done"


def test_a_death_is_noticed_and_its_reason_known(client: ComputeClient) -> None:
    client.request("no such request")
    until = time.monotonic() + 60.0
    while client.alive and time.monotonic() < until:
        client.replies()
        time.sleep(0.01)
    assert not client.alive
    assert "no such request" in client.last_words()


def test_closing_ends_the_process_at_once_whatever_it_does(spheres: tuple[Volume, np.ndarray]) -> None:
    client = ComputeClient()
    open_spheres(client, spheres)
    client.request("refine", classes=classes_of(spheres), method="bilateral", only_annotated=True)
    began = time.monotonic()
    client.close()
    assert time.monotonic() - began < 5.0
    client.replies()
    assert not client.alive
