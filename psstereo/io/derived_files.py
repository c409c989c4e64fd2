"""What a result folder holds beside normals and depth, if it is wanted: elevation, relief, curvature."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from psstereo.io.elevation_file import write_elevation
from psstereo.io.pictures import signed_picture, write_png
from psstereo.results import DepthResult
from psstereo.types import FloatArray

__all__ = ["Derived", "write_derived"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Derived:
    """What was derived from normals and depth.

    Attributes
    ----------
    elevation : DepthResult or None
        Becomes ``elevation.tif``, 32 bit.
    relief : float array (h, w) or None
        Heights of a band of wavelengths; ``relief.tif``, 32 bit, and ``relief.png`` [`relief_unit`].
    relief_unit : str
        Unit of the relief.
    curvature : mapping of float arrays (h, w)
        Kinds of curvature by name, ``mean`` among them; ``curvature.npz``, and the mean as ``curvature.png``.
    curvature_unit : str
        Unit of the mean curvature.
    pixel_size : float or None
        Side of a pixel on the surface, None under central projection [unit of the depth].
    """

    elevation: DepthResult | None = None
    relief: FloatArray | None = None
    relief_unit: str = "px"
    curvature: Mapping[str, FloatArray] = field(default_factory=dict)
    curvature_unit: str = "1/px"
    pixel_size: float | None = None


def write_derived(folder: Path, derived: Derived) -> None:
    """Write the files into a folder that is there.

    Parameters
    ----------
    folder : Path
        Where.
    derived : Derived
        What there is.
    """
    depth, pixel = derived.elevation, derived.pixel_size
    if depth is not None:
        write_elevation(folder / "elevation.tif", depth.depth, unit=depth.unit, kind=depth.kind, pixel_size=pixel)
    if derived.relief is not None:
        write_elevation(folder / "relief.tif", derived.relief, unit=derived.relief_unit, pixel_size=pixel)
        write_png(folder / "relief.png", signed_picture(derived.relief))
    if derived.curvature:
        arrays = {name: values.astype(np.float32) for name, values in derived.curvature.items()}
        np.savez(folder / "curvature.npz", allow_pickle=False, **arrays, unit=np.array(derived.curvature_unit))
        write_png(folder / "curvature.png", signed_picture(derived.curvature["mean"]))
