"""Where a surface faces the light, and which of these places a height is given to."""

from dataclasses import dataclass

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Singular", "find_singular", "label_components"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Singular:
    """Places that face the light, and what is made of them.

    Attributes
    ----------
    chosen : bool array (h, w)
        Pixels whose height is 0 by convention.
    components : int32 array (h, w)
        Connected pieces of the mask from 1, sides not corners; 0 outside.
    found : int
        Places that face the light in all components without known heights, as groups of pixels.
    without : int
        Components without such a place and without known heights, whose brightest pixel stands in.
    known : int
        Components with known heights.
    """

    chosen: BoolArray
    components: IntArray
    found: int
    without: int
    known: int


def label_components(inside: BoolArray) -> IntArray:
    """Return the connected pieces of a mask from 1, sides not corners, 0 outside, int32 (h, w)."""
    from scipy.ndimage import label

    return np.asarray(label(inside)[0], np.int32)


def find_singular(cosine: FloatArray, inside: BoolArray, given: BoolArray, *, facing: float, every: bool) -> Singular:
    """Find where a surface faces the light, and choose those that get a height by convention.

    A place is a group of touching pixels, each the brightest among its eight neighbours and brighter than
    ``1 − facing``. Where the true point lies between pixels the brightest pixel stands for it, half a pixel off at most
    along each axis.

    Parameters
    ----------
    cosine : float64 array (h, w)
        Cosine of the angle to the light as the brightness tells it, at most 1; anything outside [1].
    inside : bool array (h, w)
        The mask.
    given : bool array (h, w)
        Pixels whose height is known; components with such a pixel need no convention.
    facing : float
        How much less than 1 still counts as facing the light [1].
    every : bool
        Whether all places get the height 0, rather than the one in each component that lies deepest inside it.

    Returns
    -------
    Singular
        The places.
    """
    from scipy.ndimage import label, maximum_filter

    components = label_components(inside)
    count = int(components.max())
    known = np.zeros(count + 1, np.bool_)
    known[components[given & inside]] = True
    values = np.where(inside & ~known[components], cosine, -np.inf)
    chosen = np.zeros(inside.shape, np.bool_)
    if known[1:].all():
        return Singular(chosen=chosen, components=components, found=0, without=0, known=count)
    best = np.full(count + 1, -np.inf)
    np.maximum.at(best, components[inside], values[inside])
    level = np.minimum(1.0 - facing, best)  # the brightest pixel stands in where no place faces the light
    places = (values >= level[components]) & np.isfinite(values)
    places &= values >= maximum_filter(values, 3)
    groups, number = label(places, np.ones((3, 3)))
    without = int(np.count_nonzero((best < 1.0 - facing)[1:] & ~known[1:]))
    chosen = places if every else _deepest(groups, number, values, components, inside)
    return Singular(
        chosen=chosen, components=components, found=number, without=without, known=int(np.count_nonzero(known[1:]))
    )


def _deepest(groups: IntArray, number: int, values: FloatArray, components: IntArray, inside: BoolArray) -> BoolArray:
    """Return, for each component, one pixel of the group that keeps the greatest distance from the border."""
    from scipy.ndimage import distance_transform_cdt

    depth = distance_transform_cdt(np.pad(inside, 1), "chessboard")[1:-1, 1:-1]
    rows, columns = np.nonzero(groups)
    group = groups[rows, columns]
    least = np.full(number + 1, np.iinfo(np.int64).max)
    np.minimum.at(least, group, depth[rows, columns])
    # By component, then the deepest group, then its brightest pixel, then the first of them.
    order = np.lexsort((-values[rows, columns], group, -least[group], components[rows, columns]))
    _, first = np.unique(components[rows, columns][order], return_index=True)
    chosen = np.zeros(inside.shape, np.bool_)
    chosen[rows[order][first], columns[order][first]] = True
    return chosen
