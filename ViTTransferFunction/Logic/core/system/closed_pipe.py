"""A pipe that nobody reads any more, in the words of each system."""

from __future__ import annotations

import errno
import sys


def is_closed_pipe(error: OSError) -> bool:
    """Whether something could not be written since the program at the other end of a pipe has gone away.

    Windows calls that an invalid argument.
    """
    return isinstance(error, BrokenPipeError) or (sys.platform == "win32" and error.errno == errno.EINVAL)
