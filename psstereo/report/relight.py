"""The surface as data that a page can shine a light on."""

import base64
import json
from collections.abc import Mapping

import numpy as np

from psstereo.report.pictures import shrunk
from psstereo.types import Array, FloatArray

__all__ = ["relight_data", "relit"]

_SIDE = 640
"""Longer side of the picture that is relit [px]."""
_TOP = 0.995
"""Share of the albedo that lies below white."""


def relight_data(normals: FloatArray, albedo: FloatArray) -> Mapping[str, object]:
    """Return what the page's canvas needs.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Unit normals, NaN where unknown [1].
    albedo : float array (h, w) or (h, w, c)
        Albedo, NaN where unknown.

    Returns
    -------
    mapping
        ``width`` and ``height``, and ``data``: JSON with normals of 16 bits, albedo of 16 bits, channels.
    """
    small, paint = _prepared(normals, albedo)
    channels = paint.shape[2]
    data = {"normals": _packed(small), "albedo": _packed(paint), "channels": channels}
    return {"width": small.shape[1], "height": small.shape[0], "data": json.dumps(data)}


def relit(normals: FloatArray, albedo: FloatArray, light: FloatArray) -> Array:
    """Return what the canvas shows under a light, by NumPy: uint8 (h', w', 3).

    Parameters
    ----------
    normals, albedo
        As for :func:`relight_data`.
    light : float array (3,)
        Unit vector toward it [1].
    """
    small, paint = _prepared(normals, albedo)
    facing = np.maximum(small.astype(np.float64) / 32767.0 @ np.asarray(light, np.float64), 0.0)
    v = np.minimum(paint / 65535.0 * facing[..., None], 1.0)
    shown = np.rint(255 * np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)).astype(np.uint8)
    return np.broadcast_to(shown, (*shown.shape[:2], 3))


def _prepared(normals: FloatArray, albedo: FloatArray) -> tuple[Array, Array]:
    """Return normals as int16 (h', w', 3) and albedo as uint16 (h', w', 1 or 3), 0 where unknown."""
    small = np.nan_to_num(shrunk(normals, _SIDE).astype(np.float64))
    paint = shrunk(albedo, _SIDE).astype(np.float64)
    paint = paint[..., None] if paint.ndim == 2 else paint
    paint = paint if paint.shape[2] in (1, 3) else paint.mean(axis=2, keepdims=True)
    known = paint[np.isfinite(paint)]
    top = float(np.quantile(known, _TOP)) if known.size else 1.0
    share = np.clip(np.nan_to_num(paint) / (top if top > 0 else 1.0), 0.0, 1.0)
    return np.rint(32767 * small).astype("<i2"), np.rint(65535 * share).astype("<u2")


def _packed(array: Array) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
