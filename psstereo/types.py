"""Array types and the letters of their axes.

Axis letters are the same everywhere: ``m`` lights (and so images), ``h w`` image rows and columns, ``p`` pixels under
the mask in row-major order, ``c`` channels. Shapes stand in the docstrings; interfaces check them on entry.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

__all__ = ["Array", "BoolArray", "FlagArray", "FloatArray", "IntArray", "Map", "Progress", "no_progress"]

Array: TypeAlias = npt.NDArray[Any]
"""Any array; its docstring says more."""
FloatArray: TypeAlias = npt.NDArray[np.floating[Any]]
"""float32 or float64; functions keep the precision that they are given."""
IntArray: TypeAlias = npt.NDArray[np.integer[Any]]
"""Any integer array, mostly pixel indices."""
BoolArray: TypeAlias = npt.NDArray[np.bool_]
"""Masks."""
FlagArray: TypeAlias = npt.NDArray[np.uint16]
"""Flag bits of :mod:`psstereo.flags`."""

_A = TypeVar("_A")
_B = TypeVar("_B")


class Map(Protocol):
    """How independent pieces of work are executed: anything with the signature of the builtin ``map``."""

    def __call__(self, function: Callable[[_A], _B], items: Iterable[_A], /) -> Iterator[_B]:
        """Apply ``function`` to every item, results in the order of the items."""
        ...


class Progress(Protocol):
    """Callback told how far a piece of work has come."""

    def __call__(self, stage: str, done: int, total: int, /) -> None:
        """Report that ``done`` of ``total`` steps of ``stage`` are finished."""
        ...


def no_progress(_stage: str, _done: int, _total: int, /) -> None:
    """Take progress reports and do nothing with them."""
