"""A cluster of processes on this computer that nobody else can reach.

Whoever can talk to a scheduler or a worker of Dask can have it run any program. All ports are therefore bound to 127.0.0.1.
Other users of the computer are there, too: so connections are encrypted, and only those get one who hold a key that is made for
the run and kept in memory. The web pages of scheduler and workers are not served at all.

Imports Dask: to be imported within functions only.
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
    # A worker's death is reported at once: who leads the cohort decides who tries again.
    "distributed.scheduler.allowed-failures": 0,
    # Cases wait at the scheduler and not at a worker, whose death they would be blamed for.
    "distributed.scheduler.worker-saturation": 1.0,
    # Dask looks once, by default 15 s after a worker died, and gives up for good one that is not there at that moment: since it
    # died again, or the computer is slow. When the last one is given up, what is left waits for ever.
    "distributed.deploy.lost-worker-timeout": "365 days",
    # Set in this process otherwise, where they do not belong.
    "distributed.nanny.pre-spawn-environ": {},
    "distributed.comm.timeouts.connect": "30s",
}


class _NoWebPages:
    """Of a scheduler or worker, in front of its class."""

    def start_http_server(self, *_: Any, **__: Any) -> None:
        """Does not."""


class PrivateScheduler(_NoWebPages, Scheduler):
    """A scheduler that serves no web pages."""


class PrivateWorker(_NoWebPages, Worker):
    """A worker that serves no web pages."""


class ImpatientNanny(Nanny):
    """Starts a worker again that died, and does not wait for one that computes when all is to end."""

    async def close(self, *args: Any, **kwargs: Any) -> Literal["OK"]:  # type: ignore[override]
        """End the worker at once: what it has done is in files."""
        if self.pid:
            # It may have ended by itself: Windows refuses to end it once more.
            with suppress(OSError):
                os.kill(self.pid, signal.SIGTERM)
        return await super().close(*args, **kwargs)


@contextmanager
def local_cluster(workers: int, threads: int) -> Iterator[Client]:
    """A client of a new cluster, which ends with the context, whatever it is doing.

    Args:
        workers: processes, each of which computes one case at a time.
        threads: that each computes with.

    Raises:
        InputError: a package is missing.
    """
    security = _security()
    place = {"host": HOST, "protocol": "tls://", "security": security}
    with ExitStack() as stack:
        scratch = stack.enter_context(private_folder())
        # The scheduler has Python look for modules in its own folder first, which would lie in one that anybody may have made.
        stack.enter_context(dask.config.set({**_CONFIG, "temporary-directory": scratch}))
        worker = {
            **place,
            "worker_class": PrivateWorker,
            "nthreads": 1,
            "env": _environment(threads),
            "local_directory": scratch,
            # Dask's own limit would stop a worker for good whose libraries keep memory for the next case.
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
    """As `dev.py` and the compute process have it, but for the number of threads."""
    return {"OMP_NUM_THREADS": str(threads), "OMP_WAIT_POLICY": "passive", "OPENBLAS_NUM_THREADS": "1"}


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Threads and processes that are started within never get a Ctrl-C; this thread gets it afterwards.

    A terminal sends it to all processes. Workers would each print a traceback, while the one who leads them ends them anyway.
    On Windows, a Ctrl-C that comes within is lost.
    """
    if sys.platform == "win32":
        # Programs that are started within inherit that they do not hear it.
        import ctypes

        hear = ctypes.windll.kernel32.SetConsoleCtrlHandler
        hear(None, True)
        try:
            yield
        finally:
            hear(None, False)
        return
    # It would be started within, and let Ctrl-C through again.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
