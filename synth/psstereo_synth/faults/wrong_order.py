"""Lights that are written down in another order than that of the images."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from psstereo.errors import InputError
from psstereo.lights import Rig
from psstereo.types import IntArray
from psstereo_synth.faults.checks import require
from psstereo_synth.faults.fault import Draws, Fault

__all__ = ["WrongOrder"]


@dataclass(frozen=True, kw_only=True)
class WrongOrder(Fault):
    """Rows of the light file are mixed up; the images stay as they are.

    Lights that are alike do not notice; test a solver with lights that differ.

    Attributes
    ----------
    kind : str
        ``"swap"`` exchanges two rows, ``"cycle"`` moves all rows on, ``"shuffle"`` puts them in any other order.
    rows : (int, int), optional
        The two rows of a swap, counted from 0; drawn if absent.
    by : int, optional
        How many rows a cycle moves on: written row i holds light i − by. 1 if absent.

    Raises
    ------
    OptionError
        If the kind is unknown, or an option does not go with it or changes nothing.
    """

    name: ClassVar[str] = "wrong-order"
    summary: ClassVar[str] = "The rows of the light file are in another order than the images."
    kind: Literal["swap", "cycle", "shuffle"] = "swap"
    rows: tuple[int, int] | None = None
    by: int | None = None

    def __post_init__(self) -> None:
        require(self.kind in ("swap", "cycle", "shuffle"), "kind", repr(self.kind), "swap, cycle or shuffle")
        if self.rows is not None:
            require(self.kind == "swap", "kind", repr(self.kind), "swap if two rows are given")
            fine = len(self.rows) == 2 and min(self.rows) >= 0 and self.rows[0] != self.rows[1]
            require(fine, "pair of rows", self.rows, "two different indices of zero or more")
        if self.by is not None:
            require(self.kind == "cycle", "kind", repr(self.kind), "cycle if it moves on by a number of rows")
            require(self.by != 0, "number of rows to move on", self.by, "other than 0")

    def permutation(self, count: int, draws: Draws) -> IntArray:
        """Return which light each written row holds.

        Parameters
        ----------
        count : int
            Number of lights.
        draws : Draws
            Random numbers.

        Returns
        -------
        int array (count,)
            Indices of lights.

        Raises
        ------
        InputError
            If there are too few lights for it, or the cycle is a whole turn.
        """
        order = np.arange(count)
        by = 1 if self.by is None else self.by
        if (
            count < 2
            or (self.rows is not None and max(self.rows) >= count)
            or (self.kind == "cycle" and not by % count)
        ):
            raise InputError(
                given=f"There {'is 1 light' if count == 1 else f'are {count} lights'} to put in a wrong order: {self}.",
                needed="At least two, those that are named, and another order than the right one.",
                remedy="Name other rows or another number of rows, or leave this fault out.",
            )
        if self.kind == "cycle":
            return np.roll(order, by)
        rng = draws.capture()
        if self.kind == "swap":
            first, second = rng.choice(count, 2, replace=False) if self.rows is None else self.rows
            order[[first, second]] = second, first
            return order
        shuffled = rng.permutation(count)
        while (shuffled == order).all():
            shuffled = rng.permutation(count)
        return shuffled

    def rig(self, rig: Rig, draws: Draws) -> Rig:
        """Return the lights in their wrong order; see :meth:`Fault.rig`."""
        return rig.select(self.permutation(len(rig), draws))
