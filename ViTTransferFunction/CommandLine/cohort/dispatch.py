"""Cases to the workers of a cluster, and what became of them back.

A case that is refused would be refused again. One that fails, or whose worker dies, is tried once more, by another worker where
there is one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ViTTransferFunction.CommandLine.cohort.case_work import segment_case
from ViTTransferFunction.CommandLine.cohort.job import CaseJob
from ViTTransferFunction.CommandLine.cohort.outcome import CaseOutcome
from ViTTransferFunction.CommandLine.package_versions import THIS_PROGRAM, package_version
from ViTTransferFunction.Logic.core.system.errors import InputError

if TYPE_CHECKING:
    from distributed import Client, Future

MOST_ATTEMPTS = 2


@dataclass(frozen=True)
class Attempt:
    """What became of a case on one worker.

    Attributes:
        outcome: of the case.
        worker: its address; "" where the cluster does not say.
        is_last: whether trying again is of no use.
    """

    outcome: CaseOutcome
    worker: str
    is_last: bool


def run_jobs(client: Client, jobs: Iterable[CaseJob]) -> Iterator[CaseOutcome]:
    """Have a cluster compute cases, in the given order as far as workers become free.

    Args:
        client: connected to the cluster.
        jobs: of different cases.

    Yields:
        What became of each, as soon as it is known.

    Raises:
        InputError: the connection to the cluster was lost.
    """
    from distributed import as_completed

    # Not pure: two runs of the same case are two tasks.
    running = {client.submit(attempt_case, job, pure=False): (job, 1) for job in jobs}
    completed = as_completed(list(running), loop=client.loop)
    for future in completed:
        job, attempts = running.pop(future)
        attempt = _attempt_of(future, job)
        if attempt.outcome.status != "failed" or attempt.is_last or attempts == MOST_ATTEMPTS:
            yield attempt.outcome
            continue
        others = [worker for worker in client.scheduler_info(n_workers=-1)["workers"] if worker != attempt.worker]
        # Where all others are gone, the same worker may try again.
        again = client.submit(attempt_case, job, pure=False, workers=others or None, allow_other_workers=bool(others))
        running[again] = (job, attempts + 1)
        completed.add(again)


def attempt_case(job: CaseJob) -> Attempt:
    """Segment a case on the worker that runs this."""
    from distributed import get_worker

    return Attempt(segment_case(job), get_worker().address, is_last=False)


def check_workers(client: Client, address: str, patience_s: float) -> None:
    """Raise InputError unless a scheduler has workers, within `patience_s`, that run the same version of this program."""
    try:
        client.wait_for_workers(1, timeout=patience_s)
    except TimeoutError as error:
        raise InputError(
            f"The scheduler {address} has no workers after {patience_s:.0f} s. Start some: dask worker {address} --nthreads 1"
        ) from error
    here = package_version(THIS_PROGRAM)
    try:
        versions = client.run(package_version, THIS_PROGRAM)
    except Exception as error:
        raise InputError(
            f"Workers of {address} cannot run this program ({type(error).__name__}: {error}). "
            "Install the same version of it, and of Python, on all computers."
        ) from error
    for worker, version in versions.items():
        if version != here:
            raise InputError(
                f"The worker {worker} has version {version} of this program, and this computer {here}; install one."
            )


def _attempt_of(future: Future, job: CaseJob) -> Attempt:
    from distributed import KilledWorker

    if future.status == "finished":
        attempt: Attempt = future.result()
        return attempt
    error = future.exception() if future.status == "error" else None
    if isinstance(error, KilledWorker):
        message = "its process was killed while it computed; too little memory is the most frequent cause"
        # A scheduler with patience has tried elsewhere itself.
        return Attempt(_failed(job, message), error.last_worker.address, is_last=error.allowed_failures > 0)
    if error is None:
        raise InputError("The connection to the scheduler was lost. Give the same command again: what is done is kept.")
    return Attempt(_failed(job, f"{type(error).__name__}: {error}"), "", is_last=False)


def _failed(job: CaseJob, message: str) -> CaseOutcome:
    return CaseOutcome(job.case.name, "failed", message=message)
