"""What Linux tells of the memory there is, and early refusal."""

from __future__ import annotations

from pathlib import Path

import pytest

from ViTTransferFunction.Logic.core.system import available_memory
from ViTTransferFunction.Logic.core.system.available_memory import available_memory_bytes, require_memory
from ViTTransferFunction.Logic.core.system.errors import InputError

MEMINFO = "MemTotal: 8000000 kB\nMemFree: 100 kB\nMemAvailable: 2000000 kB\nSwapFree: 500000 kB\n"


@pytest.fixture
def linux(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file system in which Linux tells of 2.56 GB."""
    monkeypatch.setattr("sys.platform", "linux")
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/meminfo").write_text(MEMINFO)
    return tmp_path


def test_what_is_available_counts_and_swap_space_does_unless_it_is_not_wanted(linux: Path) -> None:
    assert available_memory_bytes(linux) == 2_500_000 * 1024
    assert available_memory_bytes(linux, with_swap=False) == 2_000_000 * 1024


@pytest.mark.parametrize(
    ("membership", "group", "names"),
    [
        ("0::/job/step", "job", ("memory.max", "memory.current")),
        ("4:memory:/job", "memory/job", ("memory.limit_in_bytes", "memory.usage_in_bytes")),
    ],
    ids=["version 2, of a group around it", "version 1"],
)
def test_a_limit_on_a_container_counts_less_what_caches_can_give_back(
    linux: Path, membership: str, group: str, names: tuple[str, str]
) -> None:
    (linux / "proc/self/cgroup").write_text(f"{membership}\n1:cpu:/elsewhere\n")
    folder = linux / "sys/fs/cgroup" / group
    (folder / "step").mkdir(parents=True)
    (folder / "step/memory.max").write_text("max\n")
    for name, number in zip(names, (1000, 700), strict=True):
        (folder / name).write_text(f"{number}\n")
    (folder / "memory.stat").write_text("anon 600\nactive_file 30\ninactive_file 20\n")
    assert available_memory_bytes(linux) == 350


def test_this_computer_tells_something_of_its_memory() -> None:
    available = available_memory_bytes()
    assert available is None or available > 2**20


def test_what_cannot_fit_is_refused_with_both_figures_and_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: 1_200_000_000)
    require_memory(1_200_000_000, "Segmenting 'scan'", "Crop it.")
    with pytest.raises(InputError, match=r"Segmenting 'scan' takes at least 3\.4 GB .* 1\.2 GB are free\. Crop it\."):
        require_memory(3_400_000_000, "Segmenting 'scan'", "Crop it.")


def test_where_the_system_does_not_tell_nothing_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: None)
    require_memory(10**15, "Segmenting 'scan'", "Crop it.")
