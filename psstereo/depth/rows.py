"""Passes over the rows of an image, split among threads without a trace in the result."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Any

__all__ = ["Rows"]

_SMALLEST = 100_000
"""Pixels from which a pass is split: below, handing it over costs more than it saves."""


class Rows:
    """Runs passes ``function(*arguments, first, last)`` over all rows, some at a time on each thread.

    A pass must write nothing but its rows and read nothing that another row of the same pass writes. Each row then
    comes out the same whatever the split.

    Parameters
    ----------
    threads : int
        Threads at most.
    """

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def __enter__(self) -> "Rows":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._pool is not None:
            self._pool.shutdown()

    def __call__(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], first: int, last: int, width: int
    ) -> None:
        """Run a pass over the rows `first` to `last` − 1 of `width` pixels each."""
        if self._pool is None or (last - first) * width < _SMALLEST:
            function(*arguments, first, last)
            return
        parts = min(self._threads, last - first)
        bounds = [first + (last - first) * k // parts for k in range(parts + 1)]
        waiting = [self._pool.submit(function, *arguments, bounds[k], bounds[k + 1]) for k in range(1, parts)]
        function(*arguments, bounds[0], bounds[1])
        for one in waiting:
            one.result()
