"""What the proxy asks, and when, on a client that answers only what a test has it answer."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute import proxy as proxy_module
from ViTTransferFunction.Logic.compute.proxy import SegmentationProxy
from ViTTransferFunction.Logic.compute.requests import (
    CoarseFeatures,
    ComputeMaps,
    Done,
    Extract,
    Failed,
    FirstMap,
    GivenUp,
    Labels,
    LookCloser,
    Maps,
    MeasureMaps,
    Prepare,
    Progressed,
    RefinedMaps,
    RefineMaps,
    Refinement,
    ReleaseVolume,
    Render,
    SegmentClasses,
    Taken,
    TakeVolume,
    Volumes,
)
from ViTTransferFunction.Logic.core.class_map import ClassMap
from ViTTransferFunction.Logic.core.class_request import ClassRequest
from ViTTransferFunction.Logic.core.close_up import CloseUp
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.core.iso_proposals import IsoProposals
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Logic.session.feature_estimate import FeatureEstimate
from ViTTransferFunction.Logic.session.settings import SessionSettings

GEOMETRY = Geometry((2, 2, 2), np.eye(4))
VOLUME = TakeVolume(np.zeros((2, 2, 2)), GEOMETRY, "CT")
SETTINGS = SessionSettings(grid=16)
COSTLY = FeatureEstimate(cached=False, seconds=5.0, memory_bytes=10**9)
LIVER, SPLEEN = (ClassRequest(id_, np.zeros((1, 3))) for id_ in ("liver", "spleen"))
CLOSER = replace(LIVER, close_up=CloseUp((0.0,) * 3, (1.0,) * 3))
MAP = ClassMap(np.zeros((2, 2, 2), dtype=np.float32), GEOMETRY, 0.4)
RENDERING = StructureVolume(np.zeros((2, 2, 2, 4), dtype=np.uint8), np.zeros((1, 2)), np.arange(256.0), False, 1.0, GEOMETRY)


class Client:
    """In the place of `ComputeClient`: keeps what is asked, and answers by `answer`."""

    pid = 1

    def __init__(self) -> None:
        self.asked: list[Any] = []
        self.cancelled: list[int] = []
        self.alive = True
        self._replies: list[tuple[int, Any]] = []

    def request(self, request: Any) -> int:
        self.asked.append(request)
        return len(self.asked)

    def cancel(self, numbers: Any) -> None:
        self.cancelled += numbers

    def answer(self, kind: type, reply: Any) -> None:
        """Reply to the last request of a kind."""
        number = max(number for number, request in enumerate(self.asked, start=1) if isinstance(request, kind))
        self._replies.append((number, reply))

    def replies(self) -> list[tuple[int, Any]]:
        replies, self._replies = self._replies, []
        return replies

    def last_words(self) -> str:
        return "MemoryError"

    def close(self) -> None:
        self.alive = False

    def kinds(self) -> list[str]:
        return [type(request).__name__ for request in self.asked]


@pytest.fixture
def client() -> Client:
    return Client()


@pytest.fixture
def proxy(client: Client, monkeypatch: pytest.MonkeyPatch) -> SegmentationProxy:
    """With a volume whose features are not cached; nothing waits for the user to pause."""
    monkeypatch.setattr(proxy_module, "RENDER_AFTER_S", 0.0)
    monkeypatch.setattr(proxy_module, "REFINE_AFTER_S", 0.0)
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type, return-value]
    proxy.open(VOLUME, SETTINGS)
    client.answer(TakeVolume, Taken("0f"))
    client.answer(Prepare, COSTLY)
    proxy.poll()
    return proxy


@pytest.fixture
def ready(proxy: SegmentationProxy, client: Client) -> SegmentationProxy:
    """With features, and no class yet."""
    proxy.extract()
    client.answer(Extract, Done())
    proxy.poll()
    return proxy


def test_a_volume_is_handed_over_with_its_settings_and_its_cost_comes_back(proxy: SegmentationProxy, client: Client) -> None:
    assert client.asked == [VOLUME, Prepare(SETTINGS)]
    assert proxy.estimate == COSTLY
    assert (proxy.phase, proxy.busy) == ("no features", False)


def test_the_process_lets_go_of_a_volume_that_is_closed_and_is_asked_for_that_once(
    ready: SegmentationProxy, client: Client
) -> None:
    before = len(client.asked)
    for _ in range(2):
        ready.open(None, SETTINGS)
    assert client.asked[before:] == [ReleaseVolume()]
    client.answer(ReleaseVolume, Done())
    assert ready.poll() == set()
    assert (ready.phase, ready.busy, ready.take_error()) == ("no volume", False, None)


def test_cached_features_load_at_once(client: Client) -> None:
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type, return-value]
    proxy.open(VOLUME, SETTINGS)
    client.answer(TakeVolume, Taken("0f"))
    client.answer(Prepare, FeatureEstimate(True, None, 1))
    proxy.poll()
    assert client.asked[-1] == Extract()
    assert proxy.phase == "extracting"


def test_maps_of_coarse_features_are_asked_for_while_the_fine_ones_are_computed(
    proxy: SegmentationProxy, client: Client
) -> None:
    proxy.update([LIVER], None)
    proxy.extract()
    assert proxy.poll() == set()
    client.answer(Extract, CoarseFeatures())
    assert proxy.poll() == {"state"}
    assert client.asked[-1] == ComputeMaps((LIVER,))
    assert proxy.phase == "extracting"


def test_what_follows_from_clicks_on_coarse_features_is_waited_for_also_after_the_fine_ones_were_cancelled(
    proxy: SegmentationProxy, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(proxy_module, "RENDER_AFTER_S", 60.0)
    proxy.look("similarity", {})
    proxy.extract()
    client.answer(Extract, CoarseFeatures())
    client.answer(Extract, GivenUp())
    proxy.poll()
    assert (proxy.phase, proxy.usable) == ("no features", True)
    proxy.update([LIVER], None)
    client.answer(ComputeMaps, Maps((MAP,)))
    proxy.poll()
    client.answer(MeasureMaps, Volumes((1.5,)))
    proxy.poll()
    assert proxy.rendering is None
    assert proxy.busy


def test_a_click_is_sent_without_waiting_for_the_next_poll(ready: SegmentationProxy, client: Client) -> None:
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


def with_both(ready: SegmentationProxy, client: Client) -> tuple[ClassMap, ClassMap]:
    """Have maps of two classes, none of them waited for; they are returned."""
    before = replace(MAP), replace(MAP)
    ready.update([LIVER, SPLEEN], None)
    client.answer(ComputeMaps, Maps(before))
    ready.poll()
    return before


MOVED = replace(LIVER, positive=np.ones((1, 3)))


def test_the_class_that_is_waited_for_is_shown_before_the_others(ready: SegmentationProxy, client: Client) -> None:
    _, spleen = with_both(ready, client)
    ready.update([MOVED, SPLEEN], None, first="liver")
    assert client.asked[-1] == ComputeMaps((MOVED, SPLEEN), "liver")
    assert not ready.first_up_to_date
    first, other = replace(MAP), replace(MAP)
    client.answer(ComputeMaps, FirstMap(first))
    assert ready.poll() == {"first map"}
    assert (ready.first_up_to_date, ready.up_to_date) == (True, False)
    assert ready.maps["liver"] is first
    assert ready.maps["spleen"] is spleen
    client.answer(ComputeMaps, Maps((other,)))
    assert ready.poll() == {"maps"}
    assert ready.maps["liver"] is first
    assert ready.maps["spleen"] is other
    assert ready.low_maps == ready.maps
    assert (ready.first_up_to_date, ready.up_to_date) == (True, True)


def test_a_click_that_is_taken_back_when_its_first_map_has_come_leaves_nothing_of_it(
    ready: SegmentationProxy, client: Client
) -> None:
    before = with_both(ready, client)
    ready.update([MOVED, SPLEEN], None, first="liver")
    client.answer(ComputeMaps, FirstMap(replace(MAP)))
    ready.poll()
    ready.update([LIVER, SPLEEN], None, first="liver")
    assert [ready.maps[name] for name in ("liver", "spleen")] == list(before)
    assert not ready.first_up_to_date
    client.answer(ComputeMaps, Maps((replace(MAP),)))
    ready.poll()
    assert client.asked[-1] == ComputeMaps((LIVER, SPLEEN), "liver")
    client.answer(ComputeMaps, Maps(before))
    ready.poll()
    assert [ready.maps[name] for name in ("liver", "spleen")] == list(before)


@pytest.mark.parametrize("first", ["", "liver", "gone"])
def test_a_single_class_and_one_that_is_not_asked_for_are_not_replied_first(
    ready: SegmentationProxy, client: Client, first: str
) -> None:
    classes = [LIVER] if first == "liver" else [LIVER, SPLEEN]
    ready.update(classes, None, first)
    assert client.asked[-1] == ComputeMaps(tuple(classes))


@pytest.fixture
def looked_at(ready: SegmentationProxy, client: Client) -> SegmentationProxy:
    """With one class that is to be looked at by itself; its features are being computed."""
    ready.update([CLOSER, SPLEEN], Refinement())
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("liver",)))
    ready.poll()
    return ready


def test_close_ups_are_looked_at_before_anything_is_measured_or_refined(looked_at: SegmentationProxy, client: Client) -> None:
    assert client.asked[-1] == LookCloser((CLOSER, SPLEEN))
    assert set(looked_at.maps) == {"liver", "spleen"}
    client.answer(LookCloser, Progressed(1, 4, "Looking closer at liver"))
    assert looked_at.poll() == {"state"}
    assert looked_at.progress is not None
    assert looked_at.progress.what == "Looking closer at liver"
    assert looked_at.looks_closer
    client.answer(LookCloser, Done())
    looked_at.poll()
    assert (looked_at.progress, looked_at.looks_closer) == (None, False)
    assert client.asked[-1] == ComputeMaps((CLOSER, SPLEEN))
    client.answer(ComputeMaps, Maps((MAP, MAP)))
    looked_at.poll()
    assert client.kinds()[-1] == "MeasureMaps"


def test_progress_is_that_of_segments_once_they_are_asked_for(looked_at: SegmentationProxy, client: Client) -> None:
    client.answer(LookCloser, Progressed(1, 4, "Looking closer at liver"))
    looked_at.poll()
    assert looked_at.looks_closer
    looked_at.segment(Refinement())
    assert looked_at.progress is not None
    assert not looked_at.looks_closer


def test_clicks_are_answered_while_a_close_up_is_being_made(looked_at: SegmentationProxy, client: Client) -> None:
    looked_at.update([replace(CLOSER, negative=np.ones((1, 3))), SPLEEN], None)
    assert client.kinds()[-2:] == ["LookCloser", "ComputeMaps"]
    assert client.cancelled == []
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("liver",)))
    assert "maps" in looked_at.poll()
    # It is not asked for twice.
    assert client.kinds()[-1] == "ComputeMaps"


def test_a_close_up_that_nobody_wants_any_more_is_given_up(looked_at: SegmentationProxy, client: Client) -> None:
    number = len(client.asked)
    looked_at.update([LIVER, SPLEEN], None)
    assert client.cancelled == [number]
    assert looked_at.progress is None


def test_a_close_up_that_fails_is_not_begun_again_by_itself(looked_at: SegmentationProxy, client: Client) -> None:
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


def test_another_close_up_waits_for_the_one_that_is_being_made(looked_at: SegmentationProxy, client: Client) -> None:
    both = [CLOSER, replace(SPLEEN, close_up=CloseUp((0.0,) * 3, (2.0,) * 3))]
    looked_at.update(both, None)
    assert client.cancelled == []
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("liver", "spleen")))
    looked_at.poll()
    client.answer(LookCloser, Done())
    looked_at.poll()
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("spleen",)))
    looked_at.poll()
    assert looked_at.awaiting_close_ups == ("spleen",)
    assert client.asked[-1] == LookCloser(tuple(both))


def test_close_ups_wait_for_the_features_of_the_whole(proxy: SegmentationProxy, client: Client) -> None:
    proxy.update([CLOSER], None)
    proxy.extract()
    client.answer(Extract, CoarseFeatures())
    proxy.poll()
    client.answer(ComputeMaps, Maps((MAP,), awaiting_close_ups=("liver",)))
    proxy.poll()
    assert "LookCloser" not in client.kinds()
    client.answer(Extract, Done())
    proxy.poll()
    client.answer(ComputeMaps, Maps((MAP,), awaiting_close_ups=("liver",)))
    proxy.poll()
    assert client.kinds()[-1] == "LookCloser"


def test_a_process_that_died_without_a_word_may_have_run_out_of_memory(
    proxy: SegmentationProxy, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "last_words", lambda: "")
    client.alive = False
    proxy.poll()
    assert "ran out of memory" in (proxy.take_error() or "")


def test_a_click_overtakes_refinement_and_rendering(ready: SegmentationProxy, client: Client) -> None:
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
    ready: SegmentationProxy, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready.update([LIVER], Refinement())
    answering = len(client.asked)
    ready.update([LIVER, SPLEEN], Refinement())
    ready.poll()
    assert not client.cancelled
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now + proxy_module.OVERTAKE_AFTER_S)
    ready.poll()
    assert client.cancelled == [answering]
    assert client.asked[-1] == ComputeMaps((LIVER, SPLEEN))
    client.answer(ComputeMaps, Maps((MAP, MAP)))
    ready.poll()
    assert ready.up_to_date


def test_maps_come_first_then_the_rendering_and_the_volumes_then_the_refined_maps(
    ready: SegmentationProxy, client: Client
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
    ready: SegmentationProxy, client: Client, monkeypatch: pytest.MonkeyPatch, answered_after_s: float, waits: bool
) -> None:
    now = time.monotonic()
    monkeypatch.setattr(proxy_module, "RENDER_AFTER_S", 0.05)
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


PROPOSALS = IsoProposals(smaller=0.8, chosen=0.4, larger=0.1)
PROPOSED = ClassMap(MAP.array, GEOMETRY, 0.4, PROPOSALS)
LARGER_LIVER = replace(LIVER, size=1.0)


@pytest.fixture
def refined(ready: SegmentationProxy, client: Client) -> SegmentationProxy:
    """With the liver's map, refined."""
    ready.update([LIVER], Refinement())
    client.answer(ComputeMaps, Maps((PROPOSED,)))
    ready.poll()
    client.answer(MeasureMaps, Volumes((1.5,)))
    ready.poll()
    client.answer(RefineMaps, RefinedMaps((MAP,), (1.5,)))
    ready.poll()
    assert ready.refined == (True,)
    return ready


@pytest.mark.parametrize(("changed", "iso"), [(LARGER_LIVER, 0.1), (replace(LIVER, iso=0.6), 0.6)])
def test_another_size_or_iso_value_alone_is_shown_before_the_answer_comes(
    refined: SegmentationProxy, client: Client, changed: ClassRequest, iso: float
) -> None:
    refined.update([changed], Refinement())
    assert refined.maps["liver"].iso == pytest.approx(iso)
    assert refined.maps["liver"].array is PROPOSED.array
    assert refined.refined == (False,)
    assert client.asked[-1] == ComputeMaps((changed,))


def test_the_answer_to_a_size_that_was_scrolled_past_does_not_bring_it_back(refined: SegmentationProxy, client: Client) -> None:
    refined.update([LARGER_LIVER], Refinement())
    refined.update([replace(LIVER, size=-1.0)], Refinement())
    client.answer(ComputeMaps, Maps((replace(PROPOSED, iso=0.1),)))
    refined.poll()
    assert refined.maps["liver"].iso == pytest.approx(0.8)
    assert client.asked[-1] == ComputeMaps((replace(LIVER, size=-1.0),))


def test_maps_go_with_the_last_class_whatever_is_being_computed_of_it(refined: SegmentationProxy, client: Client) -> None:
    refined.update([replace(LIVER, positive=np.ones((9, 3)))], Refinement())
    answering = len(client.asked)
    refined.update([], Refinement())
    assert (refined.maps, refined.low_maps, refined.volumes_ml) == ({}, {}, {})
    assert client.cancelled == [answering]
    client.answer(ComputeMaps, Maps((PROPOSED,)))
    assert refined.poll() == set()
    assert not refined.busy


def test_volumes_come_after_the_maps_and_go_with_the_classes(ready: SegmentationProxy, client: Client) -> None:
    ready.update([LIVER], Refinement(only_annotated_components=False))
    ready.poll()
    client.answer(ComputeMaps, Maps((MAP,)))
    ready.poll()
    assert ready.up_to_date
    assert client.asked[-1] == MeasureMaps((LIVER,), only_annotated_components=False)
    client.answer(MeasureMaps, Volumes((1.5,)))
    ready.poll()
    assert ready.volumes_ml == {"liver": 1.5}
    client.answer(RefineMaps, RefinedMaps((MAP,), (1.25,)))
    ready.poll()
    assert ready.volumes_ml == {"liver": 1.25}
    ready.update([], Refinement())
    ready.poll()
    assert ready.volumes_ml == {}


def test_a_click_does_not_wait_for_volumes_and_those_of_the_click_before_stay_meanwhile(
    ready: SegmentationProxy, client: Client
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


def test_labels_come_with_the_ids_of_their_classes(ready: SegmentationProxy, client: Client) -> None:
    ready.update([SPLEEN, LIVER], None)
    ready.segment(Refinement())
    client.answer(SegmentClasses, Progressed(1, 2, "Segmenting structures"))
    ready.poll()
    assert ready.progress is not None
    assert (ready.progress.done, ready.progress.total) == (1, 2)
    labels = Labels(np.zeros((2, 2, 2), dtype=np.uint8), (0, 0, 0))
    client.answer(SegmentClasses, labels)
    assert "labels" in ready.poll()
    assert ready.labels == (labels, ["spleen", "liver"])
    assert ready.progress is None


def test_a_refused_setting_is_reported_once_and_sent_again_with_the_next_extraction(client: Client) -> None:
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type, return-value]
    proxy.open(VOLUME, SETTINGS)
    proxy.extract()
    client.answer(TakeVolume, Taken("0f"))
    client.answer(Prepare, Failed("There is no weights file."))
    client.answer(Extract, Failed("The volume's settings cannot be used."))
    proxy.poll()
    assert proxy.take_error() == "There is no weights file."
    assert proxy.take_error() is None
    assert (proxy.phase, proxy.progress) == ("no features", None)
    proxy.extract()
    assert client.kinds()[-3:] == ["TakeVolume", "Prepare", "Extract"]


def test_a_refused_volume_leaves_none(client: Client) -> None:
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type, return-value]
    proxy.open(VOLUME, SETTINGS)
    client.answer(TakeVolume, Failed("'CT' is constant."))
    proxy.poll()
    assert (proxy.phase, proxy.take_error(), proxy.busy) == ("no volume", "'CT' is constant.", False)


def test_nothing_seems_to_run_after_a_volume_was_refused_for_which_extraction_was_asked(client: Client) -> None:
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type, return-value]
    proxy.open(VOLUME, SETTINGS)
    proxy.extract()
    client.answer(TakeVolume, Failed("'CT' is constant."))
    proxy.poll()
    assert (proxy.progress, proxy.busy) == (None, False)


def test_cancelling_gives_up_what_the_user_waits_for_and_nothing_else(ready: SegmentationProxy, client: Client) -> None:
    ready.update([LIVER], None)
    ready.poll()
    ready.segment(Refinement())
    ready.cancel()
    assert client.cancelled == [len(client.asked)]
    client.answer(SegmentClasses, GivenUp())
    ready.poll()
    assert ready.progress is None
    assert ready.take_error() is None


def test_labels_that_were_on_their_way_when_the_user_cancelled_are_dropped(ready: SegmentationProxy, client: Client) -> None:
    ready.update([LIVER], None)
    ready.poll()
    ready.segment(Refinement())
    client.answer(SegmentClasses, Labels(np.ones((1, 1, 1), np.uint8), (0, 0, 0)))
    ready.cancel()
    assert "labels" not in ready.poll()
    assert (ready.labels, ready.progress) == (None, None)


def test_a_lost_process_is_reported_and_started_again_by_the_next_extraction(proxy: SegmentationProxy, client: Client) -> None:
    client.alive = False
    assert proxy.poll() == {"state"}
    assert "MemoryError" in (proxy.take_error() or "")
    assert (proxy.phase, proxy.pid) == ("no features", None)
    client.alive = True
    proxy.extract()
    assert client.kinds()[-3:] == ["TakeVolume", "Prepare", "Extract"]


def test_a_process_that_was_started_ahead_serves_the_volume_that_is_chosen_then(client: Client) -> None:
    started: list[Client] = []

    def start() -> Client:
        started.append(client)
        return client

    proxy = SegmentationProxy(start)  # type: ignore[arg-type]
    proxy.start()
    proxy.start()
    assert (started, client.kinds()) == ([client], [])
    proxy.open(VOLUME, SessionSettings())
    assert (started, client.kinds()) == ([client], ["TakeVolume", "Prepare"])


def test_nothing_is_said_of_a_process_that_was_started_ahead_and_was_not_needed_yet(client: Client) -> None:
    def fail() -> Client:
        raise InputError("Computing could not be started.")

    unable = SegmentationProxy(fail)  # type: ignore[arg-type]
    unable.start()
    assert unable.take_error() is None
    unable.open(VOLUME, SessionSettings())
    assert unable.take_error() == "Computing could not be started."
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type,return-value]
    proxy.start()
    client.alive = False
    proxy.poll()
    assert (proxy.take_error(), proxy.pid, proxy.phase) == (None, None, "no volume")


def test_views_are_awaited_from_a_click_until_its_rendering_is_there(
    ready: SegmentationProxy, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.monotonic()
    monkeypatch.setattr(proxy_module, "RENDER_AFTER_S", 0.05)
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


def test_views_are_not_awaited_where_the_rendering_waits_for_finer_features(proxy: SegmentationProxy, client: Client) -> None:
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
