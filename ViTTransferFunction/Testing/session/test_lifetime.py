"""Volume and features go with the session that has them, and do not wait until Python looks for circles of references."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute.requests import (
    ComputeMaps,
    Extract,
    Prepare,
    RefineMaps,
    Refinement,
    ReleaseVolume,
    TakeVolume,
)
from ViTTransferFunction.Logic.compute.service import SegmentationService
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.core.volumes.voxel_map import VoxelMap
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.spheres import Spheres, requests_of

SETTINGS = SessionSettings(grid=GRID, device="cpu")


@pytest.fixture(autouse=True)
def no_search_for_circles() -> Iterator[None]:
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def large_arrays_of(session: SegmentationSession) -> list[weakref.ref[np.ndarray]]:
    features = session.features
    return [weakref.ref(array) for array in (session.volume.array, features.array, features.source.array)]


def alive(references: list[weakref.ref[np.ndarray]]) -> int:
    return sum(reference() is not None for reference in references)


def test_a_session_that_is_let_go_keeps_neither_volume_nor_features(spheres: Spheres) -> None:
    cache_known_features(*spheres)
    left = []
    for _ in range(3):
        volume = Volume(spheres[0].array.copy(), spheres[0].geometry)
        session = open_session(volume, SETTINGS)
        session.load_features()
        session.segment(requests_of(spheres))
        left += large_arrays_of(session)
    assert alive(left) == 3
    del session, volume
    assert alive(left) == 0


def test_a_refined_map_is_let_go_before_the_next_one_is_made(spheres: Spheres) -> None:
    cache_known_features(*spheres)
    session = open_session(Volume(spheres[0].array, spheres[0].geometry), SETTINGS)
    session.load_features()
    maps: list[weakref.ref[VoxelMap]] = []
    there: dict[int, int] = {}

    def on_progress(done: int, total: int, what: str) -> None:
        there[done] = sum(reference() is not None for reference in maps)

    session.segment(requests_of(spheres), progress=on_progress, on_map=lambda _, full: maps.append(weakref.ref(full.voxels)))
    assert there == {0: 0, 1: 0, 2: 0, 3: 0}
    assert len(maps) == 3


@pytest.mark.parametrize("prepared", [False, True], ids=["clicked", "prepared"])
def test_the_compute_process_has_one_volume_and_its_features_at_a_time(spheres: Spheres, prepared: bool) -> None:
    cache_known_features(*spheres)
    service = SegmentationService(lambda done, total, what: None)
    left = []
    for _ in range(3):
        service.serve(TakeVolume(spheres[0].array.copy(), spheres[0].geometry, "spheres"))
        service.serve(Prepare(SETTINGS))
        if prepared:
            service.prepare_clicks()
        service.serve(Extract())
        requests = requests_of(spheres)
        service.serve(ComputeMaps(requests))
        service.serve(RefineMaps(requests, Refinement()))
        assert service._session is not None
        left += large_arrays_of(service._session)
        assert alive(left) == 3


def test_a_volume_that_is_closed_leaves_nothing_in_the_compute_process(spheres: Spheres) -> None:
    cache_known_features(*spheres)
    service = SegmentationService(lambda done, total, what: None)
    requests = requests_of(spheres)
    service.serve(TakeVolume(spheres[0].array.copy(), spheres[0].geometry, "spheres"))
    service.serve(Prepare(SETTINGS))
    service.serve(Extract())
    maps = service.serve(ComputeMaps(requests)).maps
    service.serve(RefineMaps(requests, Refinement()))
    assert service._session is not None
    left = [*large_arrays_of(service._session), *(weakref.ref(low.array) for low in maps)]
    del maps
    assert alive(left) == 6
    service.serve(ReleaseVolume())
    assert alive(left) == 0


def test_maps_go_with_the_volume_that_they_are_of(spheres: Spheres) -> None:
    cache_known_features(*spheres)
    service = SegmentationService(lambda done, total, what: None)
    take_volume = TakeVolume(spheres[0].array, spheres[0].geometry, "spheres")
    for request in (take_volume, Prepare(SETTINGS), Extract()):
        service.serve(request)
    maps = service.serve(ComputeMaps(requests_of(spheres))).maps
    left = [weakref.ref(low.array) for low in maps]
    del maps
    assert alive(left) == 3
    service.serve(take_volume)
    assert alive(left) == 0
