"""What a series of problems has in common: one number that varies, and how error or time follow it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError

__all__ = ["MEASURES", "Slope", "Sweep", "fit_slope"]

MEASURES = ("error", "seconds")


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Problems that differ in one number.

    Attributes
    ----------
    title : str
        What they have in common.
    axis : str
        What the number is.
    values : mapping
        The number, positive, by the problem's name [unit].
    unit : str
        Its unit; empty for a count.
    measure : str
        What is looked at: ``"error"``, or ``"seconds"`` with a slope fitted.

    Raises
    ------
    InputError
        If a number is not positive or the measure is unknown.
    """

    title: str
    axis: str
    values: Mapping[str, float]
    unit: str = ""
    measure: str = "error"

    def __post_init__(self) -> None:
        if self.measure not in MEASURES or not all(0 < v < math.inf for v in self.values.values()):
            raise InputError(
                given=f"The sweep {self.title!r} measures {self.measure!r} over {sorted(self.values.values())}.",
                needed=f"One of {', '.join(MEASURES)}, over positive numbers, since the axes are logarithmic.",
                remedy="Leave out zero, or choose another measure.",
            )


@dataclass(frozen=True, kw_only=True)
class Slope:
    """A power law c xᵏ through measurements, fitted to their logarithms by least squares.

    Attributes
    ----------
    slope : float
        The power k [1].
    error : float
        Its standard error; NaN for two points, which leave no residual [1].
    factor : float
        The factor c [unit of y over that of x to the power].
    """

    slope: float
    error: float
    factor: float

    def __str__(self) -> str:
        if math.isnan(self.error):
            return f"{self.slope:.2f}"
        return f"{self.slope:.2f} ± {self.error:.{2 if self.error >= 0.005 else 3}f}"


def fit_slope(x: Sequence[float], y: Sequence[float]) -> Slope:
    """Fit a power law.

    Do not read a growth from it where a fixed cost is a large part of the small cases: that flattens it.

    Parameters
    ----------
    x, y : sequence of float
        Positive numbers, of two or more different x [any].

    Returns
    -------
    Slope
        Power, its standard error, and factor.

    Raises
    ------
    InputError
        If there are too few, or one is not positive.

    Examples
    --------
    >>> round(fit_slope([1, 2, 4], [3, 12, 48]).slope, 12)
    2.0
    """
    sound = len(x) == len(y) and len(set(x)) >= 2 and all(0 < v < math.inf for v in (*x, *y))
    if not sound:
        raise InputError(
            given=f"A slope is to be fitted to {len(x)} and {len(y)} numbers.",
            needed="As many of both, positive and finite, and two or more different ones along the axis.",
            remedy="Measure at more sizes.",
        )
    u, v = np.log(np.asarray(x, np.float64)), np.log(np.asarray(y, np.float64))
    off = u - u.mean()
    square = float(off @ off)
    slope = float(off @ v) / square
    residual = v - v.mean() - slope * off
    error = math.sqrt(float(residual @ residual) / (len(u) - 2) / square) if len(u) > 2 else math.nan
    return Slope(slope=slope, error=error, factor=math.exp(float(v.mean()) - slope * float(u.mean())))
