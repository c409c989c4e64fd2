"""Exemplar materials fitted at places: each pixel has lamps of its own, and z of its own along its line of sight."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from psstereo.kernels.exemplar_lobes import lights_table
from psstereo.kernels.exemplar_terms import FAILED, SETTLED, Fit
from psstereo.lights import Directional, Rig
from psstereo.near.fit import SCALE, over_blocks
from psstereo.near.frames import eye_frames, turned
from psstereo.near.level import Level
from psstereo.near.pull import Places, exemplar_energy, exemplar_pull, part_of
from psstereo.normals.exemplar import Exemplar, ExemplarState
from psstereo.normals.reflectance_fit import IGNORED
from psstereo.types import BoolArray, FloatArray, IntArray, Map

__all__ = ["NOISE", "Exemplars", "blended", "exemplar_state", "fit_block", "fit_exemplars", "share_of"]

NOISE, _MANY = 2.0, 32.0
"""Evidence up to which Lambert's law is kept, and twice which the exemplars have it all; more with fewer lamps than
these. Half of it did better on metal, as well on plastic, and worse by a third on matte surfaces with noise [1]."""

_TELLING = 4000
"""Pixels from which the distance is told: far more than a common constant has numbers."""

_LEAST_ALBEDO = 1e-3
"""Least albedo that a pixel is given, as a share of all that it reflects; a metal has no matte part."""

_UNTOLD = 1.0
"""Variance of a normal that is no small error any more, so that no error bar can be told [rad²]."""


class Exemplars(NamedTuple):
    """What exemplar materials say at p pixels.

    Attributes
    ----------
    normal : float64 array (p, 3)
        Unit normals; NaN where nothing fits [1].
    albedo : float64 array (p,)
        Of the matte part, in the unit of the samples.
    share : float64 array (p,)
        Share that this fit is to have in the answer, 0 … 1 [1].
    uncertainty : float64 array (p,)
        Root-mean-square angle [rad].
    settled : bool array (p,)
        Whether the fit converged.
    used : int64 array (p,)
        Observations with a say.
    energy, pull, stiffness : float64 arrays (p,)
        As of :class:`psstereo.kernels.near.NearFit`; pull and stiffness of some pixels stand for all.
    """

    normal: FloatArray
    albedo: FloatArray
    share: FloatArray
    uncertainty: FloatArray
    settled: BoolArray
    used: IntArray
    energy: FloatArray
    pull: FloatArray
    stiffness: FloatArray


class _Block(NamedTuple):
    """What a job is given of some pixels, the first of them at `first`."""

    values: FloatArray
    first: int
    places: Places
    start: FloatArray
    scale: FloatArray


@dataclass(frozen=True, eq=False)
class _Job:
    """Fits one block; a class rather than a closure so that any executor can take it."""

    lamps: FloatArray
    state: ExemplarState
    noise: float
    stride: int

    def __call__(self, block: _Block) -> Exemplars:
        fit, values = fit_block(self.state, block.values, block.places, self.lamps, block.start)
        seen = block.places.lamps(self.lamps)
        d, p = self.state.dictionary, len(values)
        stands = fit.outcome < FAILED
        energy = exemplar_energy(fit, d, values, seen, block.scale)
        pull, stiffness = np.full(p, np.nan), np.full(p, np.nan)
        chosen = (block.first + np.arange(p)) % self.stride == 0 if self.stride else np.zeros(p, np.bool_)
        told = np.flatnonzero(stands & chosen)
        if len(told):
            some, there = part_of(fit, told), block.places.part(told)
            found = exemplar_pull(some, d, values[told], there, lamps=self.lamps, scale=block.scale[told])
            pull[told], stiffness[told] = (self.stride * one for one in found)
        albedo = np.maximum(fit.amounts @ self.state.matte, _LEAST_ALBEDO * np.maximum(fit.amounts.sum(axis=1), 0.0))
        with np.errstate(invalid="ignore"):
            used = (np.abs(fit.share) <= 1.0) & (np.abs(fit.share) >= IGNORED)
            variance = fit.spread[:, 0] + fit.spread[:, 2]
            uncertainty = np.sqrt(np.where(variance < _UNTOLD, variance, np.nan))
        share = np.where(stands & (albedo > 0), share_of(fit.evidence, values.shape[1], self.noise), 0.0)
        normal = turned(block.places.frames, fit.normal, back=True)
        settled, count = fit.outcome == SETTLED, used.sum(axis=1)
        return Exemplars(normal, albedo, share, uncertainty, settled, count, energy, pull, stiffness)


def exemplar_state(
    exemplars: Exemplar, directions: FloatArray, materials: FloatArray | None, work: float
) -> ExemplarState:
    """Return what all pixels share: the dictionary, the numbers of the fit, and the loop.

    Parameters
    ----------
    exemplars : Exemplar
        Numbers of the fit.
    directions : float64 array (m, 3)
        Of the lamps, seen from about the middle of the object [1].
    materials : float64 array (q, 12) or None
        Amounts of each lobe in the object's materials; every lobe for itself if absent [1].
    work : float
        Samples to be fitted in all, which tell whether compiled code pays [1].
    """
    rig = Rig(tuple(Directional(direction=one, strength=np.ones(1)) for one in directions))
    known = () if materials is None else tuple(tuple(float(a) for a in one) for one in materials)
    return replace(exemplars, shared=0, materials=known).prepare(rig, int(work / len(rig)))


def fit_block(
    state: ExemplarState, brightness: FloatArray, places: Places, lamps: FloatArray, start: FloatArray
) -> tuple[Fit, FloatArray]:
    """Fit some pixels.

    Parameters
    ----------
    state : ExemplarState
        What all pixels share.
    brightness : float64 array (m, p)
        Over the lamps' radiant intensities; NaN where not usable.
    places : Places
        Where the pixels are.
    lamps : float64 array (m, 7)
        Position, axis, exponent.
    start : float64 array (p, 3)
        Albedo times normal by Lambert's law; a pixel without one is not fitted.

    Returns
    -------
    Fit
        In the pixels' own frames.
    float64 array (p, m)
        Brightness over the lamps' strengths, NaN where not usable.
    """
    seen = places.lamps(lamps)
    values = seen.values(brightness)
    table = lights_table(seen.directions)
    begin = turned(places.frames, start)
    return state.fit(values, seen.weights, begin, table, state.dictionary, state.settings, state.sky), values


def fit_exemplars(
    level: Level,
    lamps: FloatArray,
    q: FloatArray,
    start: FloatArray,
    state: ExemplarState,
    *,
    pull: bool,
    noise: float = NOISE,
    channel: int | None = None,
    over: Map = map,
) -> Exemplars:
    """Fit every pixel of a level.

    Parameters
    ----------
    level : Level
        Samples and lines of sight.
    lamps : float64 array (m, 7)
        Position, axis, exponent.
    q : float64 array (p,)
        Where the surface is, see :class:`psstereo.near.view.View`.
    start : float64 array (p, 3)
        Albedo times normal by Lambert's law.
    state : ExemplarState
        What all pixels share.
    pull : bool
        Whether to tell what the distance should do.
    noise : float
        Evidence that chance brings about, see :func:`share_of` [1].
    channel : int, optional
        Which of the values to fit; their mean if absent.
    over : map-like
        Executes blocks.

    Returns
    -------
    Exemplars
        Of all pixels.
    """
    points = level.view.points(q)
    motion = level.view.motion(points)
    scale = SCALE * level.level

    def block(values: FloatArray, s: int, e: int) -> _Block:
        places = Places(points[s:e], motion[s:e], eye_frames(level.view.rays[s:e]))
        return _Block(values, s, places, start[s:e], scale[s:e])

    job = _Job(lamps, state, noise, max(1, len(level) // _TELLING) if pull else 0)
    parts = over_blocks(level, job, block, channel=channel, over=over)
    return Exemplars(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def share_of(evidence: FloatArray, lamps: int, noise: float = NOISE) -> FloatArray:
    """Return the share that exemplars are to have, from none to all without a kink.

    Parameters
    ----------
    evidence : float64 array (p,)
        See :class:`psstereo.kernels.exemplar_terms.Fit`; NaN speaks for Lambert's law [1].
    lamps : int
        How many there are.
    noise : float
        Evidence that chance brings about, and half of that which is beyond doubt [1].

    Returns
    -------
    float64 array (p,)
        Shares, 0 … 1 [1].
    """
    grown = np.clip(np.nan_to_num(evidence) / (noise * max(1.0, _MANY / lamps)) - 1.0, 0.0, 1.0)
    return np.asarray(grown * grown * (3.0 - 2.0 * grown))


def blended(scaled: FloatArray, found: Exemplars) -> FloatArray:
    """Return albedo times normal with the exemplars' share in direction and in length.

    Parameters
    ----------
    scaled : float64 array (p, 3)
        By Lambert's law.
    found : Exemplars
        Of the same pixels.

    Returns
    -------
    float64 array (p, 3)
        The mixture; that of Lambert's law where exemplars have no share.
    """
    taking = found.share > 0
    s, mine = found.share[taking, None], scaled[taking]
    length = np.sqrt((mine * mine).sum(axis=1, keepdims=True))
    direction = (1.0 - s) * mine / length + s * found.normal[taking]
    direction /= np.sqrt((direction * direction).sum(axis=1, keepdims=True))
    out = scaled.copy()
    out[taking] = direction * ((1.0 - s) * length + s * found.albedo[taking, None])
    return out
