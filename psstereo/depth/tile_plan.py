"""How large tiles and how coarse the coarse grid may be, for the memory that there is."""

import math
from dataclasses import dataclass

from psstereo.errors import OptionError

__all__ = ["TilePlan", "plan_tiles"]

_LEVELS = range(3, 8)
"""Spacings of the coarse grid that are tried, as powers of 2: finer ones gain nothing."""
_BYTES = 200
"""Memory for each pixel of a tile and its margins, at the most [B]."""
_WITH_PRIOR = 40
"""... and more of it with a prior [B]."""
_COARSE_BYTES = 150
"""Memory for each node of the coarse grid [B]."""
_COARSE_SHARE = 0.4
"""Share of the memory that the coarse grid may take [1]."""
_FIXED = 8_000_000
"""Memory whatever the size [B]."""


@dataclass(frozen=True, kw_only=True)
class TilePlan:
    """Sizes that fit into memory.

    Attributes
    ----------
    side : int
        Side of a tile [px].
    levels : int
        The coarse grid takes every pixel whose row and column are multiples of 2 to this power.
    overlap : int
        Pixels by which a tile's own solve reaches beyond the tile [px].
    memory : int
        Memory that this is planned to need [B].
    """

    side: int
    levels: int
    overlap: int
    memory: int


def plan_tiles(shape: tuple[int, int], *, max_memory: int, tile: int | None, prior: bool) -> TilePlan:
    """Choose the sizes.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the image.
    max_memory : int
        Memory to stay below [B].
    tile : int or None
        Side of a tile, if it is given [px].
    prior : bool
        Whether there is a prior.

    Returns
    -------
    TilePlan
        The finest coarse grid that fits, and the largest tiles beside it.

    Raises
    ------
    OptionError
        If an option is out of range or no plan fits.
    """
    if max_memory <= 0 or (tile is not None and tile < 1):
        raise OptionError(
            given=f"The memory is {max_memory} bytes, the side of a tile {tile}.",
            needed="Both must be positive numbers.",
            remedy="Leave the tile out, and allow some hundred megabytes.",
        )
    plans = [_plan(shape, max_memory, tile, prior, levels) for levels in _LEVELS]
    for plan in plans:
        if plan.memory <= max_memory:
            return plan
    least = min(plan.memory for plan in plans)
    raise OptionError(
        given=f"{max_memory / 1e6:.1f} MB of memory are allowed for {shape[1]} × {shape[0]} pixels"
        + (f" in tiles of {tile}." if tile is not None else "."),
        needed=f"At least {math.ceil(least / 1e6)} MB are needed.",
        remedy="Allow that much" + ("." if tile is None else ", or leave the size of the tiles out."),
    )


def _plan(shape: tuple[int, int], max_memory: int, tile: int | None, prior: bool, levels: int) -> TilePlan:
    node = 1 << levels
    overlap = 2 * node - 1
    margin = 4 * node  # as Work.margin has it
    coarse = _COARSE_BYTES * math.ceil(shape[0] / node) * math.ceil(shape[1] / node)
    each = _BYTES + (_WITH_PRIOR if prior else 0)
    # Overlaps of every other tile must not touch.
    smallest = 2 * overlap + 2
    if tile is None:
        room = max_memory - coarse - _FIXED if coarse <= _COARSE_SHARE * max_memory else 0
        side = max(int(math.sqrt(max(room, 0) / each)) - 2 * margin, smallest)
        side = min(side // node * node, math.ceil(max(shape) / node) * node)
        side = max(side, smallest)
    else:
        side = max(math.ceil(tile / node) * node, smallest)
    sides = [min(side + 2 * margin, length) for length in shape]
    return TilePlan(side=side, levels=levels, overlap=overlap, memory=_FIXED + coarse + each * sides[0] * sides[1])
