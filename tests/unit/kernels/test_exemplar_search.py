"""The wider search of the exemplar solver, its twin, and the gloss of Gaussian facets that metals need."""

import numpy as np
import pytest
from scipy.optimize import nnls as reference_nnls

from psstereo.kernels import exemplar_search, exemplar_search_compiled, exemplar_steps_compiled
from psstereo.kernels.exemplar import Dictionary, Settings
from psstereo.kernels.exemplar_lobes import BELL, CONSTANT, GGX, LAMBERT, lights_table, lobes, slopes, tangents
from psstereo.kernels.exemplar_search import SearchSettings
from psstereo.normals.exemplar_search import candidates
from psstereo_synth import spiral

DIRECTIONS = spiral(50, max_tilt=np.radians(55))
TABLE = lights_table(DIRECTIONS)
KINDS, SHAPES = np.array([LAMBERT, GGX, BELL, CONSTANT]), np.array([0.0, 0.25, 0.3, 0.0])
MIX = np.array([[0.05, 0.0, 0.95, 0.0], [0.8, 0.2, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
DICTIONARY = Dictionary(KINDS, SHAPES, MIX, np.array([0.0, 0.0, 1e-2]), np.zeros(3))
CANDIDATES = candidates(TABLE, DICTIONARY, Settings())
TWINS = (exemplar_search.search, exemplar_search_compiled.search)


def pixels(count=24, seed=0):
    """Metal with faults: brightness over the top, weights, the logarithm of the usual amounts, normals."""
    rng = np.random.default_rng(seed)
    normals = np.column_stack([rng.normal(0, 0.3, (count, 2)), np.ones(count)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    values = np.einsum("q,pqm->pm", [1.0, 0.1, 0.01], MIX @ lobes(normals, TABLE, KINDS, SHAPES))
    values[rng.random(values.shape) < 0.1] = 0.0
    top = np.quantile(values, 0.95, axis=1)
    y = values / top[:, None]
    return y, (y > 0.02) * 1.0, np.log(1.1) - np.log(top), normals


def angle(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))


def test_the_bell_is_the_distribution_of_gaussian_slopes():
    """The mean over slopes of facets: D cos⁴ is the density of two Gaussian slopes of variance α² / 2."""
    turned = np.radians(np.linspace(0.0, 60.0, 7))
    light = np.stack([np.zeros(7), np.sin(2 * turned), np.cos(2 * turned)], axis=1)  # half vectors at these angles
    upright = np.array([[0.0, 0.0, 1.0]])
    bell, ggx = lobes(upright, lights_table(light), np.array([BELL, GGX]), np.array([0.3, 0.3]))[0]
    density = np.exp(-(np.tan(turned) ** 2) / 0.09) / np.cos(turned) ** 4
    facets = (0.09 / (1.0 - 0.91 * np.cos(turned) ** 2)) ** 2
    seen = np.cos(2 * turned) > 0
    np.testing.assert_allclose(bell[seen] * facets[seen], ggx[seen] * density[seen], rtol=1e-12)
    assert bell[0] == pytest.approx(1.0, abs=1e-14)
    assert (bell[~seen] == 0).all()


def test_its_slopes_are_its_differences_and_the_compiled_twin_agrees():
    rng = np.random.default_rng(1)
    normals = np.column_stack([rng.normal(0, 0.6, (12, 2)), np.ones(12)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    amounts = rng.uniform(0.1, 1.0, (12, 4))
    across, by = tangents(normals), slopes(normals, TABLE, KINDS, SHAPES, amounts)
    told = (across @ TABLE[:3]) * by[:, :1] + (across @ TABLE[3:6]) * by[:, 1:2] + across[:, :, 2:] * by[:, 2:]
    for e in range(2):
        ends = [lobes(normals + h * across[:, e], TABLE, KINDS, SHAPES) for h in (1e-6, -1e-6)]
        change = np.einsum("pk,pkm->pm", amounts, ends[0] - ends[1]) / 2e-6
        clear = np.abs(normals @ DIRECTIONS.T) > 1e-4
        np.testing.assert_allclose(told[:, e][clear], change[clear], rtol=1e-5, atol=1e-7)
    out, turned = np.zeros((4, 50)), np.zeros((3, 50))
    for n, a, shown, slope in zip(normals, amounts, lobes(normals, TABLE, KINDS, SHAPES), by, strict=True):
        exemplar_steps_compiled.fill_lobes(
            n, TABLE, KINDS, SHAPES, np.zeros((0, 0)), a, np.zeros(50), np.zeros(50), out, turned
        )
        np.testing.assert_allclose(out, shown, rtol=1e-11, atol=1e-14)
        np.testing.assert_allclose(turned, slope, rtol=1e-10, atol=1e-12)


def test_the_bell_stays_finite_at_the_edge():
    sideways = np.array([[1.0, 0.0, 1e-9], [0.0, -1.0, 0.0], [0.6, 0.0, -0.8]])
    kinds, sharp = np.array([BELL]), np.array([0.01])
    assert np.isfinite(lobes(sideways, TABLE, kinds, sharp)).all()
    assert np.isfinite(slopes(sideways, TABLE, kinds, sharp, np.ones((3, 1)))).all()


@pytest.mark.parametrize("search", TWINS)
def test_a_metal_is_found_from_nothing(search):
    y, g, usual, normals = pixels()
    found = search(y, g, usual, 0.3, CANDIDATES, SearchSettings())
    np.testing.assert_allclose(np.linalg.norm(found, axis=2), 1.0, atol=1e-12)
    assert np.median(angle(found[:, 0], normals)) < 6.0  # candidates lie 8° apart
    assert (angle(found, normals[:, None]).min(axis=1) < 9.0).mean() > 0.9
    apart = np.degrees(np.arccos(SearchSettings().apart))
    assert (angle(found[:, 0], found[:, 1]) >= apart - 1e-9).all()


def test_the_twins_agree_whatever_the_pixel():
    y, g, usual, _ = pixels()
    g[0] = 0.0  # nothing is lit
    y[1] *= -1.0  # nothing fits
    for width in (0.3, np.inf):
        plain, fast = [one(y, g, usual, width, CANDIDATES, SearchSettings()) for one in TWINS]
        assert np.isfinite(plain).all()
        assert (angle(plain, fast)[2:] < 1e-9).mean() > 0.98  # candidates that are as good may change places


def test_the_best_candidate_is_that_of_lawson_and_hanson():
    y, g, usual, _ = pixels(4, seed=3)
    s = SearchSettings(pull=0.0, starts=1)
    found = exemplar_search.search(y, g, usual, np.inf, CANDIDATES, s)
    for j in range(4):
        loss = []
        for columns, reached in zip(CANDIDATES.columns, CANDIDATES.reached, strict=True):
            w = np.sqrt(g[j] * reached / (s.soft**2 + y[j] ** 2))
            tie = np.diag(np.sqrt((CANDIDATES.ties + exemplar_search.WEAK) * (w * w).sum()))
            x, _ = reference_nnls(np.vstack([(columns * w).T, tie]), np.concatenate([w * y[j], np.zeros(3)]))
            loss.append(np.log1p((y[j] - x @ columns) ** 2 * g[j] / s.yard**2).sum())
        np.testing.assert_allclose(found[j, 0], CANDIDATES.normals[int(np.argmin(loss))], atol=1e-12)


def test_unusual_amounts_are_held_back():
    y, g, usual, normals = pixels()
    strict = SearchSettings(pull=50.0, starts=1)
    far = exemplar_search.search(y, g, usual + 3.0, 0.1, CANDIDATES, strict)[:, 0]
    near = exemplar_search.search(y, g, usual, 0.1, CANDIDATES, strict)[:, 0]
    assert np.median(angle(near, normals)) < 0.5 * np.median(angle(far, normals))


def test_fewer_candidates_than_starts():
    few = type(CANDIDATES)(CANDIDATES.normals[:1], CANDIDATES.columns[:1], CANDIDATES.reached[:1], CANDIDATES.ties)
    y, g, usual, _ = pixels(3)
    for search in TWINS:
        found = search(y, g, usual, 1.0, few, SearchSettings())
        np.testing.assert_array_equal(found, np.broadcast_to(few.normals[0], (3, 3, 3)))
