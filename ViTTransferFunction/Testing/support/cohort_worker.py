"""What tests have the workers of a cohort load: the tiny model, and cases that kill their process or never end.

Workers are processes of their own, where nothing can be replaced from outside. Dask loads this module into each by its option
`distributed.worker.preload`, and calls `dask_setup`.
"""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from ViTTransferFunction.CommandLine.cohort import case_work
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL

KILLS_ONCE, NEVER_ENDS = "kills its worker once", "never ends"
"""Cases of these names do; a file of the name then lies in the folder of the cache."""


def dask_setup(_: Any = None) -> None:
    """Called by Dask in each worker."""
    PRETRAINED_MODELS["tiny"] = TINY_MODEL
    usual = case_work.segment_classes

    def segment_classes(session: Any, *args: Any, **named: Any) -> Any:
        """As usual, but two cases come no further than to their features."""
        mark = Path(os.environ["VITTF_CACHE"]) / session.volume.name
        if session.volume.name in (KILLS_ONCE, NEVER_ENDS) and not mark.exists():
            session.load_features()
            mark.touch()
            if session.volume.name == NEVER_ENDS:
                time.sleep(1000.0)
            os.kill(os.getpid(), signal.SIGKILL)
        return usual(session, *args, **named)

    case_work.segment_classes = segment_classes
