"""Where the sun stands: directions from azimuth and elevation, and its path over a day.

All directions are in the frame x east, y north, z up, which is that of a camera that looks straight down with north at
the top of the image.
"""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import in_range
from psstereo.types import FloatArray

__all__ = ["from_azimuth", "solar_declination", "sun_path"]

_COSINES = (0.006918, -0.399912, -0.006758, -0.002697)
_SINES = (0.0, 0.070257, 0.000907, 0.00148)
"""Coefficients of Spencer's series for the declination, by multiples of the angle of the year [rad]."""


def solar_declination(day_of_year: npt.ArrayLike) -> FloatArray:
    """Angle of the sun over the plane of the equator, by Spencer's Fourier series [1]_.

    Within 0.01 rad of the true one at noon of any day from 1990 to 2035, most of the difference at the equinoxes, when
    it changes by 0.007 rad a day: the calendar drifts against the sun by a quarter of a day a year until a leap year
    puts it back. Where more is needed, take an ephemeris.

    Parameters
    ----------
    day_of_year : float or float array (...)
        1 for the first of January … 366; fractions are allowed, up to but not including 367 [day].

    Returns
    -------
    float64 array (...)
        Declination, positive in the northern summer [rad].

    Raises
    ------
    InputError
        If a day lies outside 1 … 367.

    References
    ----------
    .. [1] J. W. Spencer, "Fourier series representation of the position of the sun", Search 2 (5), 172, 1971

    Examples
    --------
    >>> print(f"{np.degrees(solar_declination(172)):.2f}")  # 21 June
    23.45
    """
    day = in_range("day of the year", day_of_year, unit="day", low=1.0, high=np.nextafter(367.0, 0.0))
    angle = 2.0 * np.pi * (day - 1.0) / 365.0
    terms = zip(range(4), _COSINES, _SINES, strict=True)
    return np.asarray(sum(a * np.cos(k * angle) + b * np.sin(k * angle) for k, a, b in terms))


def sun_path(latitude: float, day_of_year: float, hours: npt.ArrayLike) -> FloatArray:
    """Directions toward the sun at hours of a day.

    The hours are apparent solar time: at 12 the sun stands due south (north of the tropics) and highest. A clock
    differs from it by the longitude within its zone, summer time, and up to 16 min over the year. The declination is
    kept for the day; refraction, which lifts the sun by half a degree at the horizon, is left out.

    Parameters
    ----------
    latitude : float
        Positive north of the equator, −π/2 … π/2 [rad].
    day_of_year : float
        1 for the first of January [day].
    hours : float array (m,)
        Apparent solar time, 0 … 24 [h].

    Returns
    -------
    float64 array (m, 3)
        Unit vectors, x east, y north, z up. Hours of the night are kept, with z < 0: leave them out before making
        lights of them [1].

    Raises
    ------
    InputError
        If a value lies outside its range.

    Examples
    --------
    >>> midsummer = sun_path(np.radians(50.0), 172.0, [6.0, 9.0])
    >>> print(midsummer.round(2))
    [[ 0.92  0.26  0.3 ]
     [ 0.65 -0.24  0.72]]
    """
    p = in_range("latitude", latitude, unit="rad", low=-0.5 * np.pi, high=0.5 * np.pi)
    hour = np.atleast_1d(in_range("hours", hours, unit="h", high=24.0))
    c = solar_declination(day_of_year)
    turn = (hour - 12.0) * (np.pi / 12.0)
    east = -np.cos(c) * np.sin(turn)
    north = np.sin(c) * np.cos(p) - np.cos(c) * np.sin(p) * np.cos(turn)
    up = np.sin(c) * np.sin(p) + np.cos(c) * np.cos(p) * np.cos(turn)
    return np.stack([east, north, up], axis=-1)


def from_azimuth(azimuth_clockwise_from_north: npt.ArrayLike, elevation: npt.ArrayLike) -> FloatArray:
    """Direction from azimuth and elevation, as compasses and sun tables give them.

    Not for azimuths counted from the south or anti-clockwise from the east, which other tables use.

    Parameters
    ----------
    azimuth_clockwise_from_north : float or float array (...)
        0 north, π/2 east, any number of turns [rad].
    elevation : float or float array (...)
        Angle above the horizon, −π/2 … π/2 [rad].

    Returns
    -------
    float64 array (..., 3)
        Unit vectors of the broadcast shape, x east, y north, z up [1].

    Raises
    ------
    InputError
        If an elevation lies outside its range, or a single value is not finite.

    Examples
    --------
    >>> print(from_azimuth(np.pi / 2, np.pi / 6).round(3))
    [0.866 0.    0.5  ]
    """
    azimuth = in_range("azimuth", azimuth_clockwise_from_north, unit="rad", low=-np.inf)
    height = in_range("elevation", elevation, unit="rad", low=-0.5 * np.pi, high=0.5 * np.pi)
    azimuth, height = np.broadcast_arrays(azimuth, height)
    level = np.cos(height)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(height)], axis=-1)
