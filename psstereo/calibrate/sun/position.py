"""Where the sun stands, from date, time and place, through the ephemeris of PyEphem (extra ``outdoor``).

Directions are in the frame x east, y north, z up at the place; ``sun_camera`` turns them into the camera's.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module
from types import ModuleType

import numpy as np

from psstereo.errors import InputError, UnsupportedError
from psstereo.lights.solar import from_azimuth
from psstereo.radiometry.checks import in_range
from psstereo.types import FloatArray

__all__ = ["Place", "SunPositions", "clear_sky_strength", "sun_positions"]

_YEARS = (1900, 2100)
"""Years within which the rotation of the earth is known well enough for 0.01 degree."""

_LAPSE = 0.0065
"""Fall of the temperature with height in the standard atmosphere [K m⁻¹]."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """A place on the earth.

    Attributes
    ----------
    latitude : float
        Positive north of the equator, −π/2 … π/2 [rad].
    longitude : float
        Positive east of Greenwich, −π … π [rad].
    height : float
        Above the sea, which thins the air and with it the refraction, −500 … 9000 [m].
    refraction : bool
        Whether the air bends the light, as it does: by 0.5° at the horizon, 0.09° at 10°, 0.02° at 45°.

    Raises
    ------
    InputError
        If a number lies outside its range.
    """

    latitude: float
    longitude: float
    height: float = 0.0
    refraction: bool = True

    def __post_init__(self) -> None:
        in_range("latitude", self.latitude, unit="rad", low=-0.5 * np.pi, high=0.5 * np.pi)
        in_range("longitude", self.longitude, unit="rad", low=-np.pi, high=np.pi)
        in_range("height above the sea", self.height, unit="m", low=-500.0, high=9000.0)

    @property
    def pole(self) -> FloatArray:
        """Direction of the celestial north pole, float64 (3,): the sun turns about it [1]."""
        return np.array([0.0, np.cos(self.latitude), np.sin(self.latitude)])


@dataclass(frozen=True, kw_only=True, eq=False)
class SunPositions:
    """The sun at some moments.

    Attributes
    ----------
    directions : float64 array (m, 3)
        Unit vectors toward the middle of the disc, x east, y north, z up; z < 0 at night [1].
    azimuth : float64 array (m,)
        Clockwise from north, 0 … 2π [rad].
    elevation : float64 array (m,)
        Above the horizon [rad].
    declination : float64 array (m,)
        Angle over the plane of the equator, without refraction [rad].
    distance : float64 array (m,)
        From the earth [astronomical unit].
    """

    directions: FloatArray
    azimuth: FloatArray
    elevation: FloatArray
    declination: FloatArray
    distance: FloatArray


def sun_positions(times: Sequence[datetime], place: Place) -> SunPositions:
    """Return the sun's positions at some moments.

    Within 0.01° of other ephemerides above 5° of elevation; nearer the horizon the air bends light by amounts that
    depend on the weather. Not for times without a zone, which are refused: an hour is 15°.

    Parameters
    ----------
    times : sequence of datetime (m,)
        Moments with their time zone, from 1900 to 2100.
    place : Place
        Where.

    Returns
    -------
    SunPositions
        Directions and what goes with them, in the order of the times.

    Raises
    ------
    InputError
        If there is no time, or one lies outside the years or has no zone.
    UnsupportedError
        If PyEphem is not installed.

    Examples
    --------
    >>> from datetime import timedelta, timezone
    >>> boulder = Place(latitude=np.radians(39.742476), longitude=np.radians(-105.1786), height=1830.0)
    >>> moment = datetime(2003, 10, 17, 12, 30, 30, tzinfo=timezone(timedelta(hours=-7)))
    >>> print(np.degrees(sun_positions([moment], boulder).azimuth).round(2))
    [194.34]
    """
    ephem = _ephemeris()
    moments = [_universal(time) for time in times]
    if not moments:
        raise InputError(given="No time is given.", needed="One a photograph.", remedy="Give times with their zone.")
    observer = ephem.Observer()
    observer.lat, observer.lon = float(place.latitude), float(place.longitude)
    observer.elevation = float(place.height)
    observer.temp = 15.0 - _LAPSE * place.height
    observer.pressure = _pressure(place.height) if place.refraction else 0.0
    sun, rows = ephem.Sun(), []
    for moment in moments:
        observer.date = ephem.Date(moment)
        sun.compute(observer)
        rows.append((float(sun.az), float(sun.alt), float(sun.dec), float(sun.earth_distance)))
    azimuth, elevation, declination, distance = np.array(rows).T
    return SunPositions(
        directions=from_azimuth(azimuth, elevation),
        azimuth=azimuth,
        elevation=elevation,
        declination=declination,
        distance=distance,
    )


def clear_sky_strength(positions: SunPositions) -> FloatArray:
    """Return how strong the sun is through clear air, relative to 1 at one astronomical unit outside of it.

    Meinel's rule 0.7^(a^0.678) [1]_ with the air mass a by Kasten and Young [2]_: right to some per cent on clear days
    at sea level, where exposure was kept. Not under haze or clouds: find strengths from the images then.

    Parameters
    ----------
    positions : SunPositions
        The sun.

    Returns
    -------
    float64 array (m,)
        Irradiance of a surface that faces the sun; 0 below the horizon [1 361 W m⁻²].

    References
    ----------
    .. [1] A. B. Meinel, M. P. Meinel, "Applied Solar Energy", Addison-Wesley, 1976.
    .. [2] F. Kasten, A. T. Young, "Revised optical air mass tables and approximation formula", Applied Optics 28(22),
       1989. doi:10.1364/AO.28.004735
    """
    height = np.degrees(np.maximum(positions.elevation, 0.0))
    mass = 1.0 / (np.sin(np.radians(height)) + 0.50572 * (height + 6.07995) ** -1.6364)
    return np.where(positions.elevation > 0, 0.7 ** (mass**0.678), 0.0) / positions.distance**2


def _pressure(height: float) -> float:
    """Return the pressure of the standard atmosphere [hPa]."""
    return float(1013.25 * (1.0 - _LAPSE * height / 288.15) ** 5.2559)


def _universal(time: datetime) -> datetime:
    """Return a moment as universal time without its zone, as PyEphem takes it."""
    if time.utcoffset() is None:
        raise InputError(
            given=f"The time {time.isoformat(sep=' ')} has no time zone.",
            needed="The zone, or the offset from universal time: an hour turns the sun by 15 degrees.",
            remedy="Write it with its offset, such as 2026-06-21T15:00+02:00, or give --zone.",
        )
    # Looked at first, since the first and last days of the calendar have no universal time in every zone.
    moment = time.astimezone(UTC).replace(tzinfo=None) if _YEARS[0] <= time.year <= _YEARS[1] else None
    if moment is None or not _YEARS[0] <= moment.year <= _YEARS[1]:
        raise InputError(
            given=f"The time is {time.isoformat(sep=' ')}.",
            needed=f"A moment from {_YEARS[0]} to {_YEARS[1]}, where the turning of the earth is known.",
            remedy="Set the camera's clock, or give the times by hand.",
        )
    return moment


def _ephemeris() -> ModuleType:
    try:
        return import_module("ephem")
    except ImportError:
        raise UnsupportedError(
            given="The package ephem is not installed.",
            needed="The sun's position comes from its ephemeris.",
            remedy="Install the package ephem, or psstereo with its extra 'outdoor'.",
        ) from None
