"""The file or folder of weights that the user named last: Slicer's settings remember it for other scenes, and for tomorrow."""

from __future__ import annotations

import slicer

from ViTTransferFunction.Logic.core.system.user_path import is_there
from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters

_KEY = "ViTTransferFunction/WeightsPath"


def remember_weights(path: str) -> None:
    """Remember the path that the user named; "": none any more."""
    slicer.app.userSettings().setValue(_KEY, path)


def name_remembered_weights(parameters: SceneParameters) -> None:
    """Name the remembered path in a scene that names none, if it is there.

    Not in a scene for which features have been computed: its structures may belong to another model, which is found without
    a path.
    """
    path = str(slicer.app.userSettings().value(_KEY) or "")
    if path and not parameters.get("weightsPath") and not parameters.get("usedModel") and is_there(path):
        parameters.set("weightsPath", path)
