"""Samples of the image at several sizes."""

from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera
from psstereo.near.view import View
from psstereo.normals.memory import BLOCK
from psstereo.stack import MemoryStore, PixelSet, SampleStore
from psstereo.types import BoolArray, FloatArray

__all__ = ["Level", "coarse_level", "fine_level"]


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
