"""What tests have the workers of a cohort load: the tiny model, and cases that end their process or fail.

Workers are processes of their own, where nothing can be replaced from outside. Dask loads this module into each by its option
`distributed.worker.preload`; other processes that load it change as well.
"""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

from ViTTransferFunction.CommandLine.cohort import case_work
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL

KILLS_ONCE = "kills its worker once"
"""A case of this name does."""


def dask_setup(_: Any) -> None:
    """Called by Dask in each worker."""
    PRETRAINED_MODELS["tiny"] = TINY_MODEL
    usual = case_work.segment_classes

    def segment_classes(session: Any, *args: Any, **named: Any) -> Any:
        """As usual, but in the middle of its work, with features computed, the worker of one case is killed."""
        mark = Path(os.environ["VITTF_CACHE"]) / "killed"
        if session.volume.name == KILLS_ONCE and not mark.exists():
            session.load_features()
            mark.write_text(str(os.getpid()))
            os.kill(os.getpid(), signal.SIGKILL)
        return usual(session, *args, **named)

    case_work.segment_classes = segment_classes
