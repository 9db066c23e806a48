"""Compute processes of the tests, and proxies whose process is a stub."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ViTTransferFunction.Logic.compute import due_requests
from ViTTransferFunction.Logic.compute.client import ComputeClient
from ViTTransferFunction.Logic.compute.proxy import SegmentationProxy
from ViTTransferFunction.Logic.compute.requests import (
    ComputeMaps,
    Extract,
    Loaded,
    Maps,
    Prepare,
    Refinement,
    Taken,
    TakeVolume,
)
from ViTTransferFunction.Testing.support.stub_client import CLOSER, COSTLY, MAP, SETTINGS, SPLEEN, VOLUME, StubClient


@pytest.fixture
def start() -> Iterator[Callable[..., ComputeClient]]:
    """Starts compute processes, with another program in the place of Python if its path is given, and ends them all."""
    clients = []

    def started(path: Path | None = None) -> ComputeClient:
        clients.append(ComputeClient(path))
        return clients[-1]

    yield started
    for client in clients:
        client.close()


@pytest.fixture
def client() -> StubClient:
    return StubClient()


@pytest.fixture
def proxy(client: StubClient, monkeypatch: pytest.MonkeyPatch) -> SegmentationProxy:
    """With a volume whose features are not cached; nothing waits for the user to pause, and nothing takes any time."""
    # A busy computer may stand still for longer than an answer is waited for.
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now)
    monkeypatch.setattr(due_requests, "RENDER_AFTER_S", 0.0)
    monkeypatch.setattr(due_requests, "REFINE_AFTER_S", 0.0)
    proxy = SegmentationProxy(lambda: client)  # type: ignore[arg-type, return-value]
    proxy.open(VOLUME, SETTINGS)
    client.answer(TakeVolume, Taken("0f"))
    client.answer(Prepare, COSTLY)
    proxy.poll()
    return proxy


@pytest.fixture
def ready(proxy: SegmentationProxy, client: StubClient) -> SegmentationProxy:
    """With features, and no class yet."""
    proxy.extract()
    client.answer(Extract, Loaded(""))
    proxy.poll()
    return proxy


@pytest.fixture
def looked_at(ready: SegmentationProxy, client: StubClient) -> SegmentationProxy:
    """With one class that is to be looked at by itself; its features are being computed."""
    ready.update([CLOSER, SPLEEN], Refinement())
    client.answer(ComputeMaps, Maps((MAP, MAP), awaiting_close_ups=("liver",)))
    ready.poll()
    return ready
