"""Requests to a real compute process, and what happens when it is cancelled or dies."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute.client import ComputeClient
from ViTTransferFunction.Logic.compute.requests import (
    ComputeMaps,
    Extract,
    Failed,
    FirstMap,
    GivenUp,
    Labels,
    Loaded,
    LookCloser,
    Maps,
    MeasureMaps,
    Prepare,
    Progressed,
    RefinedMaps,
    RefineMaps,
    Refinement,
    Render,
    SegmentClasses,
    TakeVolume,
    Volumes,
)
from ViTTransferFunction.Logic.compute.service import SegmentationService
from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up_choice import close_up_of
from ViTTransferFunction.Logic.core.system.progress import no_progress
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.rendering.composition import DEPTH, INTENSITY, NUMBER, SURFACE
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Logic.session.feature_estimate import FeatureEstimate
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_close_up, cache_known_features
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.spheres import Spheres, requests_of

SETTINGS = SessionSettings(grid=GRID, device="cpu")


@pytest.fixture
def client() -> Iterator[ComputeClient]:
    client = ComputeClient()
    yield client
    client.close()


def reply_to(client: ComputeClient, number: int) -> Any:
    """The final reply to a request; its progress is skipped."""
    until = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < until:
        for of, reply in client.replies():
            if of == number and not isinstance(reply, Progressed):
                return reply
        assert client.alive, client.last_words()
        time.sleep(0.005)
    raise TimeoutError


def open_spheres(client: ComputeClient, spheres: Spheres) -> None:
    volume, _ = spheres
    cache_known_features(*spheres)
    client.request(TakeVolume(volume.array, volume.geometry, "spheres"))
    estimate = reply_to(client, client.request(Prepare(SETTINGS)))
    assert isinstance(estimate, FeatureEstimate)
    assert estimate.cached
    assert reply_to(client, client.request(Extract())) == Loaded("")


def test_a_volume_is_segmented_from_clicks(client: ComputeClient, spheres: Spheres) -> None:
    open_spheres(client, spheres)
    requests = requests_of(spheres)
    maps = reply_to(client, client.request(ComputeMaps(requests)))
    assert isinstance(maps, Maps)
    assert [low.array.shape for low in maps.maps] == [(16, 13, 16)] * 3
    refined = reply_to(client, client.request(RefineMaps(requests, Refinement())))
    labels = reply_to(client, client.request(SegmentClasses(requests, Refinement())))
    volumes = reply_to(client, client.request(MeasureMaps(requests)))
    assert isinstance(volumes, Volumes)
    assert isinstance(refined, RefinedMaps)
    assert isinstance(labels, Labels)
    assert labels.array.dtype == np.uint8
    assert labels.array.size < 0.7 * spheres[1].size
    box = tuple(slice(first, first + size) for first, size in zip(labels.first, labels.array.shape, strict=True))
    for label in (1, 2, 3):
        volume_ml = (labels.array == label).sum() * spheres[0].geometry.voxel_volume_mm3 / 1000.0
        assert refined.volumes_ml[label - 1] == pytest.approx(volume_ml)
        # Off by as much as a shell of half a cell.
        assert volumes.volumes_ml[label - 1] == pytest.approx(volume_ml, rel=0.5)
        assert dice(labels.array == label, spheres[1][box] == label) > 0.9
        crop = refined.maps[label - 1]
        # The crop's iso-surface encloses what the label map holds.
        assert (crop.array / 255.0 >= crop.iso).sum() == pytest.approx((labels.array == label).sum(), rel=0.02)


def test_the_map_that_is_waited_for_comes_first_and_is_the_same(client: ComputeClient, spheres: Spheres) -> None:
    open_spheres(client, spheres)
    requests = requests_of(spheres)
    client.request(ComputeMaps(requests, first=requests[1].id))
    replies: list[Any] = []
    until = time.monotonic() + LONGEST_WAIT_S
    while len(replies) < 2 and time.monotonic() < until:
        replies += [reply for _, reply in client.replies()]
        time.sleep(0.005)
    first, others = replies
    assert isinstance(first, FirstMap)
    assert len(others.maps) == 2
    reply_to(client, client.request(ComputeMaps(requests[:1])))
    together = reply_to(client, client.request(ComputeMaps(requests)))
    for one, other in zip((others.maps[0], first.map, others.maps[1]), together.maps, strict=True):
        np.testing.assert_allclose(one.array, other.array, atol=1e-5)
        assert one.iso == pytest.approx(other.iso, rel=1e-3)
    # What has been answered is not computed again, and there is nothing to wait for.
    assert len(reply_to(client, client.request(ComputeMaps(requests, first=requests[1].id))).maps) == 3


def test_what_was_refined_of_coarse_features_is_not_taken_for_what_finer_ones_give(spheres: Spheres) -> None:
    volume, labels = spheres
    asked = RefineMaps(requests_of(spheres)[:1], Refinement())

    def refined(service: SegmentationService, known: np.ndarray) -> ClassMap:
        cache_known_features(volume, known)
        service.serve(Extract())
        (refined,) = service.serve(asked).maps
        return refined

    two_extractions, one = (SegmentationService(no_progress) for _ in range(2))
    for service in (two_extractions, one):
        service.serve(TakeVolume(volume.array, volume.geometry, "spheres"))
        service.serve(Prepare(SETTINGS))
    # In the place of coarse features, whose finer ones were cancelled.
    refined(two_extractions, np.where(labels == 1, 0, labels))
    later, at_once = refined(two_extractions, labels), refined(one, labels)
    np.testing.assert_array_equal(later.array, at_once.array)


def test_what_features_cost_is_said_with_the_coarse_ones_where_these_are_told_of(spheres: Spheres) -> None:
    volume, _ = spheres

    def memory_bytes(service: SegmentationService) -> int:
        service.serve(TakeVolume(volume.array, volume.geometry, "spheres"))
        estimate: FeatureEstimate = service.serve(Prepare(SETTINGS))
        assert not estimate.cached
        return estimate.memory_bytes

    alone, after_coarse = SegmentationService(no_progress), SegmentationService(no_progress, on_coarse=lambda: None)
    assert memory_bytes(after_coarse) > memory_bytes(alone)


def shown_in_3d(rendering: StructureVolume, number: int) -> set[tuple[float, ...]]:
    """Where the voxels of a structure are, RAS millimetres."""
    inside = (rendering.voxels[..., NUMBER] == number) & (rendering.voxels[..., DEPTH] > SURFACE)
    return set(map(tuple, rendering.geometry.ijk_to_ras_points(np.argwhere(inside)[:, ::-1]).round(3).tolist()))


@pytest.mark.parametrize("surroundings", [False, True])
def test_a_structure_whose_map_stays_refined_looks_in_3d_as_it_did(spheres: Spheres, surroundings: bool) -> None:
    volume, _ = spheres
    service, before = SegmentationService(no_progress), requests_of(spheres)
    cache_known_features(*spheres)
    for request in (TakeVolume(volume.array, volume.geometry, ""), Prepare(SETTINGS), Extract()):
        service.serve(request)

    def render(*refined: bool) -> StructureVolume:
        rendering: StructureVolume = service.serve(Render("similarity", refined, (True,) * 3, surroundings))
        return rendering

    service.serve(ComputeMaps(before))
    service.serve(RefineMaps(before, Refinement()))
    fine = render(True, True, True)
    first, *others = before
    after = replace(first, positive=np.concatenate([first.positive, first.positive + 4.0]))
    service.serve(ComputeMaps((after, *others)))
    rough, mixed = render(False, False, False), render(False, True, True)
    for number in (2, 3):
        assert shown_in_3d(mixed, number) == shown_in_3d(fine, number) != shown_in_3d(rough, number)
    # The first one follows the click, in whatever box it comes.
    as_clicked, as_shown = (len(shown_in_3d(each, 1)) * each.geometry.voxel_volume_mm3 for each in (rough, mixed))
    assert as_shown == pytest.approx(as_clicked, rel=0.25)
    assert shown_in_3d(mixed, 1) != shown_in_3d(fine, 1)


def test_padding_above_all_else_is_drawn_like_air(spheres: Spheres) -> None:
    """As bone, it would wall the structures in."""
    volume, labels = spheres

    def drawn(padding: float) -> np.ndarray:
        padded = Volume(volume.array.copy(), volume.geometry, "")
        padded.array[:2] = padding
        cache_known_features(padded, labels)
        service = SegmentationService(no_progress)
        for request in (TakeVolume(padded.array, padded.geometry, ""), Prepare(SETTINGS), Extract()):
            service.serve(request)
        service.serve(ComputeMaps(requests_of(spheres)))
        rendering: StructureVolume = service.serve(Render("similarity", (False,) * 3, (True,) * 3, True))
        return rendering.voxels[..., INTENSITY]

    air = float(volume.array.min())
    np.testing.assert_array_equal(drawn(65535.0), drawn(air))


@pytest.mark.slow
def test_bad_input_is_explained_and_the_process_goes_on(client: ComputeClient, spheres: Spheres) -> None:
    volume = spheres[0]
    constant = TakeVolume(np.zeros_like(volume.array), volume.geometry, "empty")
    refused = reply_to(client, client.request(constant))
    assert isinstance(refused, Failed)
    assert "'empty' is constant" in refused.message
    assert isinstance(reply_to(client, client.request(Prepare(SETTINGS))), Failed)
    open_spheres(client, spheres)


@pytest.mark.slow
def test_what_was_cancelled_is_not_done_and_what_follows_is(client: ComputeClient, spheres: Spheres) -> None:
    open_spheres(client, spheres)
    requests = requests_of(spheres)
    cancelled = [client.request(RefineMaps(requests, Refinement())) for _ in range(2)]
    client.cancel(cancelled)
    after = client.request(ComputeMaps(requests))
    replies: dict[int, Any] = {}
    until = time.monotonic() + LONGEST_WAIT_S
    while len(replies) < 3 and time.monotonic() < until:
        replies |= {number: reply for number, reply in client.replies() if not isinstance(reply, Progressed)}
        time.sleep(0.005)
    assert replies[cancelled[1]] == GivenUp()
    assert isinstance(replies[after], Maps)


def test_a_click_is_answered_while_something_else_is_being_computed(client: ComputeClient, spheres: Spheres) -> None:
    open_spheres(client, spheres)
    requests = requests_of(spheres)
    others = [client.request(RefineMaps(requests[:count], Refinement())) for count in (3, 2, 1, 3)]
    click = client.request(ComputeMaps(requests))
    finished: list[int] = []
    until = time.monotonic() + LONGEST_WAIT_S
    while len(finished) < 5 and time.monotonic() < until:
        finished += [number for number, reply in client.replies() if not isinstance(reply, Progressed)]
    assert [number for number in finished if number != click] == others
    assert finished[-1] != click


THREADS_OF_CLICKS = """
import io, os, sys, threading, torch
from pathlib import Path
from ViTTransferFunction.Logic.compute.array_files import ArrayFiles
from ViTTransferFunction.Logic.compute.codec import to_message
from ViTTransferFunction.Logic.compute.messages import write_message
from ViTTransferFunction.Logic.compute.requests import ComputeMaps, Maps
from ViTTransferFunction.Logic.compute.server import Server
from ViTTransferFunction.Logic.compute.service import SegmentationService

torch.set_num_threads(3)
served = threading.Semaphore(0)

def serve(service, request):
    # The first answer makes no use of PyTorch.
    if request.first:
        print(torch.get_num_threads(), flush=True)
    served.release()
    return Maps((), ())

SegmentationService.serve = serve
reading, writing = os.pipe()
requests, files = os.fdopen(writing, "wb"), ArrayFiles(Path(sys.argv[1]))
threading.Thread(target=Server(os.fdopen(reading, "rb"), io.BytesIO(), files).serve, daemon=True).start()
write_message(requests, to_message(1, ComputeMaps(())), files)
served.acquire()
torch.set_num_threads(1)
write_message(requests, to_message(2, ComputeMaps((), first="liver")), files)
served.acquire()
requests.close()
threading.Event().wait()
"""


def test_clicks_are_answered_with_the_threads_that_pytorch_has_at_first_whatever_is_computed_beside_them(
    tmp_path: Path,
) -> None:
    program = [sys.executable, "-c", THREADS_OF_CLICKS, str(tmp_path)]
    finished = subprocess.run(program, capture_output=True, encoding="utf-8", check=False, timeout=LONGEST_WAIT_S)
    assert finished.stdout == "3\n", finished.stderr


@pytest.mark.slow
def test_the_end_of_the_process_is_noticed_and_its_reason_known(client: ComputeClient) -> None:
    # A reply is no request: no service answers it.
    client.request(Labels(np.zeros((1, 1, 1)), (0, 0, 0)))
    until = time.monotonic() + LONGEST_WAIT_S
    while client.alive and time.monotonic() < until:
        client.replies()
        time.sleep(0.01)
    assert not client.alive
    assert "Labels" in client.last_words()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has priorities by thread")
def test_a_process_of_the_lowest_priority_serves_at_that(spheres: Spheres) -> None:
    priorities: list[int] = []

    def serve_and_ask() -> None:
        # Of this thread alone, from which the process has it: nobody but the system's administrator may raise it again.
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), 19)
        with closing(ComputeClient()) as client:
            reply_to(client, client.request(TakeVolume(spheres[0].array, spheres[0].geometry, "spheres")))
            priorities.append(os.getpriority(os.PRIO_PROCESS, client.pid))

    thread = threading.Thread(target=serve_and_ask)
    thread.start()
    thread.join()
    assert priorities == [19]


def test_closing_ends_the_process_whatever_it_does(spheres: Spheres) -> None:
    client = ComputeClient()
    open_spheres(client, spheres)
    client.request(RefineMaps(requests_of(spheres), Refinement()))
    client.close()
    client.replies()
    assert not client.alive


@pytest.mark.slow
def test_the_answer_to_many_points_at_once_can_be_given_up_for_the_next_one(client: ComputeClient, spheres: Spheres) -> None:
    open_spheres(client, spheres)
    geometry = spheres[0].geometry
    inside = np.random.default_rng(0).uniform(0.0, np.array(geometry.shape[::-1]) - 1.0, (5000, 3))
    many = client.request(ComputeMaps((ClassRequest("many", geometry.ijk_to_ras_points(inside)),)))
    time.sleep(0.2)
    client.cancel([many])
    assert reply_to(client, many) == GivenUp()
    assert isinstance(reply_to(client, client.request(ComputeMaps(requests_of(spheres)))), Maps)


def with_close_up(client: ComputeClient, spheres: Spheres) -> tuple[tuple[ClassRequest, ...], ClassMap]:
    """Requests for the spheres, the first of which has a close-up of known features; and its map by the whole volume."""
    first, *others = requests_of(spheres)
    low = reply_to(client, client.request(ComputeMaps((first, *others)))).maps[0]
    close_up = close_up_of(low, first.positive, spheres[0].geometry)
    cache_known_close_up(*spheres, close_up, first.positive)
    return (replace(first, close_up=close_up), *others), low


def test_a_class_is_looked_at_closely_between_one_answer_and_the_next(client: ComputeClient, spheres: Spheres) -> None:
    open_spheres(client, spheres)
    requests, low = with_close_up(client, spheres)
    before = reply_to(client, client.request(ComputeMaps(requests)))
    refined_before = reply_to(client, client.request(RefineMaps(requests, Refinement())))
    assert before.awaiting_close_ups
    assert np.array_equal(before.maps[0].array, low.array)
    assert reply_to(client, client.request(LookCloser(requests))) == Loaded("")
    after = reply_to(client, client.request(ComputeMaps(requests)))
    assert not after.awaiting_close_ups
    assert not np.array_equal(after.maps[0].array, low.array)
    # What was refined before does not answer for what is looked at closely.
    refined = reply_to(client, client.request(RefineMaps(requests, Refinement())))
    assert not np.array_equal(refined.maps[0].array, refined_before.maps[0].array)
    assert np.array_equal(refined.maps[2].array, refined_before.maps[2].array)


def test_labels_are_those_of_close_ups_even_where_nobody_asked_for_these_before(
    client: ComputeClient, spheres: Spheres
) -> None:
    open_spheres(client, spheres)
    requests, _ = with_close_up(client, spheres)
    reply_to(client, client.request(RefineMaps(requests, Refinement())))
    labels = reply_to(client, client.request(SegmentClasses(requests, Refinement())))
    assert isinstance(labels, Labels)
    assert not reply_to(client, client.request(ComputeMaps(requests))).awaiting_close_ups
