"""Runs of the program in children of a process that has everything loaded."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any

from ViTTransferFunction.Testing.attack.calls import Call, Outcome

ROOT = Path(__file__).parents[3]


class ForkedCalls:
    """Starts `fork_server`; to be used in a `with` statement.

    Attributes:
        weights: file of the tiny network.
    """

    def __init__(self) -> None:
        # One thread each: a child has no threads of its parent's.
        single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "ITK_GLOBAL_DEFAULT_NUMBER_OF_THREADS"), "1")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "ViTTransferFunction.Testing.attack.fork_server"],
            cwd=ROOT,
            env={**os.environ, **single},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            encoding="utf-8",
        )
        self.weights = Path(self._reply()["weights"])

    def __enter__(self) -> ForkedCalls:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()

    def run(self, calls: Sequence[Call]) -> list[Outcome]:
        """Run all at the same time, and wait for them."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps([asdict(call) for call in calls]) + "\n")
        self._process.stdin.flush()
        return [Outcome(**outcome) for outcome in self._reply()]

    def _reply(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("the process that cases are forked from has ended")
        return json.loads(line)
