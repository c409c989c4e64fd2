"""Figures that are known of hard cases, each beside what comes out here: sun, rings, rounding, noise, precision."""

from functools import partial

import numpy as np

from psstereo.bench.stress import DOUBLE, Answer, StressCase
from psstereo.lights import Led, Rig
from psstereo.metrics import angular_error
from psstereo.normals import GATES, LeastSquares
from psstereo.types import FloatArray
from psstereo_synth.rigs import ring
from psstereo_synth.stress.lights import flattened
from psstereo_synth.stress.pixels import angles, cap, solved
from psstereo_synth.stress.sun import day_of, noise_angle, window

__all__ = ["figure_cases"]

_WINDOWS = (1, 2, 4, 6, 8, 10, 12)
_SUN = {
    1.0: (17273, 4751, 1202, 501, 255, 145, 91),
    5.0: (3472, 955, 242, 101, 51, 29, 18),
    10.0: (1763, 485, 123, 52, 26, 15, 9.3),
    23.44: (827, 228, 58, 25, 13, 7.6, 4.8),
}
"""Condition of the sun's directions, every ten minutes of a window around noon, by declination [deg] and window [h]."""
_SEASONS = {"a month": (30.0, 12.0), "half a year": (180.0, 2.8), "a year": (360.0, 2.8)}
"""Condition of the sun's directions on 8 h of every fifth day around an equinox, and the time's length [day]."""
_RING = {
    5: (16, 528),
    10: (8.0, 134),
    20: (3.9, 35),
    30: (2.4, 17),
    40: (1.7, 11.4),
    54.7356: (1, 9),
    70: (1.9, 13),
    80: (4.0, 37),
    85: (8.1, 136),
}
"""Condition and m · trace((LᵀL)⁻¹) of a ring by its slant [deg]."""
_ALBEDOS = (1.0, 0.5, 0.1, 0.02)
_ROUNDED = {
    (3, 8): (0.09, 0.18, 0.92, 4.6),
    (3, 12): (0.006, 0.011, 0.057, 0.29),
    (96, 8): (0.016, 0.03, 0.16),
}
"""Angle by rounding with lights as good as can be, by lights and bits, over albedo as a share of full scale [deg]."""
_UNDITHERED = 0.81
"""The same for 96 lights, 8 bit and albedo 0.02: five steps in all, of which rounding is no white noise [deg]."""
_NOISY = {3: 0.81, 96: 0.143}
"""Angle by noise of 1 % of the albedo with lights as good as can be [deg]."""
_PRECISION = {1.5e3: (1e-3, 4e-4), 1.5e4: (1e-2, 5e-3), 1.5e5: (0.11, 0.05)}
"""Angle on exact data under nearly coplanar lights by single-precision normal equations, and by orthogonal factors
[deg]; in double precision 1e-7."""
_DOUBLE_ANGLE = 1e-7
_LIGHTS = 12


def figure_cases() -> list[StressCase]:
    """Return the cases of this family."""
    known = partial(StressCase, family="figures", kinds=DOUBLE)
    cases = [
        known(name="condition of the sun's path", parameter=f"declination {at:g}°", run=partial(_sun, at))
        for at in _SUN
    ]
    season = partial(known, name="condition of the sun's paths")
    cases += [season(parameter=f"8 h a day for {name}", run=partial(_season, name)) for name in _SEASONS]
    cases.append(known(name="condition and noise of rings", parameter="slants 5° to 85°", run=_rings))
    cases += [
        known(name="rounding", parameter=f"{lights} lights, {bits} bit", run=partial(_rounding, lights, bits), unit="1")
        for lights, bits in _ROUNDED
    ]
    cases.append(known(name="rounding", parameter="96 lights, 8 bit, five steps in all", run=_steps, unit="deg"))
    cases.append(known(name="rounding", parameter="3 lights, 16 bit: below 0.02° everywhere", run=_fine, unit="deg"))
    cases += [known(name="noise of 1 %", parameter=f"{count} lights", run=partial(_noise, count)) for count in _NOISY]
    cases += [
        StressCase(
            family="figures",
            name="nearly coplanar, no noise",
            parameter=f"condition {condition:.1e}",
            run=partial(_precision, condition),
            unit="deg",
        )
        for condition in _PRECISION
    ]
    small = partial(StressCase, family="figures", name="small angles between vectors", unit="rad")
    cases += [small(parameter=f"{angle:.0e} rad", run=partial(_angle, angle)) for angle in (1e-2, 1e-4, 1e-6, 1e-8)]
    cases.append(known(name="fall-off near a lamp", parameter="2 dr/r; relief of 10 %: 20 %", run=_falloff))
    return cases


def _beside(found: list[float], figures: tuple[float, ...], allowed: float) -> Answer:
    """Return relative deviations from figures that were rounded to two digits or to whole numbers."""
    measured, known = np.array(found), np.array(figures, np.float64)
    words = "; ".join(f"{a:.4g} for {b:g}" for a, b in zip(measured, known, strict=True))
    return Answer(error=np.abs(measured / known - 1.0), bound=allowed, words=words)


def _condition(directions: FloatArray) -> float:
    return Rig.distant(directions).condition()


def _sun(declination: float, kind: str) -> Answer:
    del kind
    day = day_of(declination)
    return _beside([_condition(window(0.0, day, float(h))) for h in _WINDOWS], _SUN[declination], 0.03)


def _season(name: str, kind: str) -> Answer:
    del kind
    length, figure = _SEASONS[name]
    days = day_of(0.0) + np.arange(-length / 2.0, length / 2.0 + 1.0, 5.0)
    paths = [window(0.0, (day - 1.0) % 365.0 + 1.0, 8.0) for day in days]
    return _beside([_condition(np.concatenate(paths))], (figure,), 0.05)


def _rings(kind: str) -> Answer:
    del kind
    found, known = [], []
    for slant, figures in _RING.items():
        directions = ring(12, tilt=float(np.radians(slant)))
        found += [_condition(directions), 12.0 * float(np.trace(np.linalg.inv(directions.T @ directions)))]
        known += [*figures]
    return _beside(found, tuple(known), 0.06)


def _rms(bits: int | None, lights: int, albedo: float, noise: float = 0.0) -> float:
    """Return the angle of matte pixels that every light reaches, rounded or noisy, root mean square [deg]."""
    directions, normals = ring(lights), cap(4000, np.radians(25.0))
    values = albedo * directions @ normals.T
    if bits is not None:
        top = 2**bits - 1
        values = np.rint(values * top) / top
    if noise:
        values = values + noise * np.random.default_rng(0).normal(size=values.shape)
    found = solved(values, directions, LeastSquares(gate=GATES["none"]))
    return float(np.degrees(np.sqrt((angles(found, normals) ** 2).mean())))


def _rounding(lights: int, bits: int, kind: str) -> Answer:
    del kind
    figures = _ROUNDED[lights, bits]
    return _beside([_rms(bits, lights, albedo) for albedo in _ALBEDOS[: len(figures)]], figures, 0.12)


def _steps(kind: str) -> Answer:
    """Hold five steps to the bound of half a step on each; the figure takes rounding for white, which it is not."""
    del kind
    albedo = _ALBEDOS[-1]
    bound = np.degrees(np.sqrt(3.0) * 0.5 / 255.0 / albedo)  # |L⁺| √m is √3 for such lights
    found = _rms(8, 96, albedo)
    return Answer(
        error=np.array([found]), bound=bound, words=f"{found:.3g}° for {_UNDITHERED:g}°, if it were white noise"
    )


def _fine(kind: str) -> Answer:
    del kind
    error = np.array([_rms(16, 3, albedo) for albedo in _ALBEDOS])
    return Answer(error=error, bound=0.02, words="; ".join(f"{one:.2g}°" for one in error))


def _noise(count: int, kind: str) -> Answer:
    del kind
    return _beside([_rms(None, count, 1.0, 0.01)], (_NOISY[count],), 0.05)


def _precision(condition: float, kind: str) -> Answer:
    """Hold data in single precision to what their rounding alone does; the figures are of arithmetic in it as well."""
    directions, normals = flattened(condition, _LIGHTS), cap(2000, np.radians(25.0))
    values = 0.7 * directions @ normals.T
    found = solved(values.astype(kind), directions, LeastSquares())
    error = np.degrees(np.sqrt((angles(found, normals) ** 2).mean()))
    # Values from 0.35 to 0.7 have steps of ε/4 to ε/2, and rounding errors of a step over √12.
    rounding = np.finfo(kind).eps / 2.0 / np.sqrt(12.0) / 0.7
    floor = np.degrees(np.sqrt(np.square(noise_angle(directions, normals, float(rounding))).mean()))
    if kind == "float64":
        return Answer(error=np.array([error]), bound=_DOUBLE_ANGLE)
    single, data = directions.astype(np.float32), values.astype(np.float32)
    q, r = np.linalg.qr(single)
    others = np.linalg.solve(single.T @ single, single.T @ data), np.linalg.solve(r, q.T @ data)
    each = [np.degrees(np.sqrt(np.square(angular_error(b.T.astype(np.float64), normals)).mean())) for b in others]
    figures = _PRECISION[condition]
    words = (
        f"all in float32: normal equations {each[0]:.2g}° for {figures[0]:g}°, QR {each[1]:.2g}° for {figures[1]:g}°"
    )
    return Answer(error=np.array([error]), bound=1.5 * floor, words=words)


def _angle(angle: float, kind: str) -> Answer:
    """Measure a small angle; by arccos, single precision has no step below 0.02° and double none below 8.5e-7°."""
    first = np.array([[0.36, 0.48, 0.8]])
    across = np.array([[0.8, -0.6, 0.0]])
    second = np.cos(angle) * first + np.sin(angle) * across
    found = np.asarray(angular_error(first.astype(kind), second.astype(kind)), np.float64)
    return Answer(error=np.abs(found - angle), bound=4.0 * float(np.finfo(kind).eps))


def _falloff(kind: str) -> Answer:
    del kind
    lamp = Led(position=np.zeros(3), axis=np.array([0, 0, -1.0]), mu=0.0, flux=np.ones(1))
    depths = -np.array([1.0, 1.0 + 1e-4, 1.0 - 0.1])
    points = np.stack([np.zeros(3), np.zeros(3), depths], axis=1)
    level = lamp.irradiance(points, np.tile([0.0, 0.0, 1.0], (3, 1)))[:, 0]
    return _beside([1.0 - level[1] / level[0], level[2] / level[0] - 1.0], (2e-4, 0.2), 0.25)
