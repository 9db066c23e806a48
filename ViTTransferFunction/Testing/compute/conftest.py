"""Compute processes of the tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ViTTransferFunction.Logic.compute.client import ComputeClient


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
