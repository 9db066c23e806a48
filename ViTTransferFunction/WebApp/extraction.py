"""The button that computes features: before anything is downloaded for them, the user is told what it is, and asked."""

from __future__ import annotations

from collections.abc import Callable

from ..Logic.scene.feature_wording import download_question
from ..Logic.scene.session import SceneSession
from ..Logic.session.feature_estimate import WeightsDownload


class ExtractionButton:
    """Pressed, it starts the extraction as soon as it is known whether something has to be downloaded, and the user agrees.

    Args:
        session: the session as it is now.
    """

    def __init__(self, session: Callable[[], SceneSession]) -> None:
        self._session = session
        self._pressed = False
        self._asked: WeightsDownload | None = None
        self._agreed: set[WeightsDownload] = set()

    @property
    def pressed(self) -> bool:
        """Whether the extraction is to start, and has not yet."""
        return self._pressed

    @property
    def question(self) -> str:
        """What the user is to be asked, or ""."""
        return download_question(self._asked) if self._asked else ""

    def press(self) -> None:
        """The user wants the features."""
        session = self._session()
        self._pressed = True
        if session.estimate is None and not session.busy:
            session.estimate_again()

    def give_up(self) -> None:
        """The user does not want them any more."""
        self._pressed, self._asked = False, None

    def answer(self, agreed: bool) -> None:
        """The user answered the question."""
        if agreed and self._asked is not None:
            self._agreed.add(self._asked)
        else:
            self._pressed = False
        self._asked = None

    def go_on(self) -> None:
        """Start, ask, or let go, as far as that can be told now; to be called whenever the session has changed."""
        session = self._session()
        if not self._pressed or self._asked is not None:
            return
        estimate = session.estimate if session.phase == "no features" else None
        if estimate is None:
            self._pressed = session.busy and session.phase == "no features"
        elif estimate.download is None or estimate.download in self._agreed:
            self._pressed = False
            session.start_extraction()
        else:
            self._asked = estimate.download
