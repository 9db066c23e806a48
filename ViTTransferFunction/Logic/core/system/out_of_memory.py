"""When memory runs out: how that is recognised, and what is said then."""

from __future__ import annotations

import errno

OUT_OF_MEMORY = (
    "There is too little memory for this. Close other programs, or crop the volume to what you need. Features need less with a "
    "faster preset or a smaller grid."
)
"""What a front end says, instead of where it happened."""

_SIGNS = (
    "out of memory",
    "not enough memory",
    "can't allocate memory",
    "cannot allocate memory",
    "failed to allocate memory",
    "alloc_failed",
    "bad_alloc",
    "bad allocation",
    "can't start new thread",
    "paging file is too small",
)
"""Only Python, NumPy and CUDA have exceptions of their own for it. Apple's devices, PyTorch on processors, SimpleITK, and the
system where it loads a library or makes room for a thread's stack, raise another that says so."""

_PAGING_FILE_TOO_SMALL = 1455
"""Windows' number of what it says in the user's language."""


def is_out_of_memory(error: BaseException) -> bool:
    """Whether the error says that memory ran out, on whatever device."""
    if isinstance(error, MemoryError):
        return True
    if isinstance(error, OSError) and error.errno == errno.ENOMEM:
        return True
    if getattr(error, "winerror", None) == _PAGING_FILE_TOO_SMALL:
        return True
    return any(sign in str(error).lower() for sign in _SIGNS)
