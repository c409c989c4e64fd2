"""The check that lights with an extent make on motions."""

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["rigid_motion"]

_TOLERANCE = 1e-6
"""How far R Rᵀ may be from the identity: matrices from text files hold seven digits or more [1]."""


def rigid_motion(rotation: npt.ArrayLike, translation: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return R and t in float64, or refuse what would change a light's size or turn its lit side over.

    Parameters
    ----------
    rotation : float array (3, 3)
        R, a proper rotation [1].
    translation : float array (3,)
        t [length].

    Returns
    -------
    tuple of float64 arrays (3, 3) and (3,)
        R [1] and t [length].

    Raises
    ------
    InputError
        If R is no proper rotation (to 1e-6), or t is not three finite numbers.
    """
    r, t = np.asarray(rotation, np.float64), np.asarray(translation, np.float64)
    fits = r.shape == (3, 3) and t.shape == (3,) and bool(np.isfinite(r).all() and np.isfinite(t).all())
    if not (fits and np.abs(r @ r.T - np.eye(3)).max() <= _TOLERANCE and np.linalg.det(r) > 0.0):
        raise InputError(
            given=f"A light is to be moved by R = {r.tolist()}, t = {t.tolist()}.",
            needed="R must be a rotation, without mirroring or scaling, and t three finite numbers.",
            remedy="Mirror or scale the scene's points before the lights are made.",
        )
    return r, t
