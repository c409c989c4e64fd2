"""A mask from the images themselves, for objects before a dark background."""

import numpy as np

from psstereo.errors import InputError
from psstereo.stack import ImageStack
from psstereo.stack.reductions import Brightest, feed_all
from psstereo.types import BoolArray, Map, Progress, no_progress

__all__ = ["mask_from_brightness"]

_SPECK = 0.01
"""Share of the largest piece below which a piece counts as a speck of the background."""


def mask_from_brightness(stack: ImageStack, *, over: Map = map, progress: Progress = no_progress) -> BoolArray:
    """Separate an object from a dark background by the brightest value that each pixel ever shows.

    The threshold is Otsu's [1]_ on the logarithm, since a background differs from an object by a factor rather than by
    a difference. Specks are dropped and holes filled. Not for objects that fill the frame: part of the object would be
    taken for background. Every image is decoded once for this.

    Parameters
    ----------
    stack : ImageStack
        The images.
    over : map-like
        Executes the images.
    progress : callable
        Told how far it is.

    Returns
    -------
    bool array (h, w)
        True on the object.

    Raises
    ------
    InputError
        If all pixels are equally bright.

    References
    ----------
    .. [1] N. Otsu, "A threshold selection method from gray-level histograms", IEEE Trans. SMC 9(1), 1979.
       doi:10.1109/TSMC.1979.4310076
    """
    from scipy import ndimage
    from skimage.filters import threshold_otsu

    brightest = feed_all(stack, Brightest(), over=over, progress=progress).astype(np.float64)
    top = float(brightest.max(where=np.isfinite(brightest), initial=0.0))
    brightest = np.nan_to_num(brightest, nan=0.0, posinf=top, neginf=0.0)
    floor = stack.white / 255 if stack.dtype.kind == "u" else top * 1e-3
    level = np.log(np.maximum(brightest, floor)) if floor > 0 else np.zeros_like(brightest)
    if level.min() == level.max():
        raise InputError(
            given="Every pixel is equally bright at its brightest.",
            needed="A mask can be found only where the object is brighter than the background.",
            remedy="Give a mask image with --mask FILE, or use every pixel with --mask none.",
        )
    threshold = threshold_otsu(level)  # type: ignore[no-untyped-call] # skimage ships no types
    pieces, count = ndimage.label(level > threshold)
    sizes = np.bincount(pieces.ravel(), minlength=count + 1)
    sizes[0] = 0
    kept = np.asarray(sizes >= _SPECK * sizes.max())
    kept[0] = False
    return np.asarray(ndimage.binary_fill_holes(kept[pieces]), np.bool_)
