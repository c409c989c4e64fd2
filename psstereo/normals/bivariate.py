"""Photometric stereo by the inverse of an isotropic reflectance, a monotone function of brightness and light height.

:mod:`psstereo.kernels.bivariate` has the steps and their reasons.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import OptionError
from psstereo.kernels.bipolynomial import FAILED, SETTLED, Fit
from psstereo.kernels.bivariate import Settings
from psstereo.kernels.dispatch import kernel
from psstereo.lights import Rig
from psstereo.normals.reflectance_fit import Told, as_rows, put
from psstereo.normals.robust import Robust, RobustState
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.types import FloatArray

__all__ = ["Bivariate", "BivariateState"]

_WORST_CONDITION = 1e4
"""Condition of the lights beyond which the robust solver's answer stands: the fit of the lobe forms normal equations,
whose safeguard of 1e-14 of the trace is then worth more than 1e-6."""
_BREAK_EVEN = 2e5
"""Samples from which compiled code is sooner done: 0.5 ms a pixel of 96 lights without it, 0.1 ms and 2 s with it."""

_LEAST = 16
"""Observations that are fitted at least."""

_HOLD = 8
"""Rounds in which the scale of the residuals follows the fit."""


@dataclass(frozen=True, eq=False)
class BivariateState:
    """What all pixels share.

    Attributes
    ----------
    robust : RobustState
        Of the solver that gives the start.
    directions : float64 array (m, 3)
        Unit vectors to the lights.
    heights : float64 array (m,)
        Their heights over the surface seen by the camera, 0 the lowest and 1 the highest.
    settings : Settings
        Numbers of the fit.
    fit : callable
        The hot loop, compiled or not.
    """

    robust: RobustState
    directions: FloatArray
    heights: FloatArray
    settings: Settings
    fit: Callable[..., Fit]


@dataclass(frozen=True, kw_only=True)
class Bivariate(NormalSolver[BivariateState]):
    """The inverse of an isotropic reflectance: n·l as a function of brightness and of the light's height [1]_.

    Seen from one place, an isotropic surface shows a brightness that depends on n·l and l·v alone. Its inverse is taken
    as a Bernstein polynomial in brightness that goes from one curve for the lowest light to another for the highest,
    rises with brightness and either rises or falls with height; normal and polynomial solve a convex quadratic
    programme. Against the publication, the brightest observations are left out, since among highlights a polynomial
    cannot follow, the increments are tied to Lambert's law, and Tukey's loss weighs what remains. Starts from the
    robust solver, which says what is lit, and keeps its answer where fewer than sixteen observations are.

    Noise in the brightness acts like a bent reflectance, so not for matte surfaces in noisy images. Not in concave
    places, nor for anisotropic surfaces such as brushed metal, nor where a highlight covers most lights. The view is
    along z at every pixel.

    Attributes
    ----------
    gate : Gate
        Whether saturated observations are left out; shadows always are.
    share : float
        Of the lit observations, from the darkest, that are fitted, but no fewer than sixteen [1].
    order : int
        Order of the polynomials in brightness, 1 … 8.
    ridge : float
        Tie of the increments to Lambert's law [1].
    noise_ridge : float
        The same, in units of the residuals' variance over the albedo's square [1].
    dark : float
        Share of the albedo, and cosine to the light, below which an observation is in shadow [1].
    rounds : int
        Most rounds in each of the two directions; a pixel that needs more is flagged.

    References
    ----------
    .. [1] S. Ikehata, K. Aizawa, "Photometric stereo using constrained bivariate regression for general isotropic
       surfaces", CVPR 2014
    """

    name: ClassVar[str] = "bivariate"
    summary: ClassVar[str] = "n·l as a rising function of brightness that the light's height bends, at each pixel"
    assumes: ClassVar[str] = "the reflectance is isotropic and, outside the highlight, brightness rises with n·l"
    avoid: ClassVar[str] = (
        "the images of a matte surface are noisy, or it is concave, or there are fewer than 24 lights"
    )
    sees_the_eye: ClassVar[bool] = True
    least_lights: ClassVar[int] = 20
    pays_from: ClassVar[int] = 24
    share: float = 0.6
    order: int = 5
    ridge: float = 1e-3
    noise_ridge: float = 10.0
    dark: float = 0.05
    rounds: int = 40

    def __post_init__(self) -> None:
        sound = (
            0 < self.share <= 1
            and 0 <= self.dark < 1
            and all(0 <= tie < np.inf for tie in (self.ridge, self.noise_ridge))
        )
        if not (sound and self.order in range(1, 9) and self.rounds > _HOLD):
            raise OptionError(
                given=f"The bivariate solver is given share {self.share}, order {self.order}, ridge {self.ridge}, "
                f"noise_ridge {self.noise_ridge}, dark {self.dark} and {self.rounds} rounds.",
                needed=f"A share in 0 … 1, an order of 1 to 8, ties that are not negative, dark below 1, and more than "
                f"{_HOLD} rounds.",
                remedy="Correct them, or leave them out.",
            )

    def prepare(self, rig: Rig, pixels: int | None = None) -> BivariateState:
        """Take the heights of all lights and choose the loop; see :meth:`NormalSolver.prepare`."""
        self.require_lights(rig)
        robust = Robust(gate=self.gate).prepare(rig, pixels)
        work = None if pixels is None else float(pixels) * len(rig)
        height = rig.directions[:, 2] - rig.directions[:, 2].min()
        return BivariateState(
            robust=robust,
            directions=np.ascontiguousarray(rig.directions, np.float64),
            heights=height / max(float(height.max()), 1e-9),
            settings=self._settings(),
            fit=kernel("bivariate", "fit_pixels", work, _BREAK_EVEN),
        )

    def solve(self, state: BivariateState, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        found = Robust(gate=self.gate).solve(state.robust, samples)
        if np.linalg.cond(state.directions) > _WORST_CONDITION:
            return found  # the fit squares the condition, see below
        fit = state.fit(*as_rows(samples), found.scaled, state.directions, state.heights, state.settings)
        settled, good = fit.outcome == SETTLED, fit.outcome < FAILED
        put(found, Told(fit.normal, fit.brightness, fit.spread, fit.share, settled, good))
        return found

    def _settings(self) -> Settings:
        return Settings(
            order=self.order,
            share=float(self.share),
            least=_LEAST,
            dark=float(self.dark),
            ridge=float(self.ridge),
            noise_ridge=float(self.noise_ridge),
            hold=_HOLD,
            rounds=self.rounds,
            tolerance=1e-5,
        )
