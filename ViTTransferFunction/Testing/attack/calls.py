"""One run of a program in a process of its own, as the cases ask for it, and how it ended."""

from __future__ import annotations

import signal
from dataclasses import dataclass, field
from typing import Literal

PATIENCE_S = 120.0
"""What runs longer hangs: long, since a busy machine is no hang; on an idle one the longest case takes about five."""
ROOM_BYTES = 2 * 1024**3
"""Memory that a run may take beyond what the loaded libraries have: a header that lies must not exhaust the machine."""


@dataclass(frozen=True)
class Call:
    """One run of `vittf`, or of the compute process.

    Attributes:
        arguments: of the program, without its name.
        folder: working folder.
        environment: variables beside those that every run has.
        program: which one.
        given: what its standard input holds; with nothing, it is empty.
        given_for_s: how long its standard input stays open after that, seconds.
        console: what its standard output is connected to: whoever reads it, nobody any more, or a device without room.
        encoding: of its console; "" leaves it as it is.
        folder_is_gone: whether the working folder is deleted after the program was started in it.
        largest_file_bytes: no file may grow beyond this (`RLIMIT_FSIZE`), as on a full disk; None: no limit.
        without_rights: whether it runs as a user who owns nothing, where the tests run as one who may do anything.
        signal_name: of a signal that it gets, "SIGKILL" say; "" for none.
        signal_after_s: when it gets it, seconds after its start.
        signal_when: pattern of a path, relative to the working folder; the signal comes as soon as it exists, if it ever does.
    """

    arguments: tuple[str, ...]
    folder: str
    environment: dict[str, str] = field(default_factory=dict)
    program: Literal["vittf", "compute"] = "vittf"
    given: str = ""
    given_for_s: float = 0.0
    console: Literal["read", "closed", "full"] = "read"
    encoding: str = ""
    folder_is_gone: bool = False
    largest_file_bytes: int | None = None
    without_rights: bool = False
    signal_name: str = ""
    signal_after_s: float = 0.0
    signal_when: str = ""


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes:
        code: exit code; minus the number of the signal that ended it.
        hung: whether it had to be killed.
        seconds: that it took.
        stdout: what it printed.
        stderr: what it said of errors.
    """

    code: int
    hung: bool
    seconds: float
    stdout: str
    stderr: str

    def __str__(self) -> str:
        if self.hung:
            return "hang"
        return signal.Signals(-self.code).name if self.code < 0 else f"exit {self.code}"
