"""Whether photographs agree with the hours that their clock gives: from which side the light comes tells."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from psstereo.calibrate.sun.position import Place, sun_positions
from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray

__all__ = ["ClockCheck", "check_clock", "facing_of_mask"]

_HOURS = range(-11, 13)
"""Errors of the clock that are tried; 12 and −12 are the same sun."""
_LEAST_SHIFT = 4
"""Hours from which an error is believed: the bulge of an object is known from its outline to within some 30 degrees."""
_CLEARLY = 0.25
"""Correlation by which another hour must agree better before the clock is doubted [1]."""
_AGAINST = -0.1
"""Correlation below which clock and heading are doubted whatever other hours say [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ClockCheck:
    """How well the shading under the sun of each hour agrees with the outline of the object.

    Attributes
    ----------
    hours : int array (k,)
        Hours added to the given times; those that put a sun below the horizon are left out [h].
    agreement : float64 array (k,)
        Correlation between how pixels brighten and dim and how those of a bulge in the outline would [1].
    shift : int
        The hour that agrees best [h].
    wrong : bool
        Whether that is so much better, and so far away, that the clock cannot be right; or nothing agrees.
    """

    hours: FloatArray
    agreement: FloatArray
    shift: int
    wrong: bool

    @property
    def sentence(self) -> str:
        """What was found, as a sentence."""
        here, best = self.agreement[self.hours == 0][0], self.agreement.max()
        if not self.wrong:
            return f"The light comes from the side that the clock says (agreement {here:.2f})."
        if abs(self.shift) < _LEAST_SHIFT:
            return (
                f"The light in the photographs comes from the opposite side than clock and heading say (agreement"
                f" {here:.2f}), and no other hour explains it."
            )
        side = "from the opposite side" if abs(self.shift) >= 10 else "from another side"
        hours = f"{abs(self.shift)} h {'earlier' if self.shift < 0 else 'later'}"
        hours = "12 h off, am for pm" if abs(self.shift) == 12 else hours
        return (
            f"The light in the photographs comes {side} than the clock says: shading agrees with the outline {best:.2f}"
            f" if the time is {hours}, {here:.2f} as it is."
        )

    def require_right(self) -> None:
        """Refuse a clock that the light contradicts.

        Raises
        ------
        InputError
            If it does.
        """
        if self.wrong:
            raise InputError(
                given=self.sentence,
                needed="Times in the zone that is given, and the heading of the camera's line of sight.",
                remedy="Correct --zone or the clock; or the heading, if that was taken the wrong way round.",
            )


def facing_of_mask(mask: BoolArray) -> FloatArray:
    """Return the normals of a bulge in an outline: where a surface faces, roughly, if nothing but its mask is known.

    A mask that touches all four sides of the image has no outline; its surface faces the camera.

    Parameters
    ----------
    mask : bool array (h, w)
        The object.

    Returns
    -------
    float64 array (h, w, 3)
        Unit normals of an ellipsoid over the mask, x right, y up, z toward the camera [1].

    Raises
    ------
    InputError
        If the mask is empty.
    """
    rows, columns = np.nonzero(mask)
    if len(rows) == 0:
        raise InputError(
            given="The mask is empty.", needed="An object.", remedy="Check that the object is white in it."
        )
    normals = np.zeros((*mask.shape, 3))
    normals[..., 2] = 1.0
    if mask[0].any() and mask[-1].any() and mask[:, 0].any() and mask[:, -1].any():
        return normals
    x, y = (columns - columns.mean()) / max(np.ptp(columns), 1), (rows.mean() - rows) / max(np.ptp(rows), 1)
    across = np.stack([x, y], axis=1) / max(float(np.hypot(x, y).max()), 1e-12)
    normals[rows, columns, :2] = across
    normals[rows, columns, 2] = np.sqrt(np.maximum(1.0 - (across * across).sum(axis=1), 0.0))
    return normals


def check_clock(
    values: FloatArray, times: Sequence[datetime], place: Place, rotation: FloatArray, facing: FloatArray
) -> ClockCheck:
    """Compare the light's side in photographs with the hours that the clock gives.

    A clock that is wrong by some hours turns all lights about the pole, and all normals with them: residuals hardly
    see it, but the shading no longer fits the outline. Tells gross errors only, such as a zone on the other side of the
    earth, am for pm, or a heading the wrong way round; an hour more or less is not seen.

    Parameters
    ----------
    values : float array (m, p)
        Linear brightness of some pixels; NaN where not usable.
    times : sequence of datetime (m,)
        When the photographs were taken, with zones.
    place : Place
        Where.
    rotation : float array (3, 3)
        The camera's axes as columns, x east, y north, z up [1].
    facing : float array (p, 3)
        Where these pixels face, roughly; see :func:`facing_of_mask` [1].

    Returns
    -------
    ClockCheck
        The agreement of each hour.

    Raises
    ------
    InputError
        If there are fewer than three photographs, shapes disagree, or a sun is below the horizon as given.
    """
    v, n0 = np.asarray(values, np.float64), np.asarray(facing, np.float64)
    if v.ndim != 2 or len(v) != len(times) or len(v) < 3 or n0.shape != (v.shape[1], 3):
        raise InputError(
            given=f"Brightness has the shape {v.shape}, facing {n0.shape}, and there are {len(times)} times.",
            needed="(m, p), (p, 3), and m times, at least three.",
            remedy="Take the same pixels of all photographs.",
        )
    usable = np.isfinite(v)
    v = np.where(usable, v, 0.0)
    hours, agreement = [], []
    for hour in _HOURS:
        directions = sun_positions([time + timedelta(hours=hour) for time in times], place).directions
        if (directions[:, 2] > 0).all():
            hours.append(hour)
            agreement.append(_agreement(v, usable, directions @ rotation, n0))
    if 0 not in hours:
        raise InputError(
            given="At a given time the sun is below the horizon.",
            needed="A sun above the horizon in every photograph.",
            remedy="Correct the clock or the zone; 12 h off turns day into night.",
        )
    scores = np.array(agreement)
    shift = hours[int(scores.argmax())]
    gain = scores.max() - scores[hours.index(0)]
    return ClockCheck(
        hours=np.array(hours),
        agreement=scores,
        shift=shift,
        wrong=bool((abs(shift) >= _LEAST_SHIFT and gain > _CLEARLY) or scores[hours.index(0)] < _AGAINST),
    )


def _agreement(values: FloatArray, usable: BoolArray, directions: FloatArray, facing: FloatArray) -> float:
    """Return the correlation of how each pixel brightens and dims over the images with how its bulge would.

    Each pixel counts relative to its own mean, which takes paint out, and about it, which takes an even sky out.
    """
    expected = np.maximum(directions @ facing.T, 0.0)
    seen, model = (_departure(one, usable) for one in (values, expected))
    size = float(np.sqrt((seen**2).sum() * (model**2).sum()))
    return float((seen * model).sum()) / size if size > 0 else 0.0


def _departure(values: FloatArray, usable: BoolArray) -> FloatArray:
    """Return each pixel's values over their mean less one, (m, p); zero where it is dark or not usable."""
    mean = np.where(usable, values, 0.0).sum(axis=0) / np.maximum(usable.sum(axis=0), 1)
    lit = mean > 1e-6 * max(float(mean.max()), np.finfo(np.float64).tiny)
    return np.where(usable & lit, values / np.where(lit, mean, 1.0) - 1.0, 0.0)
