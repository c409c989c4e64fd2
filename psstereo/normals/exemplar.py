"""Photometric stereo on any opaque surface: its brightness is a sum of what exemplar materials would show.

:mod:`psstereo.kernels.exemplar` has the steps and their reasons. Where the residuals of Lambert's law are noise the
answer is that of the robust solver.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.kernels.bipolynomial import tangents as other_tangents
from psstereo.kernels.dispatch import kernel
from psstereo.kernels.exemplar import FAILED, SETTLED, Dictionary, Fit, Settings
from psstereo.kernels.exemplar_lobes import (
    BELL,
    CONSTANT,
    FACETED,
    GGX,
    GLAZE,
    LAMBERT,
    POWER,
    ROUGH,
    lights_table,
    tangents,
)
from psstereo.kernels.misfit import Sky, sky_of
from psstereo.kernels.response_bend import BendFit
from psstereo.lights import Rig
from psstereo.normals.exemplar_search import Widening, candidates, widen
from psstereo.normals.parts import some
from psstereo.normals.reflectance_fit import Told, as_rows, put
from psstereo.normals.response_bend import ResponseBend, ResponseBendState
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.types import FloatArray, IntArray

__all__ = ["LOBES", "Exemplar", "ExemplarState", "Lobe", "fit_samples"]

_BREAK_EVEN = 4.5e4
"""Samples from which compiled code is sooner done: 0.8 ms a pixel of 48 lights without it, 0.05 and 0.7 s with it."""

_DEFAULT = Settings()

_NOISE, _MANY = 4.0, 32.0
"""Evidence up to which Lambert's law is kept, and twice which the exemplars have it all; less by up to as much where
residuals go with the direction of the light, and more with fewer lights than these [1]."""

_UNTOLD = 1.0
"""Variance of a normal that is no small error any more, so that no error bar can be told [rad²]."""

_PUPILS = 1500
"""Pixels from which an object's materials are told: far more than a few materials of twelve lobes have numbers."""

_LEAST_ALBEDO = 1e-3
"""Least albedo that a pixel is given, as a share of all that it reflects; a metal has no matte part."""


@dataclass(frozen=True, kw_only=True)
class Lobe:
    """One reflectance of the dictionary.

    Attributes
    ----------
    name : str
        What it is called in a map of materials.
    kind : int
        See :mod:`psstereo.kernels.exemplar_lobes`.
    shape : float
        Its parameter, 0 if it has none [1].
    tie : float
        Weight of its squared amount, against a squared residual with the pixel's top brightness for one [1].
    noise_tie : float
        The same in units of the squared scale of the residuals [1].
    matte : bool
        Whether its amount counts as albedo.
    """

    name: str
    kind: int
    shape: float = 0.0
    tie: float = 0.0
    noise_tie: float = 0.0
    matte: bool = True


LOBES: tuple[Lobe, ...] = (
    Lobe(name="lambert", kind=LAMBERT),
    Lobe(name="glazed", kind=GLAZE),
    Lobe(name="rough", kind=ROUGH, shape=1.0),
    Lobe(name="faceted", kind=FACETED, shape=0.6, noise_tie=0.3),
    Lobe(name="falling", kind=POWER, shape=2.0, noise_tie=1.0),
    Lobe(name="gloss-0.1", kind=GGX, shape=0.1, matte=False),
    Lobe(name="gloss-0.25", kind=GGX, shape=0.25, matte=False),
    Lobe(name="gloss-0.6", kind=GGX, shape=0.6, matte=False),
    Lobe(name="bell-0.15", kind=BELL, shape=0.15, matte=False),
    Lobe(name="bell-0.3", kind=BELL, shape=0.3, noise_tie=1.0, matte=False),
    Lobe(name="bell-0.45", kind=BELL, shape=0.45, noise_tie=1.0, matte=False),
    Lobe(name="surroundings", kind=CONSTANT, tie=1e-2, matte=False),
)
"""The dictionary: matte bodies, microfacets whose slopes have long tails or none, and light from the surroundings."""


@dataclass(frozen=True, eq=False)
class ExemplarState:
    """What all pixels share.

    Attributes
    ----------
    simple : ResponseBendState
        Of the solver that gives the start, and says where Lambert's law will do.
    table : float64 array (7, m)
        The lights.
    dictionary : Dictionary
        The exemplars.
    matte : float64 array (q,)
        What one of each exemplar adds to the albedo [1].
    settings : Settings
        Numbers of the fit.
    fit : callable
        The hot loop, compiled or not.
    wide : Widening or None
        Other starts for pixels that are fitted badly; None where every pixel has materials of its own.
    sky : Sky or None
        How misfits at the lights hang together, for error bars that know model error; None for those by noise alone.
    """

    simple: ResponseBendState
    table: FloatArray
    dictionary: Dictionary
    matte: FloatArray
    settings: Settings
    fit: Callable[..., Fit]
    wide: Widening | None
    sky: Sky | None


@dataclass(frozen=True, kw_only=True)
class Exemplar(NormalSolver[ExemplarState]):
    """A non-negative sum of exemplar reflectances, fitted together with the normal, robustly, at every pixel.

    The dictionary holds Lambert's law, matte bodies under a glaze and of rough material, a body that darkens faster
    than the cosine, microfacets of six kinds, and a constant for light from the surroundings (`LOBES`). It is
    the idea of [1]_ with formulas in the place of measured materials, a search by steps in the place of a list of
    candidates, and a robust loss. Where a robust Lambertian fit leaves nothing but noise, its normal stands, so that
    matte surfaces lose nothing. Lobes, ties and limits were chosen on path-traced
    scenes of many materials. With a hundred lights it takes a pixel some six times as long as the solver response-bend.

    A pixel with fewer than twelve observations in light gets the answer of the solver response-bend, and with fewer
    than sixteen lights in all it refuses. Not for brushed metal, hair or cloth, whose reflectance turns with the
    surface; not for sharp metal under few lights, of which most pixels catch no highlight. The view is along z at every
    pixel. The albedo is that of the matte part.

    Attributes
    ----------
    gate : Gate
        Whether saturated observations are left out; shadows always are.
    floor : float
        Residual below which all observations count the same, as a share of the pixel's brightness [1].
    rounds : int
        Rounds at most; a pixel that needs more is flagged.
    shared : int
        Materials that are found from pixels all over the object and stand for the lobes in each, 0 for none; gloss and
        albedo still vary. Two, as matte and gloss, serve most objects; 0 where many different materials meet.

    materials : tuple of tuple of float (q, 12)
        Amounts of each of `LOBES` in the materials of one object, as :func:`share_materials` finds them; empty until
        then, and where `shared` is 0 [1].
    usual : tuple of float
        Mean of the logarithm of the sum of these amounts over the object, and its standard deviation, by which answers
        of pixels that are fitted badly are told apart; empty if it is not known [1].

    References
    ----------
    .. [1] Z. Hui, A. C. Sankaranarayanan, "Shape and Spatially-Varying Reflectance Estimation from Virtual Exemplars",
       IEEE TPAMI 39(10), 2017. doi:10.1109/TPAMI.2016.2623613
    """

    name: ClassVar[str] = "exemplar"
    summary: ClassVar[str] = "a sum of exemplar materials, matte and glossy, fitted robustly with the normal"
    assumes: ClassVar[str] = "the reflectance is isotropic and near a sum of the dictionary's"
    avoid: ClassVar[str] = "the surface is brushed or woven, or there are fewer than 16 lights"
    sees_the_eye: ClassVar[bool] = True
    least_lights: ClassVar[int] = 16
    pays_from: ClassVar[int] = 16
    floor: float = _DEFAULT.floor
    rounds: int = _DEFAULT.rounds
    shared: int = 2
    materials: tuple[tuple[float, ...], ...] = ()
    usual: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (0 < self.floor < 1 and self.rounds > _DEFAULT.freeze and 0 <= self.shared <= 6):
            raise OptionError(
                given=f"The exemplar solver is given the floor {self.floor}, {self.rounds} rounds and {self.shared} "
                "shared materials.",
                needed=f"A floor between 0 and 1, more than {_DEFAULT.freeze} rounds, and up to six materials.",
                remedy="Correct them, or leave them out.",
            )
        fits = all(len(one) == len(LOBES) and all(0 <= a < np.inf for a in one) for one in self.materials)
        if not (fits and all(max(one) > 0 for one in self.materials)):
            raise OptionError(
                given=f"The exemplar solver is given {len(self.materials)} materials with "
                f"{sorted({len(one) for one in self.materials})} amounts.",
                needed=f"{len(LOBES)} amounts each, one a lobe, finite, not negative, some above 0.",
                remedy="Take them from share_materials, or give none.",
            )
        known = len(self.usual) == 2 and bool(self.materials) and bool(np.isfinite(self.usual).all())
        if self.usual and not (known and self.usual[1] > 0):
            raise OptionError(
                given=f"The exemplar solver is given {self.usual} as usual amounts of {len(self.materials)} materials.",
                needed="The mean of a logarithm and its standard deviation above 0, finite, and materials.",
                remedy="Take both from share_materials, or give none.",
            )

    @property
    def learns_from(self) -> int:
        """Pixels from which materials are told; see :attr:`NormalSolver.learns_from`."""
        return _PUPILS if self.shared and not self.materials else 0

    def taught(self, rig: Rig, samples: Samples, pixels: int | None = None) -> tuple[NormalSolver[Any], str]:
        """Find the object's materials; see :meth:`NormalSolver.taught`.

        Parameters
        ----------
        rig : Rig
            The lights.
        samples : Samples
            Observations of some of the object's pixels, from all over it.
        pixels : int, optional
            How many it has in all: where there are many, compiled code is loaded at once [1].
        """
        from psstereo.normals.exemplar_shared import share_materials

        self.require_lights(rig)
        try:
            solver = share_materials(rig, samples, solver=self, materials=self.shared, whole=pixels)
        except InputError as error:
            return self, f"Every pixel has materials of its own: {error.given}"
        return solver, f"{len(solver.materials)} materials were found and stand for the lobes in every pixel."

    def prepare(self, rig: Rig, pixels: int | None = None) -> ExemplarState:
        """Take the angles of all lights and choose the loop; see :meth:`NormalSolver.prepare`."""
        self.require_lights(rig)
        work = None if pixels is None else float(pixels) * len(rig)
        dictionary, settings = self._dictionary(), Settings(floor=float(self.floor), rounds=self.rounds)
        table, sky = lights_table(rig.directions), sky_of(rig.directions)
        fit = kernel("exemplar", "fit_pixels", work, _BREAK_EVEN)
        wide = None
        if self.materials:
            usual, width = self.usual or (0.0, np.inf)
            search = kernel("exemplar_search", "search", work, _BREAK_EVEN)
            normals = candidates(table, dictionary, settings)
            wide = Widening(normals, usual, width, table, dictionary, settings, sky, fit, search)
        matte = np.array([float(lobe.matte) for lobe in LOBES])
        return ExemplarState(
            simple=ResponseBend(gate=self.gate).prepare(rig, pixels),
            table=table,
            dictionary=dictionary,
            matte=dictionary.mix @ matte if dictionary.mix.size else matte,
            settings=settings,
            fit=fit,
            wide=wide,
            sky=sky,
        )

    def solve(self, state: ExemplarState, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        found, fit, chosen, share = fit_samples(self, state, samples)
        if fit is None:
            return found
        total = np.maximum(fit.amounts.sum(axis=1), 0.0)
        albedo = np.maximum(fit.amounts @ state.matte, _LEAST_ALBEDO * total)
        good = (fit.outcome < FAILED) & (albedo > 0)
        told = Told(fit.normal, albedo, _turned(fit), fit.share, fit.outcome == SETTLED, good)
        part = _picked(found, chosen)
        put(part, told)
        _blend(found, part, chosen, np.where(good, share, 0.0))
        return found

    def _dictionary(self) -> Dictionary:
        ties, noise_ties = [lobe.tie for lobe in LOBES], [lobe.noise_tie for lobe in LOBES]
        mix, known = np.zeros((0, 0)), self.materials
        if known:
            mix = np.vstack([np.array(known, np.float64), np.eye(len(LOBES))[-1]])
            ties = [0.0] * len(known) + ties[-1:]
            noise_ties = [0.0] * len(known) + noise_ties[-1:]
        return Dictionary(
            kinds=np.array([lobe.kind for lobe in LOBES], np.int64),
            shapes=np.array([lobe.shape for lobe in LOBES], np.float64),
            mix=mix,
            ties=np.array(ties, np.float64),
            noise_ties=np.array(noise_ties, np.float64),
        )


def fit_samples(
    solver: Exemplar, state: ExemplarState, samples: Samples
) -> tuple[PixelNormals, Fit | None, IntArray, FloatArray]:
    """Fit pixels, and weigh the fit against the simpler solver's.

    The exemplars have a share where the robust fit's residuals go with the direction of the light, which is what the
    solver response-bend looks at, or where the exemplars explain much that Lambert's law does not.

    Parameters
    ----------
    solver : Exemplar
        The method.
    state : ExemplarState
        What it prepared.
    samples : Samples
        Observations of p pixels.

    Returns
    -------
    found : PixelNormals
        The simpler solver's answer at all pixels.
    fit : Fit or None
        Of the pixels that have a start; None if there are none.
    chosen : int array (k,)
        These pixels.
    share : float array (k,)
        Share that their fit is to have in the answer, 0 … 1 [1].
    """
    kept: list[BendFit] = []

    def heard(*inputs: object) -> BendFit:
        kept.append(state.simple.fit(*inputs))
        return kept[0]

    found = ResponseBend(gate=solver.gate).solve(replace(state.simple, fit=heard), samples)
    chosen = np.flatnonzero(np.isfinite(found.scaled[:, 0]))
    if len(chosen) == 0:
        return found, None, chosen, np.zeros(0)
    values, weights = as_rows(some(samples, chosen))
    fit = state.fit(values, weights, found.scaled[chosen], state.table, state.dictionary, state.settings, state.sky)
    if state.wide is not None and state.table.ndim == 2:
        widen(state.wide, values, weights, found.scaled[chosen], fit)
    with np.errstate(invalid="ignore"):
        grown = np.clip(
            fit.evidence / (_NOISE * max(1.0, _MANY / len(samples.values))) - (1.0 - kept[0].share[chosen]), 0.0, 1.0
        )
    return found, fit, chosen, grown * grown * (3.0 - 2.0 * grown)


def _turned(fit: Fit) -> FloatArray:
    """Return the covariance along the tangents by which the other reflectance fits tell it, (p, 3)."""
    turn = other_tangents(fit.normal) @ tangents(fit.normal).transpose(0, 2, 1)
    whole = fit.spread[:, [[0, 1], [1, 2]]]
    turned = turn @ whole @ turn.transpose(0, 2, 1)
    told = np.stack([turned[:, 0, 0], turned[:, 0, 1], turned[:, 1, 1]], axis=1)
    with np.errstate(invalid="ignore"):
        told[~(told[:, 0] + told[:, 2] < _UNTOLD)] = np.nan
    return told


def _picked(found: PixelNormals, pixels: IntArray) -> PixelNormals:
    """Return copies of some pixels' answers."""
    return PixelNormals(
        scaled=found.scaled[pixels],
        uncertainty=found.uncertainty[pixels],
        flags=found.flags[pixels],
        used=found.used[pixels],
        covariance=None if found.covariance is None else found.covariance[pixels],
        verdicts=None if found.verdicts is None else found.verdicts[:, pixels],
    )


def _blend(found: PixelNormals, part: PixelNormals, pixels: IntArray, share: FloatArray) -> None:
    """Give the fit its share in the answer, in place."""
    taking = share > 0
    at, s = pixels[taking], share[taking]
    found.scaled[at] = (1.0 - s)[:, None] * found.scaled[at] + s[:, None] * part.scaled[taking]
    # However the two errors hang together, their mean spreads no more than this.
    spread = (1.0 - s) * found.uncertainty[at] ** 2 + s * part.uncertainty[taking] ** 2
    found.uncertainty[at] = np.sqrt(np.where(s == 1, part.uncertainty[taking] ** 2, spread))
    found.flags[at] = part.flags[taking]
    found.used[at] = part.used[taking]
    if found.covariance is not None and part.covariance is not None:
        mixed = (1.0 - s)[:, None] * found.covariance[at] + s[:, None] * part.covariance[taking]
        found.covariance[at] = np.where((s == 1)[:, None], part.covariance[taking], mixed)
    if found.verdicts is not None and part.verdicts is not None:
        most = np.flatnonzero(share >= 0.5)
        found.verdicts[:, pixels[most]] = part.verdicts[:, most]
