"""The sun of one day as the only light: near the equinox its path is a plane, and there is nothing to be done."""

from functools import partial

import numpy as np

from psstereo.bench.stress import DOUBLE, Answer, Rule, StressCase
from psstereo.errors import RigError
from psstereo.lights import Rig, solar_declination, sun_path
from psstereo.types import FloatArray
from psstereo_synth.stress.pixels import angles, exact_bound, solved, spread

__all__ = ["day_of", "sun_cases", "window"]

_LATITUDES = (0.0, 35.0, 50.0, 65.0)
_DATES = {"equinox": 0.0, "declination 1°": 1.0, "declination 10°": 10.0, "midsummer": 23.44, "midwinter": -23.44}
_STEP = 1.0 / 6.0
"""Time between two images [h]."""
_NOISE = 0.002
"""Standard deviation of the noise beside the brightness of a white surface that faces the sun [1]."""
_NOISE_BARS = 6.0
"""Standard errors that are let pass as the noise bound [1]."""
_KNOWN = 0.5
"""Bound from which on the answer's own error bar has to tell [rad]."""


def sun_cases() -> list[StressCase]:
    """Return the cases of this family."""
    cases = []
    for latitude in _LATITUDES:
        for name, declination in _DATES.items():
            if len(_visible(latitude, declination, 8.0)) < 4:
                continue  # polar night
            flat = declination == 0.0
            common = partial(
                StressCase,
                family="sun",
                rule=Rule.REFUSED if flat else Rule.TOLD,
                unit="rad",
                refusals=(RigError,) if flat else (),
            )
            where = f"latitude {latitude:g}°, {name}"
            cases.append(
                common(name="a day of 8 h, exact", parameter=where, run=partial(_exact, latitude, declination))
            )
            cases.append(
                common(
                    name=f"a day of 8 h, noise {_NOISE:g}",
                    parameter=where,
                    run=partial(_noisy, latitude, declination),
                    kinds=DOUBLE,
                )
            )
    told = partial(StressCase, family="sun", name="the refusal names what is not told", kinds=DOUBLE)
    cases += [told(parameter=f"latitude {at:g}°, equinox", run=partial(_named, at)) for at in (35.0, 65.0)]
    return cases


def day_of(declination: float) -> float:
    """Return the day, with its fraction, on which the sun stands over a parallel.

    Parameters
    ----------
    declination : float
        From −23.4 to 23.4 [deg].

    Returns
    -------
    float
        Day of the year, of its first half [day].
    """
    low, high = 1.0, 172.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.degrees(solar_declination(middle)) < declination else (low, middle)
    return 0.5 * (low + high)


def window(latitude: float, day: float, hours: float) -> FloatArray:
    """Return the sun every ten minutes of a window around noon, night included.

    Parameters
    ----------
    latitude : float
        North of the equator [deg].
    day : float
        Day of the year [day].
    hours : float
        Length of the window [h].

    Returns
    -------
    float64 array (m, 3)
        Directions, x east, y north, z up [1].
    """
    half = round(0.5 * hours / _STEP)
    return sun_path(float(np.radians(latitude)), day, 12.0 + _STEP * np.arange(-half, half + 1))


def _visible(latitude: float, declination: float, hours: float) -> FloatArray:
    path = window(latitude, day_of(declination), hours)
    return path[path[:, 2] > 0.02]


def _normals(path: FloatArray) -> FloatArray:
    """Return normals that the sun reaches all day: around the middle of its path."""
    middle = path.mean(axis=0) / np.linalg.norm(path.mean(axis=0))
    rng = np.random.default_rng(0)
    near = middle + 0.12 * rng.normal(size=(200, 3))
    near /= np.linalg.norm(near, axis=1, keepdims=True)
    return np.asarray(near[(near @ path.T > 0.05).all(axis=1)])


def _exact(latitude: float, declination: float, kind: str) -> Answer:
    path = _visible(latitude, declination, 8.0)
    normals = _normals(path)
    values = (0.7 * path @ normals.T).astype(kind)
    return spread(solved(values, path), 0.7 * normals, exact_bound(path, kind, iterates=True))


def _noisy(latitude: float, declination: float, kind: str) -> Answer:
    path = _visible(latitude, declination, 8.0)
    normals = _normals(path)
    rng = np.random.default_rng(1)
    values = path @ normals.T + _NOISE * rng.normal(size=(len(path), len(normals)))
    found = solved(values.astype(kind), path)
    bound = np.minimum(_NOISE_BARS * noise_angle(path, normals, _NOISE), _KNOWN)
    return Answer(error=angles(found, normals), bound=bound, flags=found.flags[0], bar=found.uncertainty[0])


def noise_angle(directions: FloatArray, normals: FloatArray, noise: float) -> FloatArray:
    """Return the angle of the error that white noise causes in normals that all lights reach.

    Parameters
    ----------
    directions : float array (m, 3)
        Toward the lights [1].
    normals : float array (p, 3)
        Unit normals [1].
    noise : float
        Standard deviation of the noise over the albedo [1].

    Returns
    -------
    float64 array (p,)
        Root mean square, the Cramér–Rao bound of small errors with the albedo unknown [rad].
    """
    inverse = np.linalg.pinv(directions)
    across = inverse[None] - normals[:, :, None] * (normals @ inverse)[:, None, :]
    return np.asarray(noise * np.sqrt((across**2).sum(axis=(1, 2))))


def _named(latitude: float, kind: str) -> Answer:
    """Ask for the direction of which a flat path says nothing; what lies in the path's plane is told by any fit."""
    del kind
    path = _visible(latitude, 0.0, 8.0)
    missing = np.linalg.svd(path)[2][-1]
    told = _refusal(path)
    shown = [any(f"{sign * x:.2f}" in told for sign in (1.0, -1.0)) for x in missing if abs(x) > 0.01]
    return Answer(error=np.array([0.0 if all(shown) else 1.0]), bound=0.5, words=f"refused with: {told}")


def _refusal(path: FloatArray) -> str:
    try:
        Rig.distant(path).require_spanning()
    except RigError as error:
        return str(error)
    return ""
