"""Arrays as pictures to look at; the numbers themselves go into ``.npy``."""

from pathlib import Path

import numpy as np

from psstereo.errors import InputError
from psstereo.types import Array, FloatArray

__all__ = ["albedo_picture", "depth_picture", "signed_picture", "write_png"]

_BRIGHT = 99.5
"""Percentile that is drawn white: a few highlights must not make all the rest dark."""


def write_png(path: Path, image: Array) -> None:
    """Write 8 or 16 bit gray or R, G, B as PNG, compressed lightly, since results are written often and kept briefly.

    Parameters
    ----------
    path : Path
        File to write.
    image : uint8 or uint16 array (h, w) or (h, w, 3)
        The picture.

    Raises
    ------
    InputError
        If PNG cannot hold it.
    """
    import cv2

    rows = image[..., ::-1] if image.ndim == 3 else image
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1]
    done, encoded = cv2.imencode(".png", np.ascontiguousarray(rows), options)
    if not done:
        raise InputError(
            given=f"A picture of the shape {image.shape} could not be coded as PNG.",
            needed="A picture within the limits of OpenCV's PNG writer is needed.",
            remedy="Crop the images to the object, or bin their pixels.",
        )
    path.write_bytes(encoded.tobytes())


def albedo_picture(albedo: FloatArray) -> Array:
    """Return albedo as 8-bit gray or colour with the sRGB curve, black where unknown.

    Parameters
    ----------
    albedo : float array (h, w) or (h, w, c)
        Albedo, NaN where unknown.

    Returns
    -------
    uint8 array (h, w) or (h, w, 3)
        The brightest half percent is white.
    """
    known = albedo[np.isfinite(albedo)]
    top = float(np.percentile(known, _BRIGHT)) if known.size else 1.0
    v = np.clip(np.nan_to_num(albedo) / (top if top > 0 else 1.0), 0.0, 1.0)
    curve = np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(curve * 255), np.uint8)


def depth_picture(depth: FloatArray, *, near_is_small: bool) -> Array:
    """Return depth as 16-bit gray from far, dark, to near, bright; 0 where unknown.

    Parameters
    ----------
    depth : float array (h, w)
        Depth, NaN where unknown.
    near_is_small : bool
        True for distances, False for heights.

    Returns
    -------
    uint16 array (h, w)
        1 to 65535 where known.
    """
    toward = -depth if near_is_small else depth
    known = np.isfinite(toward)
    picture = np.zeros(depth.shape, np.uint16)
    if known.any():
        low, high = float(toward[known].min()), float(toward[known].max())
        scale = (toward[known] - low) / (high - low) if high > low else np.ones(int(known.sum()))
        picture[known] = np.rint(1 + scale * 65534).astype(np.uint16)
    return picture


def signed_picture(values: FloatArray) -> Array:
    """Return values of both signs as 16-bit gray, 0 in the middle; black where unknown.

    Parameters
    ----------
    values : float array (h, w)
        Values, NaN where unknown.

    Returns
    -------
    uint16 array (h, w)
        32768 for 0; the half percent farthest from it is black or white.
    """
    known = np.isfinite(values)
    picture = np.zeros(values.shape, np.uint16)
    if known.any():
        span = float(np.quantile(np.abs(values[known]), 0.995)) or 1.0
        picture[known] = np.rint(32768 + 32767 * np.clip(values[known] / span, -1.0, 1.0)).astype(np.uint16)
    return picture
