"""Light on its way through haze, smoke or water."""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import in_range
from psstereo.types import FloatArray

__all__ = ["transmittance"]


def transmittance(distance: npt.ArrayLike, extinction: npt.ArrayLike) -> FloatArray:
    """Share of the radiance that is left after a way through a homogeneous medium, exp(−σ d) (Beer and Lambert).

    Not where the light that is scattered *into* the ray counts, as in fog, nor for media that vary along the way. The
    extinction of a colour channel is that of its band only while σ d is small or σ is even over the band.

    Parameters
    ----------
    distance : float or float array (...)
        Length d of the way, ≥ 0; infinity is allowed, as for a sun [m].
    extinction : float or float array (...)
        Extinction coefficient σ, absorption and scattering together, ≥ 0 [m⁻¹].

    Returns
    -------
    float64 array (...)
        Transmittance of the broadcast shape, 0 … 1; 1 where the extinction is 0, however long the way [1].

    Raises
    ------
    InputError
        If a value is negative, or a single one not a number.

    Examples
    --------
    >>> print(f"{transmittance(10.0, 0.1):.12f}")
    0.367879441171
    """
    way = np.asarray(distance, np.float64)
    if not np.isposinf(way).all():
        in_range("distance", way, unit="m")
    sigma = in_range("extinction", extinction, unit="m⁻¹")
    with np.errstate(invalid="ignore", over="ignore", under="ignore"):
        depth = np.where((sigma == 0.0) & ~np.isnan(way), 0.0, sigma * way)
        return np.asarray(np.exp(-depth))
