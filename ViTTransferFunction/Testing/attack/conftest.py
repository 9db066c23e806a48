"""The process that runs of the program are forked from, once for all tests."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from ViTTransferFunction.Testing.attack.forked_calls import ForkedCalls


@pytest.fixture(scope="session")
def forked() -> Iterator[ForkedCalls]:
    if not hasattr(os, "fork"):
        pytest.skip("cases run in forked processes, which this operating system does not have")
    with ForkedCalls() as calls:
        yield calls
