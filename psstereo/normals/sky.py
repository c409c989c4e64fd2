"""Least squares under the sun and a sky that is known: ``I_i = max(0, l_i · b) v_i + |b| E_i(n)``."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from psstereo.errors import OptionError, RigError
from psstereo.lights import Distant, Rig, real_harmonics
from psstereo.lights.vectors import unit_vector
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.moments import RigFactor
from psstereo.normals.sky_fit import SkyFit, SkyState, sky_terms
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.normals.verdict import Verdict
from psstereo.types import FloatArray

__all__ = ["SkyLeastSquares", "even_skies", "even_sky"]

_PART = 512
"""Pixels fitted at once."""


def even_sky(zenith: npt.ArrayLike, ground: float = 0.2) -> FloatArray:
    """Return the harmonics of an even sky over an even ground that light level ground with irradiance 1.

    A half sphere of one radiance over another of one radiance has no harmonics of second order, so that the four are
    exact for irradiance up to third order.

    Parameters
    ----------
    zenith : float array (3,)
        Upward in the camera's frame [1].
    ground : float
        Radiance of the ground over the sky's [1].

    Returns
    -------
    float64 array (9,)
        In the order of :func:`psstereo.lights.real_harmonics` [sr⁻¹ sr½].
    """
    up = unit_vector(zenith, "zenith")
    harmonics = real_harmonics(up)
    level = np.zeros(9)
    # E(n) = π L ((1 + g) + (1 − g) n·u) / 2, which is 1 at n = u for π L = 1.
    level[0] = 0.5 * (1.0 + ground) / (np.pi * harmonics[0])
    level[1:4] = 0.5 * (1.0 - ground) * harmonics[1:4] / (0.75 / np.pi) / (2.0 * np.pi / 3.0)
    return level


def even_skies(rig: Rig, zenith: npt.ArrayLike, ground: float) -> FloatArray:
    """Return an even sky over the strength of each sun, float64 (m, 9).

    Parameters
    ----------
    rig : Rig
        The suns; the strongest counts as 1.
    zenith : float array (3,)
        Upward in the camera's frame [1].
    ground : float
        Radiance of the ground over the sky's [1].

    Returns
    -------
    float64 array (m, 9)
        Harmonics of :func:`even_sky` over each sun's strength.
    """
    strength = np.array([float(light.strength.mean()) for light in rig.lights if isinstance(light, Distant)])
    return np.asarray(even_sky(zenith, ground) / (strength / strength.max())[:, None])


@dataclass(frozen=True, kw_only=True)
class SkyLeastSquares(NormalSolver[SkyState | RigFactor]):
    """Least squares for normal and albedo under the sun and a sky that is known for each image.

    An observation in the shade shows the sky alone and helps, instead of being left out; but what three suns do not
    reach has no normal, for a sky is too smooth to tell one. Not where the
    sky is not known: :func:`psstereo.calibrate.sun.estimate_sky` finds it from the images. Nor in deep folds, which see
    little of the sky.

    Attributes
    ----------
    even : float
        Irradiance of an even sky on level ground over the strongest sun's on what faces it; 0 for no sky. A clear sky
        has 0.05 to 0.2; :func:`psstereo.calibrate.sun.estimate_sky` tells it. Without a sky this is plain least squares
        [1].
    zenith : str
        Upward in the camera's frame, three numbers parted by commas; the y axis for a level camera [1].
    ground : float
        Radiance of the ground over the even sky's [1].
    sky : tuple of tuple of float (m, 1 or 4 or 9), optional
        In place of the even sky, the radiance of each image's sky in spherical harmonics, in the order of
        :func:`psstereo.lights.real_harmonics`, over the sun's strength in the same image [sr⁻¹ sr½].
    gate : Gate
        Whether shadows are looked for; without that every observation is taken to be in the sun where it faces it.

    Raises
    ------
    OptionError
        If a number is out of range, the zenith is no direction, or the sky is no table of 1, 4 or 9 finite numbers an
        image.
    """

    name: ClassVar[str] = "sky"
    summary: ClassVar[str] = "Lambert's law under the sun and a known sky"
    assumes: ClassVar[str] = "the surface is matte and sees all of the sky on its side"
    avoid: ClassVar[str] = "the sky is not known, or there is none"
    even: float = 0.0
    zenith: str = "0,1,0"
    ground: float = 0.2
    sky: tuple[tuple[float, ...], ...] | None = None

    def __post_init__(self) -> None:
        self._upward()
        if not (0 <= self.even < np.inf and 0 <= self.ground <= 1):
            raise OptionError(
                given=f"The even sky is {self.even}, the ground {self.ground} of it.",
                needed="A sky of 0 or more, a ground of 0 to 1.",
                remedy="A clear sky has 0.05 to 0.2 of the sun, grass and soil 0.1 to 0.3 of the sky, snow up to 0.9.",
            )
        if self.sky is None:
            return
        lengths = {len(row) for row in self.sky}
        if len(lengths) != 1 or not lengths <= {1, 4, 9} or not np.isfinite(np.array(self.sky, np.float64)).all():
            raise OptionError(
                given=f"The sky has {len(self.sky)} rows of {sorted(lengths)} numbers.",
                needed="One row an image of 1, 4 or 9 finite numbers: spherical harmonics of order 0, 1 or 2.",
                remedy="Give radiances over the sun's strength, as estimate_sky returns them.",
            )

    def _upward(self) -> FloatArray:
        """Return the zenith as a vector."""
        try:
            numbers = np.array([float(part) for part in self.zenith.split(",")])
        except ValueError:
            numbers = np.zeros(0)
        if numbers.shape != (3,) or not np.isfinite(numbers).all() or not numbers.any():
            raise OptionError(
                given=f"The zenith is {self.zenith!r}.",
                needed="Three numbers x,y,z that are not all zero: upward in the camera's frame.",
                remedy="A level camera has 0,1,0; one that looks straight down 0,0,1.",
            )
        return numbers

    def prepare(self, rig: Rig, pixels: int | None = None) -> SkyState | RigFactor:
        """Turn harmonics into polynomials; see :meth:`NormalSolver.prepare`."""
        self.require_lights(rig)
        if self.sky is None and self.even == 0:
            return LeastSquares(gate=self.gate).prepare(rig, pixels)
        if self.sky is None:
            return SkyState(rig.directions, sky_terms(self.even * even_skies(rig, self._upward(), self.ground)))
        if len(self.sky) != len(rig):
            raise RigError(
                given=f"The sky is known for {len(self.sky)} images, and there are {len(rig)} suns.",
                needed="One sky an image.",
                remedy="Give skies and suns of the same images, in the same order.",
            )
        return SkyState(rig.directions, sky_terms(np.array(self.sky, np.float64)))

    def solve(self, state: SkyState | RigFactor, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        if not isinstance(state, SkyState):
            return LeastSquares(gate=self.gate).solve(state, samples)
        count = samples.values.shape[1]
        found = PixelNormals(
            scaled=np.full((count, 3), np.nan),
            uncertainty=np.full(count, np.nan),
            flags=np.zeros(count, np.uint16),
            used=np.zeros(count, np.uint16),
            covariance=np.full((count, 6), np.nan) if samples.covariance else None,
            verdicts=np.full(samples.values.shape, Verdict.USED, np.uint8) if samples.verdicts else None,
            ambient=np.full(count, np.nan),
        )
        for start in range(0, count, _PART):
            where = slice(start, min(start + _PART, count))
            raw = np.asarray(samples.values[:, where].T, np.float64)
            usable = np.isfinite(raw)
            weights = usable.astype(np.float64)
            if samples.weights is not None:
                weights *= samples.weights[:, where].T
            fit = SkyFit(state, np.where(usable, raw, 0.0), weights, gated=self.gate.shadow)
            fit.run()
            fit.write(found, where)
        return found
