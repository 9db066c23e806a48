"""A cluster of processes on this computer that nobody else can access.

Anyone who can connect to a scheduler or worker of Dask can make it run any program. Therefore all ports are bound to 127.0.0.1.
Since other users of the computer can reach these, connections are encrypted, and need a key that is created for the run and
kept in memory. The web pages of scheduler and workers are not served.

This file imports Dask, and must be imported within functions only.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import resource_tracker
from typing import Any, Literal

import dask
from distributed import Client, Nanny, Scheduler, Security, SpecCluster, Worker

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.private_folder import private_folder

HOST = "127.0.0.1"
_CONFIG = {
    # A worker's death is reported at once, since the leader of the cohort decides about retries.
    "distributed.scheduler.allowed-failures": 0,
    # Cases wait at the scheduler; those that wait at a worker would be blamed for its death.
    "distributed.scheduler.worker-saturation": 1.0,
    # Dask checks once, by default 15 s after a worker died, and permanently drops a worker that is not running at that moment,
    # because it died again or the computer is slow. After the last one was dropped, the remaining cases would wait forever.
    "distributed.deploy.lost-worker-timeout": "365 days",
    # Dask would otherwise set these variables in this process.
    "distributed.nanny.pre-spawn-environ": {},
    "distributed.comm.timeouts.connect": "30s",
}


class _NoWebPages:
    """Mixin before a scheduler's or worker's class, by which it serves no web pages."""

    def start_http_server(self, *_: Any, **__: Any) -> None:
        """Do nothing."""


class PrivateScheduler(_NoWebPages, Scheduler):
    """A scheduler that serves no web pages."""


class PrivateWorker(_NoWebPages, Worker):
    """A worker that serves no web pages."""


class ImpatientNanny(Nanny):
    """Restarts a worker that died, and does not wait for one that computes when the cluster ends."""

    async def close(self, *args: Any, **kwargs: Any) -> Literal["OK"]:  # type: ignore[override]
        """End the worker at once, since its results are in files."""
        if self.pid:
            # If it has ended by itself, Windows refuses to end it again.
            with suppress(OSError):
                os.kill(self.pid, signal.SIGTERM)
        return await super().close(*args, **kwargs)


@contextmanager
def local_cluster(workers: int, threads: int) -> Iterator[Client]:
    """A client of a new cluster, which ends with the context, whatever it is doing.

    Args:
        workers: number of processes, each of which computes one case at a time.
        threads: number of threads of each worker.

    Raises:
        InputError: a required package is missing.
    """
    security = _security()
    place = {"host": HOST, "protocol": "tls://", "security": security}
    with ExitStack() as stack:
        scratch = stack.enter_context(private_folder())
        # The scheduler makes Python look for modules in its own folder first, which by default lies in one that others can
        # create.
        stack.enter_context(dask.config.set({**_CONFIG, "temporary-directory": scratch}))
        worker = {
            **place,
            "worker_class": PrivateWorker,
            "nthreads": 1,
            "env": _environment(threads),
            "local_directory": scratch,
            # Dask's own limit would permanently stop a worker whose libraries keep memory for the next case.
            "memory_limit": 0,
            "silence_logs": logging.CRITICAL,
        }
        with _interrupts_held_back():
            cluster = SpecCluster(
                scheduler={"cls": PrivateScheduler, "options": {**place, "port": 0, "dashboard": False}},
                workers={index: {"cls": ImpatientNanny, "options": worker} for index in range(workers)},
                security=security,
            )
            stack.enter_context(cluster)
        yield stack.enter_context(Client(cluster, security=security, set_as_default=False))


def _security() -> Security:
    try:
        return Security.temporary()
    except ImportError as error:
        raise InputError(f"{error}. Install what a cohort needs: pip install 'vit-transfer-function[cohort]'") from error


def _environment(threads: int) -> dict[str, str]:
    """The environment of a worker; apart from the number of threads, as in `dev.py` and the compute process."""
    return {"OMP_NUM_THREADS": str(threads), "OMP_WAIT_POLICY": "passive", "OPENBLAS_NUM_THREADS": "1"}


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Start threads and processes within that never receive a Ctrl-C; this thread receives it afterwards.

    A terminal sends it to all processes. Each worker would print a traceback, although the leader ends them anyway. On Windows,
    a Ctrl-C during the context is lost.
    """
    if sys.platform == "win32":
        # Programs that are started within inherit that they ignore it.
        import ctypes

        hear = ctypes.windll.kernel32.SetConsoleCtrlHandler
        hear(None, True)
        try:
            yield
        finally:
            hear(None, False)
        return
    # Started before, since starting it within would unblock Ctrl-C.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
