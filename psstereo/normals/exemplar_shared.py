"""Materials that a whole object is made of, found from some of its pixels.

One pixel's brightness leaves much freedom between its normal and its material; many pixels of the same material with
normals all around do not. So the exemplars are fitted at some pixels freely, then a few materials to all of these at
once, with the normals as found; and then every pixel is fitted again with these few in the place of all lobes.
"""

from dataclasses import replace

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.kernels.exemplar import FAILED, Fit
from psstereo.kernels.exemplar_lobes import CONSTANT, lobes
from psstereo.kernels.exemplar_nnls import nnls
from psstereo.lights import Rig
from psstereo.normals.exemplar import LOBES, Exemplar, fit_samples
from psstereo.normals.exemplar_search import usual_amounts
from psstereo.normals.solver import Samples
from psstereo.types import FloatArray, IntArray

__all__ = ["common_materials", "share_materials", "trusted"]

_ROUNDS = 20
"""Rounds between amounts and materials."""

_LEAST_FITTED = 50
"""Fitted pixels from which materials can be told."""

_TIE = 1e-6
"""Tie of every unknown, over the sum of weights."""


def share_materials(
    rig: Rig,
    samples: Samples,
    *,
    solver: Exemplar | None = None,
    materials: int = 2,
    pixels: int = 1500,
    whole: int | None = None,
) -> Exemplar:
    """Return the exemplar solver with a few materials of the object in the place of all lobes.

    Each pixel then shows a non-negative sum of the materials, so that albedo and gloss may still vary over it. Not for
    objects of very many materials, of which it takes those that most pixels are near to, and not where most pixels lie
    in shadow or in deep folds, whose fits say little.

    Parameters
    ----------
    rig : Rig
        The lights.
    samples : Samples
        Observations of the object's pixels, or of a fair part of them; some are taken at equal distances.
    solver : Exemplar, optional
        Whose other options are kept.
    materials : int
        How many, 1 to 6; two, as matte and gloss, serve most objects.
    pixels : int
        How many are looked at, 100 or more.
    whole : int, optional
        How many the object has in all, if not those given: where there are many, compiled code is loaded at once [1].

    Returns
    -------
    Exemplar
        The solver for this object.

    Raises
    ------
    OptionError
        If a number makes no sense.
    InputError
        If too few pixels can be fitted.
    """
    if not (1 <= materials <= 6 and pixels >= 100):
        raise OptionError(
            given=f"Asked for are {materials} materials from {pixels} pixels.",
            needed="One to six materials, and 100 pixels or more.",
            remedy="Two materials from 1500 pixels are the default.",
        )
    given = Exemplar() if solver is None else solver
    free = Exemplar(gate=given.gate, floor=given.floor, rounds=given.rounds, shared=0)
    count = samples.values.shape[1]
    chosen = np.unique(np.linspace(0, max(count - 1, 0), min(pixels, count)).astype(np.intp))
    weights = None if samples.weights is None else samples.weights[:, chosen]
    some = Samples(samples.values[:, chosen], weights)
    # Who is looked at is solved once more when the materials are known.
    state = free.prepare(rig, max(whole or 0, count + len(chosen)))
    # Amounts of lobes that look alike creep on when the normal stands already, and it is amounts that are wanted here.
    # Pixels are chosen by error bars of noise alone; a misfit is what the residuals' scale tells already.
    state = replace(state, settings=state.settings._replace(told=0.0, reach=0.0), sky=None)
    _, fit, at, _ = fit_samples(free, state, some)
    good = np.zeros(0, np.intp) if fit is None else trusted(fit)
    if fit is None or len(good) < _LEAST_FITTED:
        raise InputError(
            given=f"At {len(good)} of {len(chosen)} pixels the exemplars can be fitted.",
            needed=f"{_LEAST_FITTED} or more are needed to tell materials.",
            remedy="Use the solver exemplar without shared materials.",
        )
    d = state.dictionary
    columns = lobes(fit.normal[good], state.table, d.kinds, d.shapes)
    values, share = some.values[:, at[good]].T, np.abs(fit.share[good])
    found, totals = common_materials(values, share, columns, fit.amounts[good], materials)
    return replace(free, materials=tuple(tuple(float(a) for a in one) for one in found), usual=usual_amounts(totals))


def trusted(fit: Fit) -> IntArray:
    """Return the pixels whose fits stand, without the worse half: shadows and light from neighbours spoil those.

    Both small residuals and small error bars count, by their ranks; on metal either alone is deceived.

    Parameters
    ----------
    fit : Fit
        Of p pixels, with error bars by noise alone.

    Returns
    -------
    int array (k,)
        The better half, in order.
    """
    stands = np.flatnonzero(fit.outcome < FAILED)
    width = np.nan_to_num(fit.spread[stands, 0] + fit.spread[stands, 2], nan=np.inf)
    order = fit.scale[stands].argsort(kind="stable").argsort() + width.argsort(kind="stable").argsort()
    return np.sort(stands[order.argsort(kind="stable")[: (len(stands) + 1) // 2]])


def common_materials(
    values: FloatArray, share: FloatArray, columns: FloatArray, amounts: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return materials of which every pixel's brightness is a non-negative sum; all pixels count the same.

    Parameters
    ----------
    values : float64 array (p, m)
        Brightness.
    share : float64 array (p, m)
        Weight of each observation, 0 … 1; what is more or NaN takes no part [1].
    columns : float64 array (p, k, m)
        What each lobe shows.
    amounts : float64 array (p, k)
        Of the lobes, fitted freely [unit of the values].
    count : int
        How many materials.

    Returns
    -------
    materials : float64 array (q, k)
        Amounts of the lobes, 1 in sum; fewer than asked for where some come to nothing [1].
    totals : float64 array (p,)
        Sum of each pixel's amounts [unit of the values].
    """
    values = np.where(np.isfinite(values), values, np.nan)
    own = np.array([float(lobe.kind != CONSTANT) for lobe in LOBES])
    top = np.nanquantile(values, 0.95, axis=1)
    w = np.where(np.isfinite(values) & (share <= 1.0), share, 0.0)
    y = np.where(w > 0, values, 0.0) / top[:, None]
    start = _start(amounts * own / top[:, None], count)
    k = len(own)
    gram = np.einsum("pkm,pm,pjm->pkj", columns, w, columns, optimize=True)
    right = np.einsum("pkm,pm->pk", columns, w * y)
    mass = w.sum(axis=1)
    totals = np.zeros(len(y))
    for _ in range(_ROUNDS):
        a = start @ gram @ start.T + np.eye(count) * (_TIE * mass)[:, None, None]
        part = nnls(a, right @ start.T, 0, np.zeros((len(y), count)), mass)
        whole = np.einsum("pq,pr,pkj->qkrj", part, part, gram, optimize=True).reshape(count * k, count * k)
        totals = part @ start.sum(axis=1)
        whole += np.eye(count * k) * _TIE * mass.sum()
        held = np.tile(own == 0, count)
        whole[held], whole[:, held] = 0.0, 0.0
        whole[held, held] = 1.0
        target = np.where(held, 0.0, (part.T @ right).ravel())
        start = nnls(whole[None], target[None], 0, np.zeros((1, count * k)), mass.sum()[None])[0].reshape(count, k)
        start = start[start.max(axis=1) > 0]
        count = len(start)
        start /= start.sum(axis=1, keepdims=True)
    return start, totals * top


def _start(amounts: FloatArray, count: int) -> FloatArray:
    """Return amounts of pixels that are as unlike each other as can be, the first like the mean."""
    whole = amounts / np.maximum(amounts.sum(axis=1, keepdims=True), 1e-12)
    chosen = [whole.mean(axis=0)]
    while len(chosen) < count:
        far = np.min([((whole - one) ** 2).sum(axis=1) for one in chosen], axis=0)
        # Not the one that is farthest of all, which may be a stray.
        chosen.append(whole[int(np.argsort(far)[int(0.98 * (len(far) - 1))])])
    return np.array(chosen)
