"""The two ways in which work ends early, other than by a defect."""

import reprlib
from typing import Any


class InputError(ValueError):
    """Something the user gave cannot be used.

    The message says what was got, what was expected and what to do about it; front ends show it once, as it is.
    """


class Cancelled(Exception):
    """The user asked for running work to stop. Raised out of a progress callback; nothing half-done is kept."""


def shown(value: Any) -> str:
    """A value that the user gave as a message quotes it: the beginning, where it is long."""
    return reprlib.repr(value)
