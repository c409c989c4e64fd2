"""Light directions that somebody wrote down, held against measured ones."""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["LightComparison", "compare_directions"]

_APART = 3.0
"""Expected errors from which directions disagree."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LightComparison:
    """How far given directions are from measured ones.

    Attributes
    ----------
    angles : float64 array (m,)
        Between them [rad].
    expected : float
        Root-mean-square error of the measured ones [rad].
    agrees : bool
        Whether the root mean square of the angles is below three times that.
    sentence : str
        All that in words.
    """

    angles: FloatArray
    expected: float
    agrees: bool
    sentence: str


def compare_directions(measured: FloatArray, error: FloatArray, given: FloatArray, *, name: str) -> LightComparison:
    """Compare directions that were given with measured ones.

    Not for lamps that are near: given directions would have to be those from the same place.

    Parameters
    ----------
    measured : float array (m, 3)
        Toward the lights [1].
    error : float array (m,)
        Root-mean-square angle of their errors [rad].
    given : float array (m, 3)
        Directions of any positive length, in the same order [1].
    name : str
        Of the given ones, for the sentence.

    Returns
    -------
    LightComparison
        Angles, and whether they are within what is expected.

    Raises
    ------
    InputError
        If there are not as many.
    """
    if measured.shape != given.shape:
        raise InputError(
            given=f"{name} has {len(given)} lights; {len(measured)} were measured.",
            needed="The same lights in the same order.",
            remedy="Compare with the file that belongs to these pictures.",
        )
    across = np.cross(measured, given)
    angles = np.arctan2(np.sqrt((across * across).sum(axis=1)), (measured * given).sum(axis=1))
    expected = float(np.sqrt((error * error).mean()))
    size = float(np.sqrt((angles * angles).mean()))
    agrees = bool(size <= _APART * expected)
    degrees, worst = np.degrees(angles), int(angles.argmax())
    verdict = "agrees with" if agrees else "disagrees with"
    sentence = (
        f"{name} {verdict} the balls: {degrees.mean():.2f}° on average, {degrees[worst]:.2f}° at light {worst + 1},"
        f" where ±{np.degrees(expected):.2g}° are expected."
    )
    return LightComparison(angles=angles, expected=expected, agrees=agrees, sentence=sentence)
