"""One case and all that decides its segmentation, and the record by which it is known again.

Beside each segmentation `CASE.seg.nrrd` lies `CASE.cohort.json`: a digest of all that went in, the hash of what came out, and
a report. A case whose digest is still the same is not computed again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ViTTransferFunction.CommandLine.cohort.cases import Case
from ViTTransferFunction.CommandLine.cohort.outcome import CaseOutcome
from ViTTransferFunction.CommandLine.package_versions import THIS_PROGRAM, package_version
from ViTTransferFunction.Logic.core.system.atomic_file import replacing
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.regular_file import check_regular_file
from ViTTransferFunction.Logic.features.settings import FORMAT_VERSION
from ViTTransferFunction.Logic.files.image_formats import SEGMENTATION_ENDING
from ViTTransferFunction.Logic.files.volume_files import files_of
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod
from ViTTransferFunction.Logic.session.presets import preset
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.download import sha256_of

RECORD_ENDING = ".cohort.json"
KEPT_FOLDER = "kept"


@dataclass(frozen=True)
class CohortSettings:
    """What is the same for all cases.

    Attributes:
        session: with the model and the weights file named.
        weights_sha256: of that file.
        method: how maps are refined.
        only_annotated_components: whether parts of a segment are dropped that hold none of its positive points.
    """

    session: SessionSettings
    weights_sha256: str
    method: RefinementMethod = "bilateral"
    only_annotated_components: bool = True


@dataclass(frozen=True)
class CaseJob:
    """A case to be segmented.

    Attributes:
        case: volume and annotations.
        settings: of the cohort.
        folder: absolute path of where results go.
    """

    case: Case
    settings: CohortSettings
    folder: Path

    @property
    def output(self) -> Path:
        """Where the segmentation goes."""
        return self.folder / f"{self.case.name}{SEGMENTATION_ENDING}"

    @property
    def record(self) -> Path:
        """Where the record goes."""
        return self.folder / f"{self.case.name}{RECORD_ENDING}"

    def digest(self) -> str:
        """SHA-256 of all that decides the segmentation: files, settings, weights, and the version of the method.

        Neither where the files lie is part of it, nor the device that is computed on.

        Raises:
            InputError: a file cannot be read.
        """
        check_regular_file(self.case.annotations)
        settings = self.settings.session
        decisive: dict[str, Any] = {
            "program": package_version(THIS_PROGRAM),
            "features": FORMAT_VERSION,
            "preset": repr(preset(settings.preset)),
            "session": {**asdict(settings), "weights_path": None, "device": None},
            "weights": self.settings.weights_sha256,
            "refinement": self.settings.method,
            "only_annotated_components": self.settings.only_annotated_components,
            "volume": [(path.name, sha256_of(path)) for path in files_of(self.case.volume)],
            "annotations": sha256_of(self.case.annotations),
        }
        if self.case.series is not None:
            decisive["series"] = self.case.series
        return hashlib.sha256(json.dumps(decisive, sort_keys=True).encode()).hexdigest()

    def finished(self) -> CaseOutcome | None:
        """What became of the case in an earlier run, if all that decides it is still the same; else None."""
        record = self._read_record()
        if record is None or not self.output.is_file():
            return None
        try:
            if record["digest"] != self.digest():
                return None
            corrected = record["output_sha256"] != sha256_of(self.output)
            millilitres = {entry["name"]: float(entry["millilitres"]) for entry in record["report"]["classes"]}
            seconds = float(record["seconds"])
            messages = [str(warning) for warning in record.get("warnings", ())]
        except InputError:
            return None  # Whoever segments it meets the error again, and reports it.
        except (KeyError, TypeError, ValueError):
            return None  # Not a record of this version.
        if corrected:
            messages.append("the segmentation was changed since; millilitres are of before")
        return CaseOutcome(self.case.name, "unchanged", seconds, millilitres, "; ".join(messages))

    def keep_corrected_output(self) -> Path | None:
        """Move a segmentation out of the way that somebody changed since it was written, or that is not ours.

        Returns:
            Where it is now, in the folder `kept`; None where there was nothing to keep.

        Raises:
            InputError: it cannot be moved.
        """
        if not self.output.is_file():
            return None
        record = self._read_record()
        if record is not None and record.get("output_sha256") == sha256_of(self.output):
            return None
        kept = next(path for path in self._places_to_keep() if not path.exists())
        try:
            kept.parent.mkdir(exist_ok=True)
            self.output.rename(kept)
        except OSError as error:
            raise InputError(
                f"{self.output} was changed since it was computed, and cannot be moved to {kept}: {error.strerror or error}. "
                "Move it elsewhere."
            ) from error
        return kept

    def write_record(self, digest: str, seconds: float, report: dict[str, Any], warnings: Sequence[str] = ()) -> None:
        """Write down what the segmentation that was just written came from, and what the user was warned of."""
        record = {
            "digest": digest,
            "output_sha256": sha256_of(self.output),
            "seconds": round(seconds, 3),
            "warnings": list(warnings),
            "report": report,
        }
        with replacing(self.record) as temporary:
            temporary.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")

    def _read_record(self) -> dict[str, Any] | None:
        try:
            record = json.loads(self.record.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return record if isinstance(record, dict) else None

    def _places_to_keep(self) -> Iterator[Path]:
        number = 1
        while True:
            yield self.folder / KEPT_FOLDER / f"{self.case.name}-{number}{SEGMENTATION_ENDING}"
            number += 1
