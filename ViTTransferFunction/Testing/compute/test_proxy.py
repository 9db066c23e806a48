"""What becomes of a volume in the compute process, on a client that answers only what a test has it answer."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute import due_requests
from ViTTransferFunction.Logic.compute.client import NO_ROOM
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
    Loaded,
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
from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.iso_proposals import IsoProposals
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.session.feature_estimate import FeatureEstimate
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.stub_client import (
    COSTLY,
    GEOMETRY,
    LIVER,
    MAP,
    MOVED,
    RENDERING,
    SETTINGS,
    SPLEEN,
    VOLUME,
    StubClient,
)


def test_a_volume_is_handed_over_with_its_settings_and_its_cost_comes_back(
    proxy: SegmentationProxy, client: StubClient
) -> None:
    assert client.asked == [VOLUME, Prepare(SETTINGS)]
    assert proxy.estimate == COSTLY
    assert (proxy.phase, proxy.busy) == ("no features", False)


def test_the_process_lets_go_of_a_volume_that_is_closed_and_is_asked_for_that_once(
    ready: SegmentationProxy, client: StubClient
) -> None:
    before = len(client.asked)
    for _ in range(2):
        ready.open(None, SETTINGS)
    assert client.asked[before:] == [ReleaseVolume()]
    client.answer(ReleaseVolume, Done())
    assert ready.poll() == set()
    assert (ready.phase, ready.busy, ready.take_error()) == ("no volume", False, None)


def test_cached_features_load_at_once(client: StubClient) -> None:
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type, return-value]
    proxy.open(VOLUME, SETTINGS)
    client.answer(TakeVolume, Taken("0f"))
    client.answer(Prepare, FeatureEstimate(True, None, 1))
    proxy.poll()
    assert client.asked[-1] == Extract()
    assert proxy.phase == "extracting"


def test_maps_of_coarse_features_are_asked_for_while_the_fine_ones_are_computed(
    proxy: SegmentationProxy, client: StubClient
) -> None:
    proxy.update([LIVER], None)
    proxy.extract()
    assert proxy.poll() == set()
    client.answer(Extract, CoarseFeatures())
    assert proxy.poll() == {"state"}
    assert client.asked[-1] == ComputeMaps((LIVER,))
    assert proxy.phase == "extracting"


def test_what_follows_from_clicks_on_coarse_features_is_waited_for_also_after_the_fine_ones_were_cancelled(
    proxy: SegmentationProxy, client: StubClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(due_requests, "RENDER_AFTER_S", 60.0)
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


def with_both(ready: SegmentationProxy, client: StubClient) -> tuple[ClassMap, ClassMap]:
    """Have maps of two classes, none of them waited for; they are returned."""
    before = replace(MAP), replace(MAP)
    ready.update([LIVER, SPLEEN], None)
    client.answer(ComputeMaps, Maps(before))
    ready.poll()
    return before


def test_the_class_that_is_waited_for_is_shown_before_the_others(ready: SegmentationProxy, client: StubClient) -> None:
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
    ready: SegmentationProxy, client: StubClient
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


def test_progress_is_that_of_segments_once_they_are_asked_for(looked_at: SegmentationProxy, client: StubClient) -> None:
    client.answer(LookCloser, Progressed(1, 4, "Looking closer at liver"))
    looked_at.poll()
    assert looked_at.looks_closer
    looked_at.segment(Refinement())
    assert looked_at.progress is not None
    assert not looked_at.looks_closer


def test_the_time_that_is_left_is_counted_from_where_the_present_step_began(
    proxy: SegmentationProxy, client: StubClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now)
    proxy.extract()
    left_s = []
    for seconds, done, what in (
        (0, 0, "Downloading"),
        (30, 8, "Downloading"),
        (2, 0, "Computing"),
        (1, 1, "Computing"),
        (5, 2, "Computing"),
    ):
        now += seconds
        client.answer(Extract, Progressed(done, 10, what))
        proxy.poll()
        assert proxy.progress is not None
        left_s.append(proxy.progress.seconds_left)
    # Of a second's work nothing can be told yet.
    assert left_s == [None, pytest.approx(7.5), None, None, pytest.approx(24.0)]


def test_a_process_that_died_without_a_word_may_have_run_out_of_memory(
    proxy: SegmentationProxy, client: StubClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "last_words", lambda: "")
    client.alive = False
    proxy.poll()
    assert "ran out of memory" in (proxy.take_error() or "")


def test_where_the_temporary_folder_is_full_space_is_asked_for_and_no_smaller_computation(
    proxy: SegmentationProxy, client: StubClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "last_words", lambda: f"{NO_ROOM}: [Errno 28] No space left on device")
    client.alive = False
    proxy.poll()
    error = proxy.take_error() or ""
    assert "Free some space" in error
    assert "preset" not in error


def test_a_rendering_that_is_under_way_when_3d_views_are_switched_off_is_not_shown(
    ready: SegmentationProxy, client: StubClient
) -> None:
    ready.look("similarity", {})
    ready.update([LIVER], None)
    client.answer(ComputeMaps, Maps((MAP,)))
    ready.poll()
    rendering = client.kinds().index("Render") + 1
    ready.look(None, {})
    assert client.cancelled == [rendering]
    client.answer(Render, RENDERING)
    assert ready.poll() == set()
    assert (ready.rendering, ready.awaits_views) == (None, False)


def test_a_rendering_stays_until_the_next_one_and_goes_with_the_last_class(
    ready: SegmentationProxy, client: StubClient
) -> None:
    ready.look("similarity", {})
    ready.update([LIVER], None)
    client.answer(ComputeMaps, Maps((MAP,)))
    ready.poll()
    client.answer(Render, RENDERING)
    ready.poll()
    ready.update([MOVED], None)
    assert ready.rendering is RENDERING
    ready.update([], None)
    assert ready.rendering is None


PROPOSALS = IsoProposals(smaller=0.8, chosen=0.4, larger=0.1)


PROPOSED = ClassMap(MAP.array, GEOMETRY, 0.4, PROPOSALS)


LARGER_LIVER = replace(LIVER, size=1.0)


@pytest.fixture
def refined(ready: SegmentationProxy, client: StubClient) -> SegmentationProxy:
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
    refined: SegmentationProxy, client: StubClient, changed: ClassRequest, iso: float
) -> None:
    refined.update([changed], Refinement())
    assert refined.maps["liver"].iso == pytest.approx(iso)
    assert refined.maps["liver"].array is PROPOSED.array
    assert refined.refined == (False,)
    assert client.asked[-1] == ComputeMaps((changed,))


def test_the_answer_to_a_size_that_was_scrolled_past_does_not_bring_it_back(
    refined: SegmentationProxy, client: StubClient
) -> None:
    refined.update([LARGER_LIVER], Refinement())
    refined.update([replace(LIVER, size=-1.0)], Refinement())
    client.answer(ComputeMaps, Maps((replace(PROPOSED, iso=0.1),)))
    refined.poll()
    assert refined.maps["liver"].iso == pytest.approx(0.8)
    assert client.asked[-1] == ComputeMaps((replace(LIVER, size=-1.0),))


@pytest.mark.parametrize("refinement", [Refinement(), None])
def test_a_click_leaves_the_other_classes_refined_only_where_they_will_be_again(
    ready: SegmentationProxy, client: StubClient, refinement: Refinement | None
) -> None:
    before = with_both(ready, client)
    client.answer(MeasureMaps, Volumes((1.5, 0.5)))
    ready.update([LIVER, SPLEEN], Refinement())
    client.answer(ComputeMaps, Maps(before))
    ready.poll()
    client.answer(MeasureMaps, Volumes((1.5, 0.5)))
    ready.poll()
    client.answer(RefineMaps, RefinedMaps((replace(MAP), replace(MAP)), (1.5, 0.5)))
    ready.poll()
    assert ready.refined == (True, True)
    ready.update([MOVED, SPLEEN], refinement)
    client.answer(ComputeMaps, Maps((replace(MAP), replace(MAP))))
    ready.poll()
    assert ready.refined == (False, refinement is not None)


def test_maps_go_with_the_last_class_whatever_is_being_computed_of_it(refined: SegmentationProxy, client: StubClient) -> None:
    refined.update([replace(LIVER, positive=np.ones((9, 3)))], Refinement())
    answering = len(client.asked)
    refined.update([], Refinement())
    assert (refined.maps, refined.low_maps, refined.volumes_ml) == ({}, {}, {})
    assert client.cancelled == [answering]
    client.answer(ComputeMaps, Maps((PROPOSED,)))
    assert refined.poll() == set()
    assert not refined.busy


def test_volumes_come_after_the_maps_and_go_with_the_classes(ready: SegmentationProxy, client: StubClient) -> None:
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


def test_labels_come_with_the_ids_of_their_classes(ready: SegmentationProxy, client: StubClient) -> None:
    ready.update([SPLEEN, LIVER], None)
    ready.segment(Refinement())
    client.answer(SegmentClasses, Progressed(1, 2, "Segmenting structures"))
    ready.poll()
    assert ready.progress is not None
    assert (ready.progress.done, ready.progress.total) == (1, 2)
    labels = Labels(np.zeros((2, 2, 2), dtype=np.uint8), (0, 0, 0))
    client.answer(SegmentClasses, labels)
    assert "labels" in ready.poll()
    assert ready.take_labels() == (labels, ["spleen", "liver"])
    assert ready.take_labels() is None
    assert ready.progress is None


def test_a_refused_setting_is_reported_once_and_sent_again_with_the_next_extraction(client: StubClient) -> None:
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


def test_where_features_in_the_cache_cannot_be_used_what_others_cost_is_known_before_they_are_asked_for(
    client: StubClient,
) -> None:
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type, return-value]
    proxy.open(VOLUME, SETTINGS)
    client.answer(Prepare, replace(COSTLY, cached=True))
    proxy.poll()
    for estimate in (replace(COSTLY, cached=True), COSTLY):  # In the second case, they were damaged.
        client.answer(Extract, Failed("There are no weights."))
        proxy.poll()
        assert (proxy.take_error(), proxy.estimate) == ("There are no weights.", None)
        assert client.kinds()[-2:] == ["Extract", "Prepare"]
        client.answer(Prepare, estimate)
        proxy.poll()
        assert (proxy.phase, proxy.estimate) == ("no features", estimate)
        assert client.kinds()[-1] == "Prepare"
        proxy.extract()
    client.answer(Extract, Failed("There is no network."))
    proxy.poll()
    assert proxy.estimate == COSTLY


def test_a_refused_volume_leaves_none(client: StubClient) -> None:
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type, return-value]
    proxy.open(VOLUME, SETTINGS)
    client.answer(TakeVolume, Failed("'CT' is constant."))
    proxy.poll()
    assert (proxy.phase, proxy.take_error(), proxy.busy) == ("no volume", "'CT' is constant.", False)


def test_nothing_seems_to_run_after_a_volume_was_refused_for_which_extraction_was_asked(client: StubClient) -> None:
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type, return-value]
    proxy.open(VOLUME, SETTINGS)
    proxy.extract()
    client.answer(TakeVolume, Failed("'CT' is constant."))
    proxy.poll()
    assert (proxy.progress, proxy.busy) == (None, False)


def test_cancelling_gives_up_what_the_user_waits_for_and_nothing_else(ready: SegmentationProxy, client: StubClient) -> None:
    ready.update([LIVER], None)
    ready.poll()
    ready.segment(Refinement())
    ready.cancel()
    assert client.cancelled == [len(client.asked)]
    client.answer(SegmentClasses, GivenUp())
    ready.poll()
    assert ready.progress is None
    assert ready.take_error() is None


def test_labels_that_were_on_their_way_when_the_user_cancelled_are_dropped(
    ready: SegmentationProxy, client: StubClient
) -> None:
    ready.update([LIVER], None)
    ready.poll()
    ready.segment(Refinement())
    client.answer(SegmentClasses, Labels(np.ones((1, 1, 1), np.uint8), (0, 0, 0)))
    ready.cancel()
    assert "labels" not in ready.poll()
    assert (ready.take_labels(), ready.progress) == (None, None)


def test_a_lost_process_is_reported_and_started_again_by_the_next_extraction(
    refined: SegmentationProxy, client: StubClient
) -> None:
    client.alive = False
    assert refined.poll() == {"state"}
    assert "MemoryError" in (refined.take_error() or "")
    assert (refined.phase, refined.usable, refined.pid) == ("no features", False, None)
    assert (refined.maps, refined.progress, refined.busy) == ({}, None, False)
    client.alive = True
    refined.extract()
    assert client.kinds()[-3:] == ["TakeVolume", "Prepare", "Extract"]
    client.answer(Extract, Loaded(""))
    refined.poll()
    assert client.asked[-1] == ComputeMaps((LIVER,))


def test_why_features_are_not_kept_is_known_until_another_volume_is_opened(
    proxy: SegmentationProxy, client: StubClient
) -> None:
    proxy.extract()
    client.answer(Extract, Loaded("The disk is full."))
    assert proxy.poll() == {"state"}
    assert (proxy.phase, proxy.not_kept, proxy.take_error()) == ("ready", "The disk is full.", None)
    proxy.open(VOLUME, SETTINGS)
    assert proxy.not_kept == ""


def test_why_features_of_a_close_up_are_not_kept_is_known_as_well(looked_at: SegmentationProxy, client: StubClient) -> None:
    client.answer(LookCloser, Loaded("The disk is full."))
    assert looked_at.poll() == {"state"}
    assert (looked_at.phase, looked_at.not_kept, looked_at.take_error()) == ("ready", "The disk is full.", None)


def test_a_process_that_was_started_ahead_serves_the_volume_that_is_chosen_then(client: StubClient) -> None:
    started: list[StubClient] = []

    def start() -> StubClient:
        started.append(client)
        return client

    proxy = SegmentationProxy(start)  # type: ignore[arg-type]
    proxy.start()
    proxy.start()
    assert (started, client.kinds()) == ([client], [])
    proxy.open(VOLUME, SessionSettings())
    assert (started, client.kinds()) == ([client], ["TakeVolume", "Prepare"])


def test_nothing_is_said_of_a_process_that_was_started_ahead_and_was_not_needed_yet(client: StubClient) -> None:
    def fail() -> StubClient:
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


def test_a_reply_whose_taking_in_raises_does_not_cost_those_behind_it(
    proxy: SegmentationProxy, client: StubClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("a defect")

    proxy.open(VOLUME, SETTINGS)
    monkeypatch.setitem(proxy._handlers, (TakeVolume, Taken), fail)
    client.answer(TakeVolume, Taken("0f"))
    client.answer(Prepare, COSTLY)
    with pytest.raises(RuntimeError, match="a defect"):
        proxy.poll()
    assert proxy.poll() == {"state"}
    assert proxy.estimate == COSTLY
    assert not proxy.busy
