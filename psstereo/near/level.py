"""Samples of the image at several sizes."""

from dataclasses import dataclass, replace

import numpy as np

from psstereo.camera import Camera
from psstereo.near.view import View
from psstereo.normals.memory import BLOCK
from psstereo.stack import MemoryStore, PixelSet, SampleStore
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Level", "coarse_level", "coarse_values", "fine_level", "image_factors", "refined", "sampled_level"]

_COARSEST = 2500
"""Pixels of the image on which the distance is looked for."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Level:
    """Samples and lines of sight at one size of the image.

    Attributes
    ----------
    view : View
        Lines of sight.
    factor : int
        Side of its pixels in pixels of the full image [px].
    store : SampleStore
        Samples (k, m, p); their mean over k is the gray value.
    tile : int
        Pixels a read.
    level : float64 array (p,)
        Mean brightness of each pixel's usable samples, above zero.
    """

    view: View
    factor: int
    store: SampleStore
    tile: int
    level: FloatArray

    def __len__(self) -> int:
        return self.store.shape[2]


def fine_level(store: SampleStore, camera: Camera, mask: BoolArray, tile: int) -> Level:
    """Return the full image as a level.

    Parameters
    ----------
    store : SampleStore
        Samples (k, m, p) of the pixels under the mask.
    camera : Camera
        The camera.
    mask : bool array (h, w)
        The mask.
    tile : int
        Pixels a read.
    """
    return Level(view=View.of(camera, mask), factor=1, store=store, tile=tile, level=_brightness(store, tile))


def coarse_level(fine: Level, pixels: PixelSet, camera: Camera, factor: int) -> Level:
    """Average squares of pixels.

    A coarse pixel is in the mask if half of its square is, and its sample is usable if half of those are.

    Parameters
    ----------
    fine : Level
        The full image.
    pixels : PixelSet
        Its pixels.
    camera : Camera
        Its camera.
    factor : int
        Side of the squares [px].
    """
    height, width = (-(-n // factor) for n in pixels.shape)
    rows, columns = np.divmod(pixels.indices, pixels.shape[1])
    where = rows // factor * width + columns // factor
    count = np.bincount(where, minlength=height * width)
    mask = (count * 2 >= factor * factor).reshape(height, width)
    if not mask.any():
        mask = (count == count.max()).reshape(height, width)
    inside = np.flatnonzero(mask)
    _, m, total = fine.store.shape
    sums, usable = np.zeros((m, len(inside))), np.zeros((m, len(inside)))
    for start in range(0, total, fine.tile):
        stop = min(start + fine.tile, total)
        gray = fine.store.read(start, stop).mean(axis=0, dtype=np.float64)
        for first in range(start, stop, BLOCK):  # blocks of a fixed size: the same sums whatever the tile
            last = min(first + BLOCK, stop)
            for i, row in enumerate(gray[:, first - start : last - start]):
                good = np.isfinite(row)
                here = where[first:last][good]
                sums[i] += np.bincount(here, row[good], height * width)[inside]
                usable[i] += np.bincount(here, minlength=height * width)[inside]
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.where(usable * 2 >= count[inside], sums / usable, np.nan)
    store = MemoryStore((1, m, len(inside)), np.dtype(np.float64))
    for i in range(m):
        store.write(i, means[i])
    tile = -(-len(inside) // BLOCK) * BLOCK
    return Level(
        view=View.of(camera, mask, factor), factor=factor, store=store, tile=tile, level=_brightness(store, tile)
    )


def sampled_level(level: Level, count: int) -> tuple[Level, IntArray]:
    """Return some pixels of a level, at equal distances in their order; they form no image.

    Parameters
    ----------
    level : Level
        Any.
    count : int
        Pixels at most.

    Returns
    -------
    Level
        With their samples in memory.
    int array (k,)
        Which they are.
    """
    total = len(level)
    chosen = np.unique(np.linspace(0, total - 1, min(count, total)).astype(np.intp))
    gray = np.zeros((level.store.shape[1], len(chosen)))
    for start in range(0, total, level.tile):
        inside = np.flatnonzero((chosen >= start) & (chosen < start + level.tile))
        if len(inside):
            samples = level.store.read(start, min(start + level.tile, total))
            gray[:, inside] = samples[:, :, chosen[inside] - start].mean(axis=0, dtype=np.float64)
    store = MemoryStore((1, *gray.shape), np.dtype(np.float64))
    for i, row in enumerate(gray):
        store.write(i, row)
    view = replace(level.view, rays=level.view.rays[chosen], origins=level.view.origins[chosen])
    tile = -(-len(chosen) // BLOCK) * BLOCK
    return Level(view=view, factor=level.factor, store=store, tile=tile, level=level.level[chosen]), chosen


def coarse_values(values: FloatArray, pixels: PixelSet, coarse: Level) -> FloatArray:
    """Return the means of a full image's values over the pixels of a coarse one.

    Parameters
    ----------
    values : float64 array (p,)
        Of the full image's pixels.
    pixels : PixelSet
        These.
    coarse : Level
        From :func:`coarse_level`.

    Returns
    -------
    float64 array (k,)
        Of the coarse pixels.
    """
    height, width = coarse.view.mask.shape
    rows, columns = np.divmod(pixels.indices, pixels.shape[1])
    where = rows // coarse.factor * width + columns // coarse.factor
    sums, count = np.bincount(where, values, height * width), np.bincount(where, minlength=height * width)
    inside = np.flatnonzero(coarse.view.mask)
    return np.asarray(sums[inside] / count[inside])


def image_factors(pixels: int) -> list[int]:
    """Return the sides of the coarse pixels, coarsest first: a half and a quarter of the side bring as much as both."""
    coarsest = 1
    while pixels > _COARSEST * coarsest * coarsest:
        coarsest *= 2
    factors = [coarsest]
    while factors[-1] > 1:
        factors.append(max(1, factors[-1] // (2 if len(factors) == 1 else 4)))
    return factors


def refined(coarse: Level, q: FloatArray, fine: Level) -> FloatArray:
    """Return a coarse surface at the pixels of a finer image, linear between the coarse pixels' centres."""
    from scipy.ndimage import distance_transform_edt, map_coordinates

    image = coarse.view.image(q)
    nearest = distance_transform_edt(np.isnan(image), return_distances=False, return_indices=True)
    ratio = coarse.factor / fine.factor
    rows, columns = np.nonzero(fine.view.mask)
    where = [(rows + 0.5) / ratio - 0.5, (columns + 0.5) / ratio - 0.5]
    return np.asarray(map_coordinates(image[tuple(nearest)], where, order=1, mode="nearest"))


def _brightness(store: SampleStore, tile: int) -> FloatArray:
    """Return the mean of each pixel's usable brightness, a tiny number where there is none."""
    total = store.shape[2]
    out = np.zeros(total)
    for start in range(0, total, tile):
        stop = min(start + tile, total)
        values = store.read(start, stop).mean(axis=0, dtype=np.float64)
        usable = np.isfinite(values)
        out[start:stop] = np.where(usable, np.maximum(values, 0.0), 0.0).sum(axis=0) / np.maximum(usable.sum(axis=0), 1)
    return np.maximum(out, max(float(out.max()) * 1e-6, np.finfo(np.float64).tiny))
