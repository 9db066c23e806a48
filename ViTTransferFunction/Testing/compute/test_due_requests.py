"""What is asked when, and what gives way to it: seen on a client that answers only what a test has it answer."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute import due_requests
from ViTTransferFunction.Logic.compute.answered_maps import AnsweredMaps
from ViTTransferFunction.Logic.compute.due_requests import REFINE_AFTER_S, DueRequests
from ViTTransferFunction.Logic.compute.pending_requests import PendingRequests
from ViTTransferFunction.Logic.compute.proxy import SegmentationProxy
from ViTTransferFunction.Logic.compute.requests import (
    CoarseFeatures,
    ComputeMaps,
    Extract,
    Failed,
    GivenUp,
    Labels,
    Loaded,
    LookCloser,
    Maps,
    MeasureMaps,
    Progressed,
    RefinedMaps,
    RefineMaps,
    Refinement,
    Render,
    SegmentClasses,
    Volumes,
)
from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Testing.support.stub_client import CLOSER, LIVER, MAP, RENDERING, SPLEEN, StubClient


def test_maps_are_refined_when_the_annotations_have_been_left_alone_for_a_while(
    client: StubClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now)
    pending, answers = PendingRequests(lambda: client), AnsweredMaps()  # type: ignore[arg-type, return-value]
    due = DueRequests(pending, answers)
    due.update([LIVER], Refinement(), first="")
    (asked,) = due.take()
    assert asked == ComputeMaps((LIVER,))
    answers.take(asked, Maps((MAP,)), refining=True)
    due.maps_came(asked, may_look_closer=False)
    assert due.take() == [MeasureMaps((LIVER,))]
    now += 0.9 * REFINE_AFTER_S
    assert due.take() == []
    assert due
    now += 0.2 * REFINE_AFTER_S
    assert due.take() == [RefineMaps((LIVER,), Refinement())]
    assert not due


def test_a_click_is_sent_without_waiting_for_the_next_poll(ready: SegmentationProxy, client: StubClient) -> None:
    ready.update([LIVER], None)
    assert client.asked[-1] == ComputeMaps((LIVER,))
    sent = len(client.asked)
    # The answer to the first is still under way; what comes meanwhile is sent once, as it is then.
    ready.update([LIVER, SPLEEN], None)
    ready.update([SPLEEN], None)
    assert len(client.asked) == sent
    client.answer(ComputeMaps, Maps((MAP,)))
    ready.poll()
    assert client.asked[sent:] == [ComputeMaps((SPLEEN,))]


@pytest.mark.parametrize("first", ["", "liver", "gone"])
def test_a_single_class_and_one_that_is_not_asked_for_are_not_replied_first(
    ready: SegmentationProxy, client: StubClient, first: str
) -> None:
    classes = [LIVER] if first == "liver" else [LIVER, SPLEEN]
    ready.update(classes, None, first)
    assert client.asked[-1] == ComputeMaps(tuple(classes))


def test_a_click_overtakes_refinement_and_rendering(ready: SegmentationProxy, client: StubClient) -> None:
    ready.look("similarity", {"liver": True})
    ready.update([LIVER], Refinement())
    ready.poll()
    client.answer(ComputeMaps, Maps((MAP,)))
    ready.poll()
    assert client.asked[-2:] == [Render("similarity", (False,), (True,)), MeasureMaps((LIVER,))]
    measuring = len(client.asked)
    ready.update([LIVER, SPLEEN], Refinement())
    ready.poll()
    assert sorted(client.cancelled) == [measuring - 1, measuring]
    assert client.asked[-1] == ComputeMaps((LIVER, SPLEEN))
    client.answer(Render, RENDERING)
    assert "rendering" not in ready.poll()
    assert ready.rendering is None


def test_an_answer_is_waited_for_unless_it_takes_long(
    ready: SegmentationProxy, client: StubClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready.update([LIVER], Refinement())
    answering = len(client.asked)
    ready.update([LIVER, SPLEEN], Refinement())
    ready.poll()
    assert not client.cancelled
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now + due_requests.OVERTAKE_AFTER_S)
    ready.poll()
    assert client.cancelled == [answering]
    assert client.asked[-1] == ComputeMaps((LIVER, SPLEEN))
    client.answer(ComputeMaps, Maps((MAP, MAP)))
    ready.poll()
    assert ready.up_to_date


def test_maps_come_first_then_the_rendering_and_the_volumes_then_the_refined_maps(
    ready: SegmentationProxy, client: StubClient
) -> None:
    ready.look("transfer function", {})
    ready.update([LIVER], Refinement("guided"))
    ready.poll()
    client.answer(ComputeMaps, Maps((MAP,)))
    assert ready.poll() == {"maps"}
    assert ready.maps == {"liver": MAP}
    # Neither waits until it is noticed that the other has been answered.
    assert client.kinds()[-2:] == ["Render", "MeasureMaps"]
    client.answer(Render, RENDERING)
    assert ready.poll() == {"rendering"}
    assert ready.rendered == ("liver",)
    assert client.kinds()[-1] == "MeasureMaps"
    client.answer(MeasureMaps, Volumes((1.5,)))
    assert ready.poll() == {"volumes"}
    assert client.asked[-1] == RefineMaps((LIVER,), Refinement("guided"))
    client.answer(RefineMaps, RefinedMaps((MAP,), (1.5,)))
    assert ready.poll() == {"refined"}
    assert ready.refined == (True,)
    assert isinstance(client.asked[-1], Render)
    assert client.asked[-1].refined == (True,)


@pytest.mark.parametrize(("answered_after_s", "waits"), [(0.01, True), (0.06, False)])
def test_a_rendering_waits_for_a_pause_after_the_click_not_after_its_answer(
    ready: SegmentationProxy, client: StubClient, monkeypatch: pytest.MonkeyPatch, answered_after_s: float, waits: bool
) -> None:
    now = time.monotonic()
    monkeypatch.setattr(due_requests, "RENDER_AFTER_S", 0.05)
    monkeypatch.setattr(time, "monotonic", lambda: now)
    ready.look("similarity", {})
    ready.update([LIVER], None)
    now += answered_after_s
    client.answer(ComputeMaps, Maps((MAP,)))
    ready.poll()
    assert ("Render" not in client.kinds()) == waits
    assert "MeasureMaps" in client.kinds()
    now += 0.05
    # Also while volumes are measured.
    ready.poll()
    assert "Render" in client.kinds()


def test_a_click_does_not_wait_for_volumes_and_those_of_the_click_before_stay_meanwhile(
    ready: SegmentationProxy, client: StubClient
) -> None:
    ready.update([LIVER], None)
    client.answer(ComputeMaps, Maps((MAP,)))
    ready.poll()
    client.answer(MeasureMaps, Volumes((1.5,)))
    ready.poll()
    ready.update([LIVER, SPLEEN], None)
    client.answer(ComputeMaps, Maps((MAP, MAP)))
    ready.poll()
    assert ready.volumes_ml == {"liver": 1.5}
    measuring = len(client.asked)
    ready.update([LIVER], None)
    assert client.cancelled == [measuring]
    assert client.asked[-1] == ComputeMaps((LIVER,))


def test_nothing_is_measured_of_classes_that_went_before_it_could_be(proxy: SegmentationProxy, client: StubClient) -> None:
    proxy.extract()
    client.answer(Extract, CoarseFeatures())
    proxy.update([CLOSER], None)
    proxy.poll()
    client.answer(ComputeMaps, Maps((MAP,), awaiting_close_ups=("liver",)))
    proxy.poll()
    proxy.update([], None)
    client.answer(Extract, GivenUp())
    proxy.poll()
    assert client.kinds()[-1] == "ComputeMaps"
    assert not proxy.busy


def test_close_ups_are_looked_at_before_anything_is_measured_or_refined(
    looked_at: SegmentationProxy, client: StubClient
) -> None:
    assert client.asked[-1] == LookCloser((CLOSER, SPLEEN))
    assert set(looked_at.maps) == {"liver", "spleen"}
    client.answer(LookCloser, Progressed(1, 4, "Looking closer at liver"))
    assert looked_at.poll() == {"state"}
    assert looked_at.progress is not None
    assert looked_at.progress.what == "Looking closer at liver"
    assert looked_at.looks_closer
    client.answer(LookCloser, Loaded(""))
    looked_at.poll()
    assert (looked_at.progress, looked_at.looks_closer) == (None, False)
    assert client.asked[-1] == ComputeMaps((CLOSER, SPLEEN))
    client.answer(ComputeMaps, Maps((MAP, MAP)))
    looked_at.poll()
    assert client.kinds()[-1] == "MeasureMaps"


def test_clicks_are_answered_while_a_close_up_is_being_made(looked_at: SegmentationProxy, client: StubClient) -> None:
    looked_at.update([replace(CLOSER, negative=np.ones((1, 3))), SPLEEN], None)
    assert client.kinds()[-2:] == ["LookCloser", "ComputeMaps"]
    assert client.cancelled == []
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("liver",)))
    assert "maps" in looked_at.poll()
    # It is not asked for twice.
    assert client.kinds()[-1] == "ComputeMaps"


def test_a_close_up_that_nobody_wants_any_more_is_given_up(looked_at: SegmentationProxy, client: StubClient) -> None:
    number = len(client.asked)
    looked_at.update([LIVER, SPLEEN], None)
    assert client.cancelled == [number]
    assert looked_at.progress is None


def test_a_close_up_that_fails_is_not_begun_again_by_itself(looked_at: SegmentationProxy, client: StubClient) -> None:
    client.answer(LookCloser, Failed("no weights"))
    looked_at.poll()
    assert looked_at.take_error() == "no weights"
    assert looked_at.progress is None
    looked_at.update([CLOSER, replace(SPLEEN, negative=np.ones((1, 3)))], None)
    looked_at.poll()
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("liver",)))
    looked_at.poll()
    assert client.kinds()[-1] == "MeasureMaps"
    # Another box is another wish.
    other = replace(CLOSER, close_up=CloseUp((0.0,) * 3, (2.0,) * 3))
    client.answer(MeasureMaps, Volumes((1.0, 1.0)))
    looked_at.poll()
    looked_at.update([other, SPLEEN], None)
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("liver",)))
    looked_at.poll()
    assert client.asked[-1] == LookCloser((other, SPLEEN))


def test_a_close_up_that_failed_is_made_where_the_user_asks_for_it_again(
    looked_at: SegmentationProxy, client: StubClient
) -> None:
    assert looked_at.failed_close_ups == ()
    client.answer(LookCloser, Failed("no weights"))
    looked_at.poll()
    assert looked_at.failed_close_ups == ("liver",)
    looked_at.try_close_ups_again()
    assert looked_at.failed_close_ups == ()
    looked_at.poll()
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("liver",)))
    looked_at.poll()
    assert client.asked[-1] == LookCloser((CLOSER, SPLEEN))


def test_what_is_shown_follows_the_close_ups_made_for_labels(looked_at: SegmentationProxy, client: StubClient) -> None:
    client.answer(LookCloser, Failed("no weights"))
    looked_at.poll()
    looked_at.segment(Refinement())
    client.answer(SegmentClasses, Labels(np.ones((1, 1, 1), np.uint8), (0, 0, 0)))
    looked_at.poll()
    assert client.asked[-1] == ComputeMaps((CLOSER, SPLEEN))


def test_another_close_up_waits_for_the_one_that_is_being_made(looked_at: SegmentationProxy, client: StubClient) -> None:
    both = [CLOSER, replace(SPLEEN, close_up=CloseUp((0.0,) * 3, (2.0,) * 3))]
    looked_at.update(both, None)
    assert client.cancelled == []
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("liver", "spleen")))
    looked_at.poll()
    client.answer(LookCloser, Loaded(""))
    looked_at.poll()
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("spleen",)))
    looked_at.poll()
    assert looked_at.awaiting_close_ups == ("spleen",)
    assert client.asked[-1] == LookCloser(tuple(both))


def test_close_ups_wait_for_the_features_of_the_whole(proxy: SegmentationProxy, client: StubClient) -> None:
    proxy.update([CLOSER], None)
    proxy.extract()
    client.answer(Extract, CoarseFeatures())
    proxy.poll()
    client.answer(ComputeMaps, Maps((MAP,), awaiting_close_ups=("liver",)))
    proxy.poll()
    # Nor is anything begun by itself once these were cancelled.
    client.answer(Extract, GivenUp())
    proxy.poll()
    assert "LookCloser" not in client.kinds()
    proxy.extract()
    client.answer(Extract, Loaded(""))
    proxy.poll()
    client.answer(ComputeMaps, Maps((MAP,), awaiting_close_ups=("liver",)))
    proxy.poll()
    assert client.kinds()[-1] == "LookCloser"


def test_views_are_awaited_from_a_click_until_its_rendering_is_there(
    ready: SegmentationProxy, client: StubClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.monotonic()
    monkeypatch.setattr(due_requests, "RENDER_AFTER_S", 0.05)
    monkeypatch.setattr(time, "monotonic", lambda: now)
    ready.look("similarity", {})
    assert not ready.awaits_views
    ready.update([LIVER], None)
    client.answer(ComputeMaps, Maps((MAP,)))
    for wait_s in (0.0, 0.06):
        assert ready.awaits_views
        now += wait_s
        ready.poll()
    assert "Render" in client.kinds()
    assert ready.awaits_views
    client.answer(Render, RENDERING)
    ready.poll()
    assert not ready.awaits_views


def test_views_are_not_awaited_where_the_rendering_waits_for_finer_features(
    proxy: SegmentationProxy, client: StubClient
) -> None:
    proxy.look("similarity", {})
    proxy.update([LIVER], None)
    proxy.extract()
    client.answer(Extract, CoarseFeatures())
    proxy.poll()
    assert proxy.awaits_views
    client.answer(ComputeMaps, Maps((MAP,)))
    proxy.poll()
    assert proxy.busy
    assert not proxy.awaits_views
