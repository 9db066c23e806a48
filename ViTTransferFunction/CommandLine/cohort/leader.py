"""Who leads a cohort: from the command line to cases, workers, and a table of what became of them."""

from __future__ import annotations

import argparse
import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ViTTransferFunction.CommandLine.cohort.cases import Case, name_problem, read_cases, told_name
from ViTTransferFunction.CommandLine.cohort.cluster_size import largest_first, local_size, shared_out
from ViTTransferFunction.CommandLine.cohort.dispatch import check_workers, run_jobs
from ViTTransferFunction.CommandLine.cohort.folder_lock import only_cohort_in
from ViTTransferFunction.CommandLine.cohort.job import RECORD_ENDING, CaseJob, CohortSettings
from ViTTransferFunction.CommandLine.cohort.outcome import CaseOutcome
from ViTTransferFunction.CommandLine.cohort.table import CohortTable
from ViTTransferFunction.CommandLine.options import session_settings
from ViTTransferFunction.CommandLine.output_paths import check_apart
from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
from ViTTransferFunction.Logic.core.system.atomic_file import check_writable, remove_leftovers
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.files.image_formats import SEGMENTATION_ENDING
from ViTTransferFunction.Logic.files.volume_files import files_of
from ViTTransferFunction.Logic.session.opening import chosen_model
from ViTTransferFunction.Logic.weights.sources import find_weights

if TYPE_CHECKING:
    from distributed import Client

TABLE = "cohort.csv"
SCHEDULER_PATIENCE_S = 60.0
"""A batch system may take as long until the first worker runs."""


def lead_cohort(args: argparse.Namespace) -> int:
    """Have all cases computed that are not done yet.

    Args:
        args: of `vittf cohort`.

    Returns:
        0 where every case has a segmentation, else 1.

    Raises:
        InputError: the cases as a whole, a setting, the weights or the cluster cannot be used, or another cohort is writing to
            the same folder.
    """
    _check_options(args)
    all_cases, folder = read_cases(args.cases), args.output.absolute()
    # No case stops the others, whatever it is called.
    refused = {case.name: problem for case in all_cases if (problem := name_problem(case.name))}
    cases = [case for case in all_cases if case.name not in refused]
    _check_outputs(args.cases, cases, folder)
    _check_installed()
    settings = _settings(args)
    jobs = {case.name: CaseJob(case, settings, folder) for case in cases}
    table = CohortTable(folder / TABLE, [case.name for case in all_cases])
    table.outcomes |= {name: CaseOutcome(told_name(name), "refused", message=problem) for name, problem in refused.items()}
    with only_cohort_in(folder):
        waiting = _take_finished(table, jobs)
        if waiting:
            _compute(table, [jobs[case.name] for case in largest_first(waiting)], args)
            _note_removed(table, jobs)
        table.save()
    return _summarise(table)


def _check_options(args: argparse.Namespace) -> None:
    if args.scheduler and args.workers is not None:
        raise InputError("--workers is for this computer; a scheduler has its own. Give one of --workers and --scheduler.")
    if args.workers is not None and args.workers < 1:
        raise InputError(f"--workers {args.workers}: expected 1 or more.")


def _check_installed() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise InputError(f"A cohort needs Dask ({error}). Install it: pip install 'vit-transfer-function[cohort]'") from error


def _check_outputs(source: Path, cases: Sequence[Case], folder: Path) -> None:
    """Raise InputError where a result would replace what it is made from, or cannot be written."""
    if folder.resolve() in {source.resolve(), *(case.volume.resolve() for case in cases)}:
        raise InputError(f"Results in {folder} would mix with what they are made from; name another folder by --output.")
    inputs = {"the table of cases": [source]}
    outputs = {"the table of results": folder / TABLE}
    for case in cases:
        inputs[f"the volume of case '{case.name}'"] = _files_of(case.volume)
        inputs[f"the annotations of case '{case.name}'"] = [case.annotations]
        outputs[f"the segmentation of case '{case.name}'"] = folder / f"{case.name}{SEGMENTATION_ENDING}"
        outputs[f"the record of case '{case.name}'"] = folder / f"{case.name}{RECORD_ENDING}"
    check_apart(outputs, inputs)
    check_writable(folder / TABLE)


def _files_of(volume: Path) -> list[Path]:
    try:
        return files_of(volume)
    except InputError:
        return [volume]  # Its worker will say what is wrong with it.


def _settings(args: argparse.Namespace) -> CohortSettings:
    """What the options say, with model and weights found once for all cases."""
    session = session_settings(args)
    model = chosen_model(session)
    with ProgressBar() as progress:
        weights = find_weights(model.name, session.weights_path, progress=progress)
    session = replace(session, model=model.name, weights_path=str(weights.path.absolute()))
    return CohortSettings(session, weights.sha256, args.refine, not args.keep_all_components)


def _take_finished(table: CohortTable, jobs: dict[str, CaseJob]) -> list[Case]:
    """Put into the table what an earlier run did and is still valid; gives the other cases."""
    waiting = []
    with ProgressBar() as progress:
        for done, job in enumerate(jobs.values(), start=1):
            if (outcome := job.finished()) is None:
                waiting.append(job.case)
            else:
                table.outcomes[outcome.case] = outcome
            progress(done, len(jobs), "Comparing with what is there")
    table.save()
    return waiting


def _compute(table: CohortTable, jobs: Sequence[CaseJob], args: argparse.Namespace) -> None:
    with _cluster(jobs, args) as client, ProgressBar() as progress:
        progress(0, len(jobs), "Segmenting cases")
        for done, outcome in enumerate(run_jobs(client, jobs), start=1):
            table.put(outcome)
            progress(done, len(jobs), "Segmenting cases")


def _note_removed(table: CohortTable, jobs: dict[str, CaseJob]) -> None:
    """Call no case done whose segmentation is gone: the folder was moved meanwhile, say, and workers made it anew."""
    for name, job in jobs.items():
        if table.outcomes[name].status in ("done", "unchanged") and not job.output.is_file():
            message = f"{job.output} is not there any more; was it moved or removed meanwhile? Give the same command again"
            table.outcomes[name] = CaseOutcome(name, "failed", message=message)


@contextmanager
def _cluster(jobs: Sequence[CaseJob], args: argparse.Namespace) -> Iterator[Client]:
    """The scheduler that the user names, or a cluster on this computer for as long as the context lasts."""
    # Dask tells of every connection that is made or lost, at length. What matters to the user becomes an outcome or an error.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if args.scheduler:
        with _client_of(args.scheduler) as client:
            check_workers(client, args.scheduler, SCHEDULER_PATIENCE_S)
            yield client
        return
    from dask.system import CPU_COUNT

    from ViTTransferFunction.CommandLine.cohort.local_cluster import local_cluster

    if args.workers is None:
        size = local_size([job.case for job in jobs], jobs[0].settings.session)
    else:
        size = shared_out(min(args.workers, len(jobs)), CPU_COUNT)
    print(f"Workers: {size.workers} × {size.threads} threads on this computer")
    try:
        with local_cluster(size.workers, size.threads) as client:
            yield client
    finally:
        # A worker that was killed had no time to tidy up.
        remove_leftovers(jobs[0].folder)


def _client_of(address: str) -> Client:
    from distributed import Client

    try:
        return Client(address, set_as_default=False)
    # Of Dask where no certificates are configured for tls://, or what the address needs is not installed.
    except (TypeError, ImportError) as error:
        raise InputError(f"There is no way to the scheduler {address}: {error}. Check Dask's configuration.") from error
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"There is no scheduler of Dask at {address}: {error}. Check the address, and that it runs."
        ) from error


def _summarise(table: CohortTable) -> int:
    outcomes = list(table.outcomes.values())
    for outcome in outcomes:
        if outcome.message:
            print(f"  {outcome.case}: {outcome.message}")
    counts = Counter(outcome.status for outcome in outcomes)
    print(f"Cases: {', '.join(f'{counts[status]} {status}' for status in ('done', 'unchanged', 'refused', 'failed'))}")
    print(f"Table: {table.path}")
    return 1 if counts["refused"] or counts["failed"] else 0
