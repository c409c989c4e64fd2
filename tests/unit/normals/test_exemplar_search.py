"""Other starts for badly fitted pixels: metal under a Lambertian start, and what stays as it is."""

import numpy as np
import pytest

from psstereo.errors import OptionError
from psstereo.kernels.exemplar import FAILED, SETTLED
from psstereo.kernels.exemplar_lobes import lobes
from psstereo.lights import Rig
from psstereo.normals.exemplar import LOBES, Exemplar
from psstereo.normals.exemplar_search import _hedge, usual_amounts, widen
from psstereo.normals.exemplar_shared import share_materials
from psstereo.normals.solver import Samples
from psstereo_synth import spiral

DIRECTIONS = spiral(60, max_tilt=0.9)
RIG = Rig.distant(DIRECTIONS)
METAL = tuple(1.0 if lobe.name == "bell-0.3" else 0.0 for lobe in LOBES)
MATTE = tuple(1.0 if lobe.name == "lambert" else 0.0 for lobe in LOBES)
SOLVER = Exemplar(shared=0, materials=(METAL, MATTE), usual=(0.0, 0.1))
STATE = SOLVER.prepare(RIG)


def metal(count=30, seed=0, noise=0.05, tilt=0.35):
    """Metal that lets a tenth of the light through to its shadows, (normals, values (p, m))."""
    rng = np.random.default_rng(seed)
    normals = np.column_stack([rng.normal(0, tilt, (count, 2)), np.ones(count)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    d = STATE.dictionary
    values = np.einsum("q,pqm->pm", [1.0, 0.02, 0.01], d.mix @ lobes(normals, STATE.table, d.kinds, d.shapes))
    values *= np.exp(noise * rng.normal(size=values.shape))
    values[rng.random(values.shape) < 0.1] *= 0.1
    return normals, values


def angle(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))


def fitted(values, start, **settings):
    none = np.zeros((0, 0))
    fit = STATE.fit(values, none, start, STATE.table, STATE.dictionary, STATE.settings._replace(**settings))
    return fit, none


def test_a_metal_is_found_from_a_wrong_start():
    normals, values = metal(200, tilt=0.5)
    wrong = np.column_stack([-normals[:, :2] * 1.5 + 0.6, normals[:, 2]])
    fit, none = fitted(values, wrong)  # the kernel's own second start finds most
    before = angle(fit.normal, normals)
    widen(STATE.wide, values, none, wrong, fit)
    after = angle(fit.normal, normals)
    assert np.quantile(before, 0.9) > 8.0
    assert np.quantile(after, 0.9) < 6.0
    assert np.count_nonzero(after > 5.0) < 0.8 * np.count_nonzero(before > 5.0)
    assert np.isfinite(fit.evidence).all()
    some = fit.share[np.isfinite(fit.share)]
    assert ((np.abs(some) <= 1) | (some == 3)).all()


def test_evidence_is_by_the_answer_that_is_kept():
    normals, values = metal(8)
    start = normals * np.quantile(values, 0.9, axis=1)[:, None]
    fit, none = fitted(values, start)
    fit.outcome[:] = FAILED
    widen(STATE.wide, values, none, start, fit)
    d = STATE.dictionary
    shown = np.einsum("pq,pqm->pm", fit.amounts, d.mix @ lobes(fit.normal, STATE.table, d.kinds, d.shapes))
    top = np.sort(values, axis=1)[:, [56]]  # rank 0.95 of 60
    doubt = []
    for r in (values - np.maximum(start @ DIRECTIONS.T, 0.0), values - shown):
        square = (r / top / fit.scale[:, None]) ** 2
        doubt.append(np.where(values > 0.02 * top, square / (1.0 + square), 0.0).sum(axis=1))
    np.testing.assert_allclose(fit.evidence, doubt[0] - doubt[1], rtol=1e-9, atol=1e-9)


def test_good_fits_stay():
    normals, _ = metal()
    d = STATE.dictionary
    values = (d.mix @ lobes(normals, STATE.table, d.kinds, d.shapes))[:, 0]
    fit, none = fitted(values, normals)
    kept = [part.copy() for part in fit]
    widen(STATE.wide, values, none, normals, fit)
    for mine, its in zip(fit, kept, strict=True):
        np.testing.assert_array_equal(mine, its)


def test_pixels_without_light_stay_without_an_answer():
    _, values = metal(4)
    values[0], values[1, 5:], values[2] = np.nan, np.nan, 0.0
    fit, none = fitted(values, np.tile([0.1, 0.2, 0.9], (4, 1)))
    widen(STATE.wide, values, none, np.tile([0.1, 0.2, 0.9], (4, 1)), fit)
    assert np.isnan(fit.normal[:3]).all()
    assert np.isfinite(fit.normal[3]).all()


def test_two_answers_as_good_are_told_by_the_error_bar():
    normals, values = metal(3)
    fit, _ = fitted(values, normals)
    fit.outcome[:] = SETTLED
    before = fit.spread.copy()
    tilted = fit.normal + np.array([0.3, 0.0, 0.0])
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    _hedge(fit, np.arange(3), np.stack([fit.normal, tilted]), np.array([[0.0, 0.0, 0.0], [0.05, 0.5, np.inf]]))
    grown = 0.25 * np.radians(angle(fit.normal, tilted)) ** 2
    np.testing.assert_allclose(fit.spread[0, [0, 2]], before[0, [0, 2]] + grown[0], rtol=1e-9)
    np.testing.assert_array_equal(fit.spread[1:], before[1:])
    assert (fit.outcome == SETTLED).all()


def test_usual_amounts_are_robust():
    rng = np.random.default_rng(4)
    totals = np.exp(0.5 + 0.3 * rng.normal(size=4001))
    totals[:400] = 0.0
    mean, width = usual_amounts(totals)
    assert mean == pytest.approx(0.5, abs=0.07)
    assert width == pytest.approx(0.3, rel=0.25)
    assert usual_amounts(np.ones(50)) == (0.0, 0.1)


def test_a_metal_object_tells_its_usual_amounts():
    normals, values = metal(300, seed=2)
    taught = share_materials(RIG, Samples(2.0 * values.T), materials=2, pixels=200)
    gloss = [sum(a for a, lobe in zip(one, LOBES, strict=True) if not lobe.matte) for one in taught.materials]
    assert max(gloss) > 0.8
    assert taught.usual[0] == pytest.approx(np.log(2.0), abs=0.3)
    found = taught.solve(taught.prepare(RIG, 10**6), Samples(2.0 * values.T)).scaled
    assert np.median(angle(found, normals)) < 2.0


@pytest.mark.parametrize("usual", [(1.0,), (0.0, 0.0), (np.nan, 1.0), (0.0, -1.0), (0.0, np.inf)])
def test_hostile_usual_amounts_are_refused(usual):
    with pytest.raises(OptionError, match="usual amounts"):
        Exemplar(materials=(METAL,), usual=usual)
    with pytest.raises(OptionError, match="usual amounts"):
        Exemplar(usual=(0.0, 1.0))
