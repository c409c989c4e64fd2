"""Radiance along a ray, and what a sensor makes of it.

In clear air radiance does not change along a ray. A sensor of fixed aperture and fixed field of view therefore reads
the same value from a uniform source at any distance, while the source fills the field: the power from each patch falls
as 1/d² and the area in view grows as d². Only when the source has become smaller than the field does the reading fall,
in proportion to the source's solid angle.
"""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import in_range
from psstereo.radiometry.constants import FULL_SPHERE
from psstereo.types import FloatArray

__all__ = ["apparent_radiance", "field_radius", "radiance_from_power"]


def radiance_from_power(power: npt.ArrayLike, etendue: npt.ArrayLike) -> FloatArray:
    """Radiance that a sensor reads from the power through its own openings, L = Φ / G.

    It is the mean over the openings and the field of view. Not for a source that leaves part of the field dark, if its
    own radiance is wanted: the darkness is part of the mean, see `apparent_radiance`.

    Parameters
    ----------
    power : float or float array (...)
        Power Φ on the sensor, ≥ 0 [W].
    etendue : float or float array (...)
        Étendue G of the sensor, > 0, from `disc_etendue` or as area times solid angle [m² sr].

    Returns
    -------
    float64 array (...)
        Radiance of the broadcast shape [W m⁻² sr⁻¹].

    Raises
    ------
    InputError
        If the power is negative, or the étendue is not positive.

    Examples
    --------
    >>> print(radiance_from_power(3.0, 1.5))
    2.0
    """
    flux = in_range("power", power, unit="W")
    return np.asarray(flux / in_range("étendue", etendue, unit="m² sr", exclude_low=True))


def apparent_radiance(
    radiance: npt.ArrayLike, source_solid_angle: npt.ArrayLike, field_solid_angle: npt.ArrayLike
) -> FloatArray:
    """Radiance that a sensor of narrow field reads from a uniform source before darkness, L min(1, Ω_source / Ω_field).

    Constant at any distance while the source fills the field, then falling with the source's solid angle (as 1/d² far
    away): why a star looks dimmer than the sun although its surface is not. The source lies wholly in the field or
    covers it wholly; not for one that is cut by the edge of the field, nor for fields so wide that cosines matter.

    Parameters
    ----------
    radiance : float or float array (...)
        Radiance L of the source, ≥ 0 [W m⁻² sr⁻¹].
    source_solid_angle : float or float array (...)
        Solid angle of the source from the sensor, 0 … 4π [sr].
    field_solid_angle : float or float array (...)
        Solid angle of the field of view, of a pixel for example, > 0 [sr].

    Returns
    -------
    float64 array (...)
        Radiance read, of the broadcast shape [W m⁻² sr⁻¹].

    Raises
    ------
    InputError
        If a value lies outside its range.

    Examples
    --------
    >>> print(apparent_radiance(8.0, [2e-3, 1e-3, 5e-4, 2.5e-4], 1e-3))
    [8. 8. 4. 2.]
    """
    level = in_range("radiance", radiance, unit="W m⁻² sr⁻¹")
    source = in_range("source's solid angle", source_solid_angle, unit="sr", high=FULL_SPHERE)
    field = in_range("field's solid angle", field_solid_angle, unit="sr", high=FULL_SPHERE, exclude_low=True)
    return np.asarray(level * np.minimum(1.0, source / field))


def field_radius(
    aperture_radius: npt.ArrayLike, stop_radius: npt.ArrayLike, length: npt.ArrayLike, distance: npt.ArrayLike
) -> FloatArray:
    """Radius that a source must have to fill the field of a sensor with two openings, b + (a + b) s / t.

    A coaxial source at least as large gives the same reading at any distance, exactly and for openings of any width.

    Parameters
    ----------
    aperture_radius : float or float array (...)
        Radius a of the opening that lies deeper, on the sensor, ≥ 0 [m].
    stop_radius : float or float array (...)
        Radius b of the opening toward the source, ≥ 0 [m].
    length : float or float array (...)
        Distance t between the two openings, > 0 [m].
    distance : float or float array (...)
        Distance s of the source from the opening toward it, ≥ 0 [m].

    Returns
    -------
    float64 array (...)
        Radius of the broadcast shape [m].

    Raises
    ------
    InputError
        If a radius or the distance is negative, or the length is not positive.

    Examples
    --------
    >>> print(field_radius(0.01, 0.02, 0.1, 10.0))
    3.02
    """
    a = in_range("aperture's radius", aperture_radius, unit="m")
    b = in_range("stop's radius", stop_radius, unit="m")
    tube = in_range("length", length, unit="m", exclude_low=True)
    return np.asarray(b + (a + b) * (in_range("distance", distance, unit="m") / tube))
