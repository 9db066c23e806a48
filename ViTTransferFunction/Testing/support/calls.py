"""Counting what is called."""

from __future__ import annotations

import pytest


class Calls:
    """Counts calls of a function that goes on as before."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, module: object, name: str) -> None:
        self.count = 0
        function = getattr(module, name)

        def counted(*arguments: object, **named: object) -> object:
            self.count += 1
            return function(*arguments, **named)

        monkeypatch.setattr(module, name, counted)
