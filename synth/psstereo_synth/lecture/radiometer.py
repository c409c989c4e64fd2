"""A virtual radiometer: two round openings, and a sensor behind them."""

import numpy as np

from psstereo.radiometry import disc_etendue, field_radius, transmittance
from psstereo.radiometry.checks import in_range
from psstereo.radiometry.quadrature import disc_rule
from psstereo.types import FloatArray

__all__ = ["APERTURE", "LENGTH", "STOP", "reading"]

APERTURE, STOP, LENGTH = 1e-4, 1e-3, 1.0
"""Radii of the radiometer's inner and outer opening, and the distance between them [m]."""


def reading(level: float, radius: float, distance: float, *, extinction: float = 0.0, count: int = 64) -> float:
    """Return what the radiometer reads from a round source straight ahead, ray by ray.

    Each ray carries the étendue dA cosθ dA' cosθ' / ρ² between two openings. A source that fills the field is looked at
    along rays through the outer opening; one that does not, along rays to the source. Not for a source that the edge of
    the field cuts.

    Parameters
    ----------
    level : float
        Radiance of the source [W m⁻² sr⁻¹].
    radius : float
        Radius of the source [m].
    distance : float
        From the outer opening to the source [m].
    extinction : float
        Of the air on the whole way, the tube included [m⁻¹].
    count : int
        About how many points stand for each opening [1].

    Returns
    -------
    float
        Power over the étendue of the radiometer; NaN if the edge of the field cuts the source [W m⁻² sr⁻¹].

    Raises
    ------
    InputError
        If a number is negative or not finite, or the radius is 0.
    """
    strength = in_range("radiance", level, unit="W m⁻² sr⁻¹")
    size = float(in_range("source's radius", radius, unit="m", exclude_low=True))
    whole = LENGTH + distance
    fills = size >= field_radius(APERTURE, STOP, LENGTH, distance)
    # The ray from the aperture's edge to the source's opposite edge, where it passes the stop.
    if not fills and (APERTURE * distance + size * LENGTH) / whole > STOP:
        return float("nan")
    far, gap = (STOP, LENGTH) if fills else (size, whole)
    start, end, shares = _disc(APERTURE, count), _disc(far, count), disc_rule(count)[2]
    across = end[None] - start[:, None]
    square = (across * across).sum(axis=-1) + gap * gap
    etendue = np.pi**2 * APERTURE**2 * far**2 * np.outer(shares, shares) * gap**2 / square**2
    arriving = strength * transmittance(np.sqrt(square) * (whole / gap), extinction)
    return float((arriving * etendue).sum() / disc_etendue(APERTURE, STOP, LENGTH))


def _disc(radius: float, count: int) -> FloatArray:
    """Return points of a disc (k, 2) [m]."""
    squares, turns, _ = disc_rule(count)
    return np.asarray(radius * np.sqrt(squares)[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1))
