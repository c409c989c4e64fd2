"""Photometric stereo with a bi-polynomial reflectance over the darker part of each pixel's observations.

:mod:`psstereo.kernels.bipolynomial` has the steps and their reasons.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import OptionError
from psstereo.kernels.bipolynomial import FAILED, SETTLED, Fit, Settings
from psstereo.kernels.dispatch import kernel
from psstereo.lights import Rig
from psstereo.normals.reflectance_fit import Told, as_rows, put
from psstereo.normals.robust import Robust, RobustState
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.types import FloatArray

__all__ = ["BiPolynomial", "BiPolynomialState"]

_BREAK_EVEN = 1e5
"""Samples from which compiled code is sooner done: 1 ms a pixel of 96 lights without it, 0.1 ms and 2 s with it."""

_MIDDLE, _UNIT = 0.8, 0.2
"""Cosine to the half vector about which the polynomial is taken, and the unit of its argument."""

_LEAST = 16
"""Observations that are fitted at least."""

_HOLD = 10
"""Rounds in which the scale of the residuals follows the fit."""


@dataclass(frozen=True, eq=False)
class BiPolynomialState:
    """What all pixels share.

    Attributes
    ----------
    robust : RobustState
        Of the solver that gives the start.
    geometry, powers : float64 arrays (m, 7), (m, degree + 1)
        Of each light; see :func:`psstereo.kernels.bipolynomial.fit_pixels`.
    settings : Settings
        Numbers of the fit.
    fit : callable
        The hot loop, compiled or not.
    """

    robust: RobustState
    geometry: FloatArray
    powers: FloatArray
    settings: Settings
    fit: Callable[..., Fit]


@dataclass(frozen=True, kw_only=True)
class BiPolynomial(NormalSolver[BiPolynomialState]):
    """An isotropic reflectance, polynomial in two angles, fitted to the darker part of the lit observations [1]_.

    The reflectance is ``Σ c_jk (n·h)^j (l·h)^k`` with h half way between light and view; coefficients and normal are
    found together at each pixel. Among the darkest lit observations the highlight is absent and what remains of it is
    smooth. Starts from the robust solver and keeps its answer where fewer than sixteen observations are lit or the fit
    fails. What the ties to Lambert's law cost and which share is looked at were chosen on synthetic materials and
    several captures together.

    Looking at a third of the observations doubles the effect of noise, so not for matte surfaces. Not in concave
    places, whose light from neighbours is taken for reflectance, nor for anisotropic surfaces such as brushed metal.
    The view is along z at every pixel.

    Attributes
    ----------
    gate : Gate
        Whether saturated observations are left out; shadows always are.
    share : float
        Of the lit observations, from the darkest, that are fitted, but no fewer than sixteen [1].
    degree : int
        Highest power of either angle, 1 … 3.
    ridge : float
        Tie of the coefficients to Lambert's law [1].
    noise_ridge : float
        The same, in units of the residuals' variance over the albedo's square [1].
    dark : float
        Share of the albedo, and cosine to the light, below which an observation is in shadow [1].
    rounds : int
        Most rounds; a pixel that needs more is flagged.

    References
    ----------
    .. [1] B. Shi, P. Tan, Y. Matsushita, K. Ikeuchi, "Bi-Polynomial Modeling of Low-Frequency Reflectances", IEEE
       TPAMI 36(6), 2014. doi:10.1109/TPAMI.2013.196
    """

    name: ClassVar[str] = "bi-polynomial"
    summary: ClassVar[str] = "a smooth isotropic reflectance fitted to the darker part of each pixel's observations"
    assumes: ClassVar[str] = "the reflectance is isotropic, and smooth away from the highlight"
    avoid: ClassVar[str] = "the surface is matte, concave or brushed, or there are fewer than 24 lights"
    sees_the_eye: ClassVar[bool] = True
    least_lights: ClassVar[int] = 20
    pays_from: ClassVar[int] = 24
    share: float = 0.35
    degree: int = 2
    ridge: float = 1e-3
    noise_ridge: float = 30.0
    dark: float = 0.05
    rounds: int = 60

    def __post_init__(self) -> None:
        sound = (
            0 < self.share <= 1
            and 0 <= self.dark < 1
            and all(0 <= tie < np.inf for tie in (self.ridge, self.noise_ridge))
        )
        if not (sound and self.degree in (1, 2, 3) and self.rounds > _HOLD):
            raise OptionError(
                given=f"The bi-polynomial solver is given share {self.share}, degree {self.degree}, ridge "
                f"{self.ridge}, noise_ridge {self.noise_ridge}, dark {self.dark} and {self.rounds} rounds.",
                needed=f"A share in 0 … 1, a degree of 1 to 3, ties that are not negative, dark below 1, and more than "
                f"{_HOLD} rounds.",
                remedy="Correct them, or leave them out.",
            )

    def prepare(self, rig: Rig, pixels: int | None = None) -> BiPolynomialState:
        """Take the angles of all lights and choose the loop; see :meth:`NormalSolver.prepare`."""
        self.require_lights(rig)
        robust = Robust(gate=self.gate).prepare(rig, pixels)
        work = None if pixels is None else float(pixels) * len(rig)
        directions = rig.directions
        half = directions + np.array([0.0, 0.0, 1.0])
        half = half / np.maximum(np.sqrt((half * half).sum(axis=1, keepdims=True)), 1e-9)
        height = half[:, 2] - half[:, 2].mean()
        height = height / max(float(np.abs(height).max()), 1e-9)
        middle = np.full((len(rig), 1), _MIDDLE / _UNIT)
        return BiPolynomialState(
            robust=robust,
            geometry=np.concatenate([directions, half / _UNIT, middle], axis=1),
            powers=height[:, None] ** np.arange(self.degree + 1.0),
            settings=self._settings(),
            fit=kernel("bipolynomial", "fit_pixels", work, _BREAK_EVEN),
        )

    def solve(self, state: BiPolynomialState, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        found = Robust(gate=self.gate).solve(state.robust, samples)
        fit = state.fit(*as_rows(samples), found.scaled, state.geometry, state.powers, state.settings)
        settled, good = fit.outcome == SETTLED, fit.outcome < FAILED
        put(found, Told(fit.normal, fit.brightness, fit.spread, fit.share, settled, good))
        return found

    def _settings(self) -> Settings:
        return Settings(
            share=float(self.share),
            least=_LEAST,
            dark=float(self.dark),
            ridge=float(self.ridge),
            noise_ridge=float(self.noise_ridge),
            hold=_HOLD,
            rounds=self.rounds,
            tolerance=1e-5,
        )
