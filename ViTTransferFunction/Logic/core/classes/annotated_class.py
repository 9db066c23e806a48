"""A class as annotation files have it: what is asked about it, and how it is to be shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..volumes.thumbnail import Thumbnail
from .class_request import ClassRequest, check_share
from .colors import Color


@dataclass(frozen=True)
class AnnotatedClass:
    """A class as a file describes it.

    Attributes:
        request: points and settings; its id is the class's name.
        color: red, green, blue in [0, 1].
        opacity: of its rendering, in [0, 1].
        close_up_from_map: whether the request's close-up is still to be chosen, from the class's map.
        outline_ras: (N, 3) RAS millimetres, its outline in a slice, which its points stand for; None: they are others.
        placed_on: what the scan showed that the points were placed on; None: not known.

    Raises:
        InputError: the opacity is out of range.
    """

    request: ClassRequest
    color: Color
    opacity: float = 1.0
    close_up_from_map: bool = False
    outline_ras: np.ndarray | None = field(default=None, compare=False)
    placed_on: Thumbnail | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        check_share(self.opacity, "opacity", self.request.name)

    @property
    def name(self) -> str:
        """What the user calls the class."""
        return self.request.name


def scan_of(classes: Sequence[AnnotatedClass]) -> Thumbnail | None:
    """What the scan showed that the points of some classes were placed on, all of a file or of a scene; None: not known."""
    return next((each.placed_on for each in classes if each.placed_on is not None), None)
