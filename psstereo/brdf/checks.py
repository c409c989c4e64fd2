"""Checks that every reflectance model makes on its parameters."""

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["reflectance"]


def reflectance(values: npt.ArrayLike, what: str) -> FloatArray:
    """Return read-only shares of reflected light in float64, with a last axis of channels.

    Parameters
    ----------
    values : scalar or array (c,) or (..., c)
        Shares of the light, one number, one a channel, or a map of them [1].
    what : str
        What they are, for the message.

    Returns
    -------
    float64 array (c,) or (..., c)
        The shares.

    Raises
    ------
    InputError
        If one lies outside 0 … 1 or is not a number.
    """
    shares = np.atleast_1d(np.array(values, np.float64))
    if shares.size == 0 or not ((shares >= 0) & (shares <= 1)).all():
        worst = "nothing" if shares.size == 0 else f"{np.nanmin(shares):.4g} to {np.nanmax(shares):.4g}"
        raise InputError(
            given=f"The {what} is {worst}{' with NaN' if np.isnan(shares).any() else ''}.",
            needed="A surface reflects a share of the light, from 0 to 1.",
            remedy="Scale it into that range; ρ in sr⁻¹ is albedo / π.",
        )
    shares.flags.writeable = False
    return shares
