"""The progress of a suite of several parts as one bar, so that the time left is that of the whole."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from psstereo.types import Progress

__all__ = ["parts_of"]

_FINE = 1000
"""Steps of the whole bar."""


def parts_of(progress: "Progress", suite: str, weights: Sequence[float]) -> "Iterator[Progress]":
    """Yield a callback for each part of a suite, in turn.

    Parameters
    ----------
    progress : callable
        Told how far the whole suite is.
    suite : str
        Its name.
    weights : sequence of float
        About how long each part takes beside the others, positive [1].

    Yields
    ------
    callable
        To be told how far its part is.
    """
    before, total = 0.0, float(sum(weights))
    for weight in weights:

        def told(_stage: str, done: int, of: int, /, start: float = before, share: float = weight) -> None:
            progress(f"suite {suite}", round(_FINE * (start + share * done / max(of, 1)) / total), _FINE)

        yield told
        before += weight
