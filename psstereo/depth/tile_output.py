"""From values in a file to depth in a file, tile by tile."""

from dataclasses import dataclass

import numpy as np

from psstereo.depth.tile_input import EdgeFiles
from psstereo.depth.tile_passes import Energy, Work, by_component
from psstereo.depth.tiles import FileArray, Tile
from psstereo.results import DepthKind
from psstereo.types import FloatArray, IntArray

__all__ = ["Output", "finish", "relabel", "totals"]


@dataclass(frozen=True, kw_only=True)
class Output:
    """Where the result goes.

    Attributes
    ----------
    depth : FileArray
        Depth, NaN everywhere.
    components : FileArray or None
        Components (int32), 0 everywhere; None if not wanted.
    kind : DepthKind
        Whether the values are heights or logarithms of distances.
    """

    depth: FileArray
    components: FileArray | None
    kind: DepthKind


def relabel(files: EdgeFiles, item: tuple[Tile, IntArray, FloatArray]) -> FloatArray:
    """Number a tile's components as the image does, and take the prior's mean over each component from the prior.

    Without its mean the prior leaves the tolerance relative to the relief, not to the distance.

    Parameters
    ----------
    files : EdgeFiles
        The equations.
    item : (Tile, int32 array (n + 1,), float64 array (n + 1,))
        The tile, and the number and the mean for each of the tile's components.

    Returns
    -------
    float64 array (n + 1,)
        Energy of what is left of the prior, of each of the tile's components.
    """
    tile, numbers, means = item
    labels = files.labels.read(tile.core)
    files.labels.write(tile.core, numbers[labels])
    if files.prior is not None and files.prior_weight is not None:
        weight = files.prior_weight.read(tile.core)
        prior, mean = files.prior.read(tile.core), means[labels]
        # A difference that is rounding is none: a piece with nothing else would be solved to ever more digits of it.
        known = (weight > 0) & (np.abs(prior - mean) > 8 * np.finfo(np.float64).eps * np.abs(mean))
        prior = np.where(known, prior - mean, 0.0)
        files.prior.write(tile.core, prior)
        energies = np.bincount(labels.ravel(), (weight * prior**2).ravel(), numbers.size)
        return energies.astype(np.float64, copy=False)
    return np.zeros(numbers.size)


def totals(work: Work, tile: Tile) -> Energy:
    """Return the sum of a tile's values over each component.

    Parameters
    ----------
    work : Work
        The equations, solved.
    tile : Tile
        The tile.

    Returns
    -------
    first : int
        Number of the first component counted.
    sums : float64 array (n',)
        Sums of it and of the following ones.
    """
    return by_component(work.files.labels.read(tile.core), work.values.read(tile.core))


def finish(work: Work, output: Output, constants: FloatArray, tile: Tile) -> tuple[int, int]:
    """Write a tile of the result.

    Parameters
    ----------
    work : Work
        The equations, solved.
    output : Output
        Where it goes.
    constants : float64 array (n + 1,)
        What is added to the values of each component; NaN for those that nothing ties down.
    tile : Tile
        The tile.

    Returns
    -------
    beyond, untied : int
        Pixels whose depth no float can hold, and those of components that nothing ties down.
    """
    labels = work.files.labels.read(tile.core)
    used = labels > 0
    values = np.where(used, work.values.read(tile.core) + constants[labels], np.nan)
    untied = int(np.count_nonzero(used & np.isnan(values)))
    with np.errstate(over="ignore", under="ignore"):
        if output.kind is DepthKind.DISTANCE:
            values = np.exp(values)
            values = np.where(values > 0, values, np.nan)
        values = values.astype(output.depth.dtype)
    values = np.where(np.isfinite(values) & ((values > 0) | (output.kind is DepthKind.HEIGHT)), values, np.nan)
    output.depth.write(tile.core, values)
    if output.components is not None:
        output.components.write(tile.core, np.where(np.isnan(values), 0, labels))
    return int(np.count_nonzero(used & np.isnan(values))) - untied, untied
