"""What the variational method takes for granted, in sentences."""

import numpy as np

from psstereo.sfs.assumption import Assumption, Basis
from psstereo.sfs.variational_grid import Grid

__all__ = ["assumptions"]

_RELIEF = {
    "flat": "Where a bump and a hollow look the same, it began flat and took what was nearer.",
    "convex": "It began as a dome toward the camera, so bumps win where a hollow looks the same.",
    "concave": "It began as a bowl away from the camera, so hollows win where a bump looks the same.",
}
_SHADOWS = {
    "attached": "Dark pixels were taken to face away from the light; no part throws a shadow on another.",
    "unknown": "Dark pixels were taken to say nothing, since a shadow may come from elsewhere.",
}


def assumptions(relief: str, shadows: str, grid: Grid, *, untied: int) -> tuple[Assumption, ...]:
    """Return what was assumed.

    Parameters
    ----------
    relief, shadows : str
        Options of the method.
    grid : Grid
        The problem.
    untied : int
        Pieces of the mask without known height or prior.

    Returns
    -------
    tuple of Assumption
        Boundary, relief, shadows, smoothness.
    """
    known = int(np.count_nonzero(grid.inside & ~grid.free))
    roughly = int(np.count_nonzero(grid.prior_weight)) if grid.prior_weight.size else 0
    told = [f"{known} heights were held exactly"] if known else []
    told += [f"{roughly} roughly"] if roughly else []
    heights = f"{' and '.join(told)}." if told else "No height is known, so the border is free."
    loose = f" {untied} piece{'s' if untied > 1 else ''} of the mask had to be placed by mean height." if untied else ""
    basis = Basis.GIVEN if told else Basis.ASSUMED
    return (
        Assumption(name="boundary", basis=basis, sentence=heights[0].upper() + heights[1:] + loose),
        Assumption(name="relief", basis=Basis.ASSUMED, sentence=_RELIEF[relief]),
        Assumption(name="shadows", basis=Basis.ASSUMED, sentence=_SHADOWS[shadows]),
        Assumption(
            name="smoothness",
            basis=Basis.ASSUMED,
            sentence="Among surfaces that fit the image about as well, the one that bends least was taken.",
        ),
    )
