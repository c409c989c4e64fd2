"""The bi-polynomial solver: closer than Lambert's law on materials, refusals, options, flags, verdicts."""

import numpy as np
import pytest

from psstereo.brdf import Ggx
from psstereo.errors import OptionError, RigError
from psstereo.flags import Flag
from psstereo.kernels import bipolynomial as reference
from psstereo.lights import Rig
from psstereo.normals import Samples
from psstereo.normals.bipolynomial import BiPolynomial
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.robust import Robust
from psstereo.verdict import Verdict
from psstereo_synth import ring, spiral

DIRECTIONS = spiral(64)
RIG = Rig.distant(DIRECTIONS)


def material(roughness, f0, albedo, *, count=200, noise=0.0, seed=0, directions=DIRECTIONS):
    """Pixels of a sphere of some material, (m, p), and their normals."""
    rng = np.random.default_rng(seed)
    z = np.sqrt(rng.uniform(0.1, 1.0, count))
    turn = rng.uniform(0, 2 * np.pi, count)
    r = np.sqrt(1 - z * z)
    normals = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)
    brdf = Ggx(albedo=np.array([albedo]), f0=np.array([f0]), roughness=np.array([roughness]))
    eye = np.broadcast_to([0.0, 0.0, 1.0], normals.shape)
    values = np.zeros((len(directions), count))
    for one, direction in zip(values, directions, strict=True):
        cosine = np.maximum(normals @ direction, 0.0)
        shown = brdf.evaluate(normals, np.broadcast_to(direction, normals.shape), eye)
        one[:] = np.where(cosine > 0, np.asarray(shown).reshape(count), 0.0) * cosine
    values += noise * values.max(axis=0) * rng.normal(size=values.shape)
    return values, normals


def solve(solver, values, rig=RIG, **asked):
    return solver.solve(solver.prepare(rig), Samples(values, **asked))


def error(found, normals):
    cross = np.linalg.norm(np.cross(found.scaled, normals), axis=1)
    return np.degrees(np.nanmean(np.arctan2(cross, (found.scaled * normals).sum(axis=1))))


@pytest.mark.parametrize("surface", [(0.5, 0.1, 0.3), (0.7, 0.2, 0.2), (0.4, 0.8, 0.0)])
def test_closer_than_lamberts_law_on_rough_and_metallic_materials(surface):
    values, normals = material(*surface, noise=0.002)
    bent, straight = (error(solve(solver, values), normals) for solver in (BiPolynomial(), Robust()))
    assert bent < 0.95 * straight
    assert bent < 0.6 * error(solve(LeastSquares(), values), normals)


def test_exact_on_a_matte_surface_with_highlights():
    rng = np.random.default_rng(1)
    _, normals = material(0.5, 0.1, 0.3)
    shading = DIRECTIONS @ normals.T
    values = np.maximum(shading, 0) + 0.5 * (rng.random(shading.shape) < 0.1) * (shading > 0)
    found = solve(BiPolynomial(), values, verdicts=True)
    assert error(found, normals) < 1e-4
    assert (found.verdicts[values > shading + 0.4] != Verdict.USED).all()
    assert (found.verdicts[shading < -0.05] == Verdict.SHADOW).all()


@pytest.mark.parametrize("lights", [3, 5, 19])
def test_too_few_lights_are_refused_with_what_would_serve(lights):
    rig = Rig.distant(ring(lights))
    with pytest.raises(RigError, match="20 or more") as caught:
        BiPolynomial().prepare(rig)
    assert "least-squares" in caught.value.remedy


def test_pixels_with_too_few_lit_observations_get_the_start():
    values, _ = material(0.5, 0.1, 0.3)
    values[15:, :50] = np.nan
    found, start = solve(BiPolynomial(), values, covariance=True), solve(Robust(), values, covariance=True)
    for name in ("scaled", "uncertainty", "flags", "used", "covariance"):
        np.testing.assert_array_equal(getattr(found, name)[:50], getattr(start, name)[:50])
    assert (found.scaled[50:] != start.scaled[50:]).any(axis=1).mean() > 0.9


def test_figures_belong_together():
    values, _ = material(0.5, 0.1, 0.3, noise=0.005)
    values[3, 7] = np.nan
    found = solve(BiPolynomial(), values, verdicts=True, covariance=True)
    np.testing.assert_array_equal((found.verdicts == Verdict.USED).sum(axis=0), found.used)
    assert found.verdicts[3, 7] == Verdict.UNUSABLE
    assert found.flags[7] & Flag.UNUSABLE_SAMPLE
    assert not (np.delete(found.flags, 7) & Flag.UNUSABLE_SAMPLE).any()
    shadowed = (found.verdicts == Verdict.SHADOW).any(axis=0)
    np.testing.assert_array_equal((found.flags & Flag.SHADOWED) != 0, shadowed)
    known = np.isfinite(found.uncertainty)
    assert known.mean() > 0.95
    np.testing.assert_allclose(found.covariance[:, [0, 2, 5]].sum(axis=1)[known], found.uncertainty[known] ** 2)


def test_rounds_that_do_not_suffice_are_flagged():
    values, _ = material(0.4, 0.8, 0.0)
    solvers = [BiPolynomial(ridge=1e-6, noise_ridge=0.0, rounds=rounds) for rounds in (11, 500)]
    few, many = ((solve(solver, values).flags & Flag.NOT_CONVERGED) != 0 for solver in solvers)
    assert few.mean() > 0.3
    assert many.mean() < 0.5 * few.mean()


def test_a_stiff_tie_leaves_lamberts_law():
    values, _ = material(0.7, 0.2, 0.2)
    free = solve(BiPolynomial(), values).scaled
    stiff, stiffer = (solve(BiPolynomial(ridge=ridge), values).scaled for ridge in (1e6, 1e9))
    np.testing.assert_allclose(stiff, stiffer, rtol=0, atol=1e-4 * np.linalg.norm(stiff, axis=1).max())
    assert np.abs(free - stiff).max() > 1e-2 * np.linalg.norm(stiff, axis=1).max()


@pytest.mark.parametrize(
    "options",
    [
        {"share": 0.0},
        {"share": 1.5},
        {"share": np.nan},
        {"degree": 0},
        {"degree": 4},
        {"ridge": -1.0},
        {"ridge": np.inf},
        {"noise_ridge": -1.0},
        {"dark": 1.0},
        {"dark": -0.1},
        {"rounds": 5},
    ],
)
def test_options_that_mean_nothing_are_refused(options):
    with pytest.raises(OptionError) as caught:
        BiPolynomial(**options)
    assert caught.value.remedy


def test_compiled_code_is_loaded_for_much_work_only():
    assert BiPolynomial().prepare(RIG).fit is reference.fit_pixels
    assert BiPolynomial().prepare(RIG, 100).fit is reference.fit_pixels
    assert BiPolynomial().prepare(RIG, 100_000).fit.__module__ == "psstereo.kernels.bipolynomial_compiled"
