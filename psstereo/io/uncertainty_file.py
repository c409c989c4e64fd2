"""How far normals may be off, from a map of angles."""

from pathlib import Path

import numpy as np

from psstereo.errors import InputError
from psstereo.io.value_map import read_value_map
from psstereo.types import FloatArray

__all__ = ["read_uncertainty"]


def read_uncertainty(path: Path, shape: tuple[int, int]) -> FloatArray:
    """Read the uncertainty of normals, such as the ``uncertainty.npy`` of a result.

    Parameters
    ----------
    path : Path
        Map of floats: root-mean-square angle between true and given normals [deg]. NaN where it cannot be told,
        infinite where the normal is worth nothing.
    shape : (int, int)
        Rows and columns of the normals.

    Returns
    -------
    float64 array (h, w)
        The same in radians [rad].

    Raises
    ------
    MissingFileError, UnreadableFileError
        If the file is not there or damaged.
    InputError
        If it has another size, holds whole numbers or negative ones, or knows no pixel.
    """
    found = read_value_map(path, shape, what="uncertainty map", names=("uncertainty",))
    values, negative = found.values, int(np.count_nonzero(found.values < 0))
    if values.dtype.kind != "f" or negative:
        raise InputError(
            given=f"The uncertainty map {path.name} holds {negative} negative numbers, of type {values.dtype}.",
            needed="Angles in degrees: floats, none of them negative.",
            remedy="Use the uncertainty.npy of a result, or save your own map of angles as floats.",
        )
    angles = np.radians(np.where(found.no_data, np.nan, values).astype(np.float64))
    if not np.isfinite(angles).any():
        raise InputError(
            given=f"The uncertainty map {path.name} knows no pixel.",
            needed="At least one angle.",
            remedy="Leave --weights out: all normals then count alike.",
        )
    return angles
