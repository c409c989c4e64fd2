"""Arrays as pictures inside a page."""

import base64

import numpy as np

from psstereo.types import Array, FloatArray

__all__ = ["as_uri", "coloured", "contact_sheet", "gray", "normal_colours", "shrunk"]


def as_uri(picture: Array) -> str:
    """Return a picture as the address of itself.

    Parameters
    ----------
    picture : uint8 array (h, w), (h, w, 3) or (h, w, 4)
        Gray, or red, green, blue, and opacity.

    Returns
    -------
    str
        ``data:image/png;base64,…``
    """
    import cv2

    shown = np.ascontiguousarray(picture)
    if shown.ndim == 3:
        shown = np.ascontiguousarray(shown[..., [2, 1, 0, 3][: shown.shape[2]]])
    _, data = cv2.imencode(".png", shown, [cv2.IMWRITE_PNG_COMPRESSION, 4])
    return "data:image/png;base64," + base64.b64encode(data.tobytes()).decode("ascii")


def shrunk(array: FloatArray, side: int) -> FloatArray:
    """Return every n-th pixel of an array (h, w, …), so that its longer side is at most `side`."""
    step = max(1, -(-max(array.shape[:2]) // side))
    return array[::step, ::step]


def gray(values: FloatArray, *, share: float = 0.995) -> Array:
    """Return values from 0 on as 8-bit gray with the sRGB curve, uint8 (h, w[, 3]); black where unknown."""
    known = values[np.isfinite(values)]
    top = float(np.quantile(known, share)) if known.size else 1.0
    v = np.clip(np.nan_to_num(values) / (top if top > 0 else 1.0), 0.0, 1.0)
    return np.asarray(np.rint(255 * np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)), np.uint8)


def normal_colours(normals: FloatArray) -> Array:
    """Return normals as the usual colours, and opaque where there is one, uint8 (h, w, 4)."""
    known = np.asarray(np.isfinite(normals).all(axis=-1))
    colours = np.rint(255 * (np.where(known[..., None], normals, 0.0) + 1) / 2).astype(np.uint8)
    return np.concatenate([colours, np.where(known, 255, 0)[..., None].astype(np.uint8)], axis=-1)


def coloured(values: FloatArray, *, low: float | None = None, high: float | None = None) -> tuple[Array, float, float]:
    """Return values in the colours of viridis, transparent where unknown, and the limits of the scale.

    Parameters
    ----------
    values : float array (h, w)
        Values, NaN where unknown.
    low, high : float, optional
        Limits; the half percents at either end lie outside if absent.

    Returns
    -------
    uint8 array (h, w, 4)
        The picture.
    low, high : float
        What the darkest and the brightest colour mean.
    """
    import cv2

    known = np.isfinite(values)
    ends = np.quantile(values[known], [0.005, 0.995]) if known.any() else np.array([0.0, 1.0])
    bottom, top = float(ends[0]) if low is None else low, float(ends[1]) if high is None else high
    span = top - bottom if top > bottom else 1.0
    level = np.rint(255 * np.clip((np.where(known, values, bottom) - bottom) / span, 0.0, 1.0)).astype(np.uint8)
    colours = cv2.applyColorMap(level, cv2.COLORMAP_VIRIDIS)[..., ::-1]
    return np.concatenate([colours, np.where(known, 255, 0)[..., None].astype(np.uint8)], axis=-1), bottom, top


def contact_sheet(images: FloatArray, *, columns: int = 12) -> Array:
    """Return small images side by side, all on one scale, uint8 (h, w).

    Parameters
    ----------
    images : float array (m, h, w)
        Brightness, NaN where unknown.
    columns : int
        Images in a row.

    Returns
    -------
    uint8 array (rows · (h + 2), columns · (w + 2))
        The sheet, row after row.
    """
    count, height, width = images.shape
    columns = min(columns, count)
    rows = -(-count // columns)
    shown = gray(images)
    sheet = np.full((rows * (height + 2), columns * (width + 2)), 40, np.uint8)
    for index, one in enumerate(shown):
        row, column = divmod(index, columns)
        top, left = row * (height + 2), column * (width + 2)
        sheet[top : top + height, left : left + width] = one
    return sheet
