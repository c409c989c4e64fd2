"""A surface whose heights and normals are known exactly."""

from dataclasses import dataclass

from psstereo.types import BoolArray, FloatArray

__all__ = ["Surface"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """A height field over pixels, seen along z.

    Attributes
    ----------
    height : float64 array (h, w)
        Height toward the camera [px].
    normals : float64 array (h, w, 3)
        Unit normals, analytic rather than differenced [1].
    mask : bool array (h, w)
        Where the surface is.
    """

    height: FloatArray
    normals: FloatArray
    mask: BoolArray
