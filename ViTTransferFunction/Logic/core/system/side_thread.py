"""A thread beside the caller's own, for as long as the caller has use for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

Finish = Callable[[], None]
"""Waits until work is done, and raises what it raised; called again, it does nothing."""


@contextmanager
def side_thread() -> Iterator[Callable[[Callable[[], object]], Finish]]:
    """Gives a function that begins work in another thread: one after the other, in order.

    At the end, what has begun is waited for, so that nobody computes for a caller that gave up; what has not is dropped.
    """
    with_one_thread = ThreadPoolExecutor(1)
    try:
        yield lambda work: _finish(with_one_thread.submit(work))
    finally:
        with_one_thread.shutdown(cancel_futures=True)


def _finish(future: Future[object]) -> Finish:
    # Let go of when it raises: an error leads to all that its raisers held, and what they held must not lead back to it, or the
    # memory stays until Python looks for such circles.
    left = [future]

    def finish() -> None:
        if left:
            left.pop().result()

    return finish
