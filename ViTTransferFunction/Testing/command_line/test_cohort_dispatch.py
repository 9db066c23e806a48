"""Which cases are tried again, and by whom; on workers that are threads of this process."""

from __future__ import annotations

import asyncio
import ctypes
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ViTTransferFunction.CommandLine.cohort import dispatch, leader
from ViTTransferFunction.CommandLine.cohort.cases import Case
from ViTTransferFunction.CommandLine.cohort.job import CaseJob, CohortSettings
from ViTTransferFunction.CommandLine.cohort.outcome import CaseOutcome, Status
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S

distributed = pytest.importorskip("distributed")


def job(name: str) -> CaseJob:
    return CaseJob(Case(name, Path(name), Path(name)), CohortSettings(SessionSettings(), ""), Path())


@pytest.fixture(params=[1, 2], ids=["one worker", "two workers"])
def client(request: pytest.FixtureRequest) -> Iterator[Any]:
    from ViTTransferFunction.CommandLine.cohort.local_cluster import PrivateScheduler, PrivateWorker

    worker = {"cls": PrivateWorker, "options": {"protocol": "inproc://", "nthreads": 1}}
    cluster = distributed.SpecCluster(
        scheduler={"cls": PrivateScheduler, "options": {"protocol": "inproc://", "dashboard": False}},
        workers=dict.fromkeys(range(request.param), worker),
    )
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        yield client


@pytest.fixture
def attempts(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[str]]:
    """Workers that tried each case; cases do what their name says."""
    attempts: dict[str, list[str]] = defaultdict(list)

    def segment_case(job: CaseJob) -> CaseOutcome:
        attempts[job.case.name].append(distributed.get_worker().address)
        statuses: dict[str, Callable[[int], Status]] = {
            "done": lambda _: "done",
            "refused": lambda _: "refused",
            "fails": lambda _: "failed",
            "fails once": lambda attempt: "failed" if attempt == 1 else "done",
        }
        return CaseOutcome(job.case.name, statuses[job.case.name](len(attempts[job.case.name])))

    monkeypatch.setattr(dispatch, "segment_case", segment_case)
    return attempts


def test_what_fails_is_tried_once_more_by_another_worker_and_what_is_refused_is_not(
    client: Any, attempts: dict[str, list[str]]
) -> None:
    jobs = [job(name) for name in ("done", "refused", "fails", "fails once")]

    outcomes = {outcome.case: outcome.status for outcome in dispatch.run_jobs(client, jobs)}

    assert outcomes == {"done": "done", "refused": "refused", "fails": "failed", "fails once": "done"}
    assert {name: len(workers) for name, workers in attempts.items()} == {"done": 1, "refused": 1, "fails": 2, "fails once": 2}
    if len(client.scheduler_info()["workers"]) > 1:
        assert len(set(attempts["fails"])) == len(set(attempts["fails once"])) == 2


def test_workers_of_another_version_are_refused(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    dispatch.check_workers(client, "tls://there", patience_s=10.0)
    versions = iter(["1.0", *["0.9"] * 2])
    monkeypatch.setattr(dispatch, "package_version", lambda _: next(versions))
    # The first answer is that of this computer.
    with pytest.raises(dispatch.InputError, match=r"version 0.9 of this program, and this computer 1.0"):
        dispatch.check_workers(client, "tls://there", patience_s=10.0)


def test_on_windows_workers_inherit_that_they_do_not_hear_ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    from ViTTransferFunction.CommandLine.cohort.local_cluster import _interrupts_held_back

    told: list[tuple[object, bool]] = []
    kernel = SimpleNamespace(SetConsoleCtrlHandler=lambda routine, ignored: told.append((routine, ignored)))
    monkeypatch.setattr(ctypes, "windll", SimpleNamespace(kernel32=kernel), raising=False)
    monkeypatch.setattr(sys, "platform", "win32")
    with suppress(InputError), _interrupts_held_back():
        assert told == [(None, True)]
        raise InputError("a package is missing")
    assert told == [(None, True), (None, False)]


def test_a_worker_that_has_ended_by_itself_is_closed_as_others(monkeypatch: pytest.MonkeyPatch) -> None:
    from ViTTransferFunction.CommandLine.cohort.local_cluster import ImpatientNanny

    async def close(self: object) -> str:
        return "OK"

    def refused(pid: int, number: int) -> None:
        raise PermissionError(13, "Access is denied")  # As Windows says of a process that is over.

    monkeypatch.setattr(distributed.Nanny, "close", close)
    monkeypatch.setattr(ImpatientNanny, "pid", 1234)
    monkeypatch.setattr(os, "kill", refused)
    assert asyncio.run(ImpatientNanny.close(object.__new__(ImpatientNanny))) == "OK"


@pytest.mark.slow
def test_a_worker_that_died_starts_again_however_long_that_takes() -> None:
    import dask

    from ViTTransferFunction.CommandLine.cohort.local_cluster import local_cluster

    # Dask's own patience, after which it would never start again.
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "1 ms"}), local_cluster(1, 1) as client:
        assert isinstance(client.submit(os._exit, 1).exception(), distributed.KilledWorker)
        assert client.submit(abs, -1).result(timeout=LONGEST_WAIT_S) == 1


def test_an_encrypted_address_without_certificates_is_refused() -> None:
    with pytest.raises(InputError, match="TLS expects"), leader._client_of("tls://127.0.0.1:8786"):
        pytest.fail("it was connected")
