"""How many workers this computer can have, and with how many threads each.

Network and refinement divide their work among threads, but reading, preparing and writing do not. So there are as many workers
as cores, or as cases, unless memory is for fewer; the cores are then shared out among them as threads.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ViTTransferFunction.CommandLine.cohort.cases import Case
from ViTTransferFunction.Logic.core.system.available_memory import available_memory_bytes
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.regular_file import is_folder
from ViTTransferFunction.Logic.core.system.undivided_threads import UndividedThreads
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.files.volume_files import files_of, read_geometry, read_volume
from ViTTransferFunction.Logic.session.memory_need import BYTES_PER_REFINED_VOXEL
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.settings import SessionSettings

PROCESS_BYTES = 800_000_000
"""Measured: Python, PyTorch and the weights of a ViT-S take 0.5 GB, and a volume of a million voxels 0.7 GB more, of
which the estimate of its features says 0.4."""
VOXEL_BYTES = 1 + BYTES_PER_REFINED_VOXEL
"""Beyond the voxel itself: its label, and what a structure takes that fills the volume; see Benchmarks/results/memory.md."""
USED_SHARE = 0.8
"""Of the memory that is free: other programs need some, and estimates err."""


@dataclass(frozen=True)
class ClusterSize:
    """Processes, and threads of each."""

    workers: int
    threads: int


def fitted_size(cases: int, cores: int, case_bytes: int, free_bytes: int | None) -> ClusterSize:
    """The most workers that there are cases, cores and memory for, but at least one; they share all cores.

    Args:
        cases: to be computed.
        cores: of the computer.
        case_bytes: memory that a worker needs.
        free_bytes: memory that there is; None where that is not known.
    """
    fitting = cores if free_bytes is None else int(USED_SHARE * free_bytes // case_bytes)
    return shared_out(max(1, min(cases, cores, fitting)), cores)


def shared_out(workers: int, cores: int) -> ClusterSize:
    """This number of workers, on so many cores."""
    return ClusterSize(workers, max(1, cores // workers))


def local_size(cases: Sequence[Case], settings: SessionSettings) -> ClusterSize:
    """The size for this computer as it is now. Reads the largest volume, to see what its features take.

    Args:
        cases: to be computed, the largest first.
        settings: of the features.

    Raises:
        InputError: weights or device are not to be had.
    """
    from dask.system import CPU_COUNT

    device = choose_device(settings.device)
    if device.type != "cpu":
        # One process fills a graphics processor, and several do not fit into its memory.
        return ClusterSize(1, CPU_COUNT)
    # Each thread of a worker needs memory, and where there is enough for a worker on each core, they have one thread each.
    with UndividedThreads(device, shared=False):
        case_bytes = _case_bytes(cases, settings)
    return fitted_size(len(cases), CPU_COUNT, case_bytes, available_memory_bytes(with_swap=False))


def largest_first(cases: Iterable[Case]) -> list[Case]:
    """Cases by the size of their volumes. A large one that comes last leaves all workers but one idle."""
    return sorted(cases, key=lambda case: _voxels(case.volume), reverse=True)


def _case_bytes(cases: Sequence[Case], settings: SessionSettings) -> int:
    """Memory that a worker needs for the largest case that can be read."""
    volume = next(filter(None, map(_readable, cases)), None)
    if volume is None:
        return PROCESS_BYTES
    voxels = volume.array.nbytes + VOXEL_BYTES * volume.array.size
    return PROCESS_BYTES + voxels + open_session(volume, settings).estimate().memory_bytes


def _readable(case: Case) -> Volume | None:
    try:
        # Its worker will say what is wrong with it.
        return read_volume(case.volume, lambda _: None, case.series)
    except InputError:
        return None


def _voxels(path: Path) -> int:
    """How many voxels a volume has by its header, or about so many; 0 where it cannot be read."""
    try:
        if is_folder(path):
            # DICOM files are seldom compressed, and have two bytes a voxel.
            return sum(file.stat().st_size for file in files_of(path)) // 2
        return math.prod(read_geometry(path).shape)
    except (InputError, OSError):
        return 0
