"""A session of the Slicer module in an event loop like Slicer's, whose every call is timed, as the window would feel it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.event_loop import CLICK_POLL_S, POLL_S, idle_with_the_lock
from ViTTransferFunction.Testing.support.scenes import add_parameter_node, add_volume


class Watched:
    """A session, and the longest that it kept its caller waiting.

    Args:
        session: which one.

    Attributes:
        longest_ms: of all calls since this was set to 0.
    """

    def __init__(self, session: SceneSession) -> None:
        self.session = session
        self.longest_ms = 0.0

    def call(self, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        """Call the session, and note how long it took."""
        began = time.perf_counter()
        result = function(*arguments, **named)
        self.longest_ms = max(self.longest_ms, 1e3 * (time.perf_counter() - began))
        return result

    def until(self, finished: Callable[[], bool]) -> float:
        """Poll until `finished`; the seconds that took."""
        began = time.perf_counter()
        while True:
            self.call(self.session.poll)
            if finished():
                return time.perf_counter() - began
            idle_with_the_lock(CLICK_POLL_S if self.session.awaits_maps else POLL_S)


def open_session(app: Any, volume: Volume, **parameters: Any) -> Watched:
    """A session on `volume`."""
    node = add_volume(app.scene, volume)
    watched = Watched(SceneSession(app.scene, app.app_logic, add_parameter_node(app.scene)))
    for name, value in parameters.items():
        watched.session.parameters.set(name, value)
    watched.call(watched.session.set_volume, node)
    return watched
