"""How good a rig of lights is, in words: a verdict, and what would make it better."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.calibrate.rig.figures import RigFigures, rig_figures
from psstereo.errors import RigError
from psstereo.lights import Rig
from psstereo.types import FloatArray, IntArray

__all__ = ["RigRating", "assess_rig", "rate_rig"]

_NOISE = 0.01
"""Noise that sentences speak of, as a share of the brightness of a white surface that faces the strongest light."""
_GOOD, _USABLE = 1.5, 3.0
"""Up to how many times the smallest possible error a rig is called good, and usable."""
_WEAK = 0.5
"""Share of what even lights have along every axis below which an axis is weak: its error is then 1.4 times as large."""
_CLOSE = np.radians(5.0)
"""Lights nearer to each other than this tell nearly the same, unless there are so many that they must be near."""
_DIM = 0.25
"""Share of the strongest light below which a light is called weak."""
_COMMON = np.radians(45.0)
"""Half of what one sees of a ball is tilted less than this."""
_UNSURE = np.radians(1.0)
"""A direction's error that is worth naming: as much as noise of one percent does under three lights."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RigRating:
    """A rig's figures and what they mean.

    Attributes
    ----------
    figures : RigFigures
        What the sentences rest on.
    verdict : str
        One sentence.
    advice : tuple of str
        What would help, a sentence each, most urgent first.
    """

    figures: RigFigures
    verdict: str
    advice: tuple[str, ...]


def rate_rig(
    rig: Rig, *, direction_error: FloatArray | None = None, point: npt.ArrayLike | None = None
) -> tuple[str, tuple[str, ...]]:
    """Say in a sentence how good a rig is, and what would make it better.

    Parameters
    ----------
    rig : Rig
        Distant lights, or lamps.
    direction_error : float array (m,), optional
        Root-mean-square angle of each direction's error; NaN where it is not known [rad].
    point : array (3,), optional
        Where the object is, for lamps; where their axes meet if absent [length].

    Returns
    -------
    verdict : str
        One sentence. Lamps whose axes do not meet are said to be not rated.
    advice : tuple of str
        A sentence each, most urgent first.

    Raises
    ------
    InputError
        If there are other numbers of errors than lights, or one is negative.
    UnsupportedError
        If a light is neither distant nor a lamp.
    """
    try:
        rating = assess_rig(rig, direction_error=direction_error, point=point)
    except RigError as error:
        return f"Not rated: {error.given}", (f"{error.needed} {error.remedy}",)
    return rating.verdict, rating.advice


def assess_rig(rig: Rig, *, direction_error: FloatArray | None = None, point: npt.ArrayLike | None = None) -> RigRating:
    """Rate a rig, with the figures; parameters and refusals as for :func:`psstereo.calibrate.rig.figures.rig_figures`.

    Returns
    -------
    RigRating
        Figures, verdict, advice.
    """
    figures = rig_figures(rig, direction_error=direction_error, point=point)
    return RigRating(figures=figures, verdict=_verdict(figures), advice=tuple(_advice(figures)))


def _verdict(figures: RigFigures) -> str:
    count = len(figures.directions)
    lights = "1 light" if count == 1 else f"{count} lights"
    if count < 3 or not np.isfinite(figures.condition):
        why = "of three or more that are needed" if count < 3 else "all in one plane with the object"
        return f"Not enough for normals: {lights}, {why}."
    upright, best = figures.error_per_noise[0], figures.best
    if not np.isfinite(upright):
        return (
            f"Not enough for normals: of {lights} {figures.fewest_lit[0]} reach a surface that faces the camera, and "
            "they do not tell its normal."
        )
    grade = "Good" if upright <= _GOOD * best else "Usable" if upright <= _USABLE * best else "Weak"
    reach = _reach(figures)
    known = figures.from_directions
    return (
        f"{grade}: {lights}, condition {figures.condition:.2g}; noise of 1 % turns a normal toward the camera by "
        f"{_degrees(_NOISE * upright)} ({_degrees(_NOISE * best)} at best), and three or more lights reach every "
        f"normal up to {reach:.0f}° from the view"
        + (f"; errors of the directions turn it by {_degrees(known)}." if np.isfinite(known) else ".")
    )


def _reach(figures: RigFigures) -> float:
    """Return the largest tilt up to which three lights reach every normal and tell it [deg]."""
    short = np.flatnonzero((figures.fewest_lit < 3) | (figures.told < 1))
    last = len(figures.tilts) - 1 if len(short) == 0 else max(int(short[0]) - 1, 0)
    return float(np.degrees(figures.tilts[last]))


def _degrees(angle: float) -> str:
    return f"{np.degrees(angle):.2g}°"


def _advice(figures: RigFigures) -> Iterator[str]:
    count = len(figures.directions)
    if count < 3:
        yield "Add lights: three or more, not all in one plane; five or more also tell shadows and highlights."
        return
    yield from _on_spread(figures)
    yield from _on_shadow(figures)
    yield from _on_pairs(figures)
    yield from _on_strengths(figures)
    yield from _on_errors(figures)
    behind = np.flatnonzero(figures.directions[:, 2] <= 0)
    if len(behind):
        verb = "stands" if len(behind) == 1 else "stand"
        yield f"{_named(behind)} {verb} at the side or behind (z ≤ 0): of no use where the surface faces the camera."
    if count < 5:
        spare = "no light is" if count == 3 else "only one light is"
        yield f"With {count} lights {spare} to spare: take five or more, so that shadows and highlights can be told."


def _on_spread(figures: RigFigures) -> Iterator[str]:
    """Say in which way the lights are too much alike."""
    weights = figures.shares**2
    values, axes = np.linalg.eigh((figures.directions * weights[:, None]).T @ figures.directions / weights.sum())
    if values[0] * 3 >= _WEAK:
        return
    x, y, z = axes[:, 0]
    slant = np.arctan2(np.hypot(figures.directions[:, 0], figures.directions[:, 1]), figures.directions[:, 2])
    if z * z >= 0.5:
        yield (
            f"The lights stand low, {np.degrees(slant.min()):.0f}° or more from the view: raise some, toward 35° above "
            "the surface's plane or higher."
        )
    elif values[1] * 3 < _WEAK:
        yield (
            f"No light below {90 - np.degrees(slant.max()):.0f}° above the surface's plane: lower some, toward 35°, so "
            "that they tell slopes."
        )
    else:
        side = np.degrees(np.arctan2(y, x)) % 360
        yield (
            f"The lights stand nearly in one plane: add some on the sides that they leave out, at azimuths "
            f"{side % 180:.0f}° and {side % 180 + 180:.0f}°."
        )


def _on_shadow(figures: RigFigures) -> Iterator[str]:
    """Say on which side a normal of a common tilt lies in its own shadow."""
    short = np.flatnonzero((figures.fewest_lit < 3) & (figures.tilts <= _COMMON + 1e-9))
    if len(short):
        place = short[0]
        lit = int(figures.fewest_lit[place])
        where = f" toward azimuth {np.degrees(figures.darkest[place]):.0f}°" if place else ""
        yield (
            f"A normal {np.degrees(figures.tilts[place]):.0f}° from the view{where} is reached by "
            f"{lit if lit else 'no'} light{'' if lit == 1 else 's'}: add lights on that side, or raise those opposite."
        )


def _on_pairs(figures: RigFigures) -> Iterator[str]:
    """Name the two lights that are nearest to each other if they tell nearly the same."""
    towards = figures.directions
    count = len(towards)
    first, second = np.triu_indices(count, 1)
    apart = 2 * np.arcsin(np.minimum(np.sqrt(((towards[first] - towards[second]) ** 2).sum(axis=1)) / 2, 1.0))
    # As many lights evenly over the hemisphere are about this far from each other; a quarter of it is no accident.
    even = np.sqrt(2 * np.pi / count * 2 / np.sqrt(3.0))
    limit = min(_CLOSE, even / 4)
    close = np.flatnonzero(apart < limit)
    if len(close):
        pair = close[apart[close].argmin()]
        more = f" ({len(close)} pairs are less than {np.degrees(limit):.0f}°)" if len(close) > 1 else ""
        yield (
            f"Lights {first[pair] + 1} and {second[pair] + 1} are {np.degrees(apart[pair]):.1f}° apart{more}: they "
            "tell nearly the same; move one."
        )


def _on_strengths(figures: RigFigures) -> Iterator[str]:
    dim = np.flatnonzero(figures.shares < _DIM)
    if len(dim):
        least = figures.shares[dim].min()
        yield (
            f"{_named(dim)} {'is' if len(dim) == 1 else 'are'} weak, down to {least:.2g} of the strongest: noise "
            f"counts {1 / least:.2g} times as much; make them equal, or expose them longer."
        )


def _on_errors(figures: RigFigures) -> Iterator[str]:
    errors = figures.direction_error
    unsure = np.zeros(0, np.intp) if errors is None else np.flatnonzero(errors > _UNSURE)
    if errors is not None and len(unsure):
        yield (
            f"The direction of {_named(unsure).lower()} is known to ±{np.degrees(errors[unsure].max()):.1f}° only: "
            "measure again with a larger or sharper target, or average several."
        )


def _named(lights: IntArray) -> str:
    """Return lights by number, from 1.

    Examples
    --------
    >>> _named(np.array([0])), _named(np.array([1, 3]))
    ('Light 1', 'Lights 2, 4')
    """
    some = ", ".join(str(i + 1) for i in lights[:4]) + (" …" if len(lights) > 4 else "")
    return f"Light{'' if len(lights) == 1 else 's'} {some}"
