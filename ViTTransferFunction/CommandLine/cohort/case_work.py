"""What a worker does: one case from files to files, on the way that `vittf segment` goes."""

from __future__ import annotations

import time
from functools import cache
from threading import Lock

from ViTTransferFunction.CommandLine.cohort.job import CaseJob
from ViTTransferFunction.CommandLine.cohort.outcome import CaseOutcome
from ViTTransferFunction.CommandLine.library_file_names import take_utf8_file_names
from ViTTransferFunction.CommandLine.segmenting import segment_classes, segmentation_report, write_classes
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.features.networks import Networks
from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.session.opening import open_session

_one_at_a_time = Lock()
"""A worker that was started with several threads shares them among cases otherwise, and holds all their memory at once."""


def segment_case(job: CaseJob) -> CaseOutcome:
    """Segment a case and write segmentation and record. Raises nothing: the outcome says what went wrong."""
    take_utf8_file_names()
    try:
        with _one_at_a_time:
            return _segment(job)
    except InputError as error:
        return CaseOutcome(job.case.name, "refused", message=str(error))
    # A defect in one case must not cost the others; whoever gets the outcome has it tried elsewhere.
    except Exception as error:
        return CaseOutcome(job.case.name, "failed", message=f"{type(error).__name__}: {error}")


def _segment(job: CaseJob) -> CaseOutcome:
    start = time.perf_counter()
    settings = job.settings
    # Of the files as they are before they are read: what changes later is computed again.
    digest = job.digest()
    warnings: list[str] = []
    volume = read_volume(job.case.volume, warnings.append, job.case.series)
    session = open_session(volume, settings.session, networks=_networks())
    classes = read_annotations(job.case.annotations, session.volume.geometry)
    segmentation = segment_classes(
        session, classes, settings.method, settings.only_annotated_components, on_warning=warnings.append
    )
    _check_weights(session.provenance.weights.sha256, settings.weights_sha256)
    kept = job.keep_corrected_output()
    write_classes(job.output, session, classes, segmentation)
    seconds = time.perf_counter() - start
    report = segmentation_report(session, segmentation, settings.session.preset, settings.method)
    job.write_record(digest, seconds, report, warnings)
    millilitres = {result.name: result.millilitres for result in segmentation.classes}
    messages = [f"the segmentation that was there, and not as it was computed, is now {kept}"] if kept else []
    return CaseOutcome(job.case.name, "done", seconds, millilitres, "; ".join([*warnings, *messages]))


@cache
def _networks() -> Networks:
    """Weights are loaded once in a process."""
    return Networks()


def _check_weights(got: str, expected: str) -> None:
    if got != expected:
        raise InputError(
            f"The worker's weights file has SHA-256 {got}, that of the computer which leads the cohort {expected}. "
            "Put the same file at the same place on both."
        )
