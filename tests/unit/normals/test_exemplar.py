"""The exemplar solver on materials of the forward model, on matte ones, and on photographs."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.brdf import Ggx, OrenNayar
from psstereo.errors import OptionError, RigError
from psstereo.flags import Flag
from psstereo.io import read_capture
from psstereo.lights import Rig
from psstereo.metrics import summarise_angles
from psstereo.normals import estimate_normals
from psstereo.normals.exemplar import LOBES, Exemplar
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.response_bend import ResponseBend
from psstereo.normals.robust import Robust
from psstereo.normals.solver import Samples
from psstereo.normals.verdict import Verdict
from psstereo_synth import spiral

COMPILED = 10**7
"""Pixels that make a solver take the compiled loop."""
EYE = np.array([0.0, 0.0, 1.0])


def some_normals(count, seed=0, spread=0.35):
    slopes = np.random.default_rng(seed).normal(0, spread, (count, 2))
    normals = np.column_stack([-slopes, np.ones(count)])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def angles(found, normals):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(found, normals), axis=1), (found * normals).sum(axis=1)))


def solve(solver, directions, values, **asked):
    return solver.solve(solver.prepare(Rig.distant(directions), COMPILED), Samples(values, **asked))


def rendered(brdf, directions, normals):
    """Brightness by the forward model's own reflectances, (m, p)."""
    cosine = np.maximum(normals @ directions.T, 0.0)
    return (brdf.evaluate(normals[:, None], directions[None], EYE)[..., 0] * cosine).T


def plastic(albedo=0.5, roughness=0.45):
    return Ggx(albedo=np.full(1, albedo), f0=np.full(1, 0.05), roughness=np.full(1, roughness))


@pytest.mark.parametrize("roughness", [0.25, 0.45, 0.7])
def test_a_third_of_the_error_of_least_squares_on_plastic(roughness):
    directions, normals = spiral(60, max_tilt=0.9), some_normals(250)
    values = rendered(plastic(roughness=roughness), directions, normals)
    plain, robust, found = (angles(solve(s, directions, values).scaled, normals).mean()
                            for s in (LeastSquares(), Robust(), Exemplar()))  # fmt: skip
    assert found < plain / 3
    assert found < 0.6 * robust


def test_rough_matte_material_that_is_not_in_the_dictionary():
    directions, normals = spiral(60, max_tilt=0.9), some_normals(250)
    values = rendered(OrenNayar(albedo=np.full(1, 0.6), roughness=np.full(1, 0.5)), directions, normals)
    robust, found = (angles(solve(s, directions, values).scaled, normals).mean() for s in (Robust(), Exemplar()))
    assert found < 0.6 * robust


@pytest.mark.parametrize(("lights", "noise"), [(24, 0.003), (96, 0.01)])
def test_matte_surfaces_lose_nothing(lights, noise):
    rng = np.random.default_rng(3)
    directions, normals = spiral(lights), some_normals(1500, spread=0.45)
    values = np.maximum(directions @ normals.T, 0.0) * rng.uniform(0.3, 0.9, 1500)
    values += noise * rng.normal(size=values.shape)
    robust, found = (angles(solve(s, directions, values).scaled, normals).mean() for s in (Robust(), Exemplar()))
    assert found < 1.05 * robust


def test_the_albedo_is_that_of_the_matte_part():
    directions, normals = spiral(60, max_tilt=0.9), some_normals(300, spread=0.2)
    result = solve(Exemplar(), directions, rendered(plastic(albedo=0.5), directions, normals) * np.pi)
    albedo = np.linalg.norm(result.scaled, axis=1)
    assert np.median(albedo) == pytest.approx(0.5 * 0.95**2, rel=0.05)


def test_a_metal_has_normals_although_no_albedo():
    directions, normals = spiral(96, max_tilt=1.2), some_normals(400, spread=0.25)
    metal = Ggx(albedo=np.zeros(1), f0=np.full(1, 0.8), roughness=np.full(1, 0.5))
    values = rendered(metal, directions, normals)
    plain, found = (angles(solve(s, directions, values).scaled, normals) for s in (LeastSquares(), Exemplar()))
    assert np.median(found) < 0.5
    assert found.mean() < plain.mean() / 3
    assert (np.linalg.norm(solve(Exemplar(), directions, values).scaled, axis=1) > 0).all()


def test_error_bars_follow_the_noise():
    """They are too small by up to half, since which amounts are zero is taken as known."""
    rng = np.random.default_rng(4)
    directions, normals = spiral(96, max_tilt=0.9), some_normals(600, spread=0.2)
    clean = rendered(plastic(), directions, normals) * np.pi
    for noise in (0.003, 0.01):
        one, other = (
            solve(Exemplar(), directions, clean + noise * rng.normal(size=clean.shape), covariance=True)
            for _ in range(2)
        )
        trace = one.covariance[:, [0, 2, 5]].sum(axis=1)
        np.testing.assert_allclose(np.sqrt(trace), one.uncertainty, rtol=1e-9)
        apart = np.median(angles(one.scaled, other.scaled)) / np.sqrt(2)
        assert 0.4 < np.degrees(np.nanmedian(one.uncertainty)) / apart < 1.5


def test_verdicts_and_flags():
    rng = np.random.default_rng(5)
    directions, normals = spiral(96), some_normals(300, spread=0.4)
    values = rendered(plastic(), directions, normals) * np.pi
    shade = directions @ normals.T
    wrong = (rng.random(values.shape) < 0.04) & (shade > 0.3)
    values[wrong] += 0.4
    values[3, 7] = np.nan
    result = solve(Exemplar(), directions, values, verdicts=True)
    assert (result.verdicts[wrong] == Verdict.HIGHLIGHT).mean() > 0.9
    assert (result.verdicts[shade < 0] == Verdict.SHADOW).mean() > 0.97
    assert (result.verdicts[(shade > 0.3) & ~wrong] == Verdict.USED).mean() > 0.85
    assert result.verdicts[3, 7] == Verdict.UNUSABLE
    assert result.flags[7] & Flag.UNUSABLE_SAMPLE
    assert (result.flags[(shade < 0).any(axis=0)] & Flag.SHADOWED).all()


def test_known_materials_take_the_place_of_the_lobes():
    directions, normals = spiral(60, max_tilt=0.9), some_normals(400)
    values = rendered(plastic(), directions, normals)
    values[:, ::2] *= 0.4  # albedo and gloss together: one material
    glazed, gloss = (next(k for k, lobe in enumerate(LOBES) if lobe.name == name) for name in ("glazed", "gloss-0.25"))
    material = [0.0] * len(LOBES)
    material[glazed], material[gloss] = 0.45, 0.07
    free, known = (angles(solve(solver, directions, values).scaled, normals)
                   for solver in (Exemplar(), Exemplar(materials=(tuple(material),))))  # fmt: skip
    assert known.mean() < max(3 * free.mean(), 1.0)
    other = [0.0] * len(LOBES)
    other[gloss] = 1.0  # as a mirror it cannot be right
    wrong = angles(solve(Exemplar(materials=(tuple(other),)), directions, values).scaled, normals)
    assert wrong.mean() > 1.5 * known.mean()


def test_pixels_out_of_its_reach_get_the_simpler_answer():
    directions, normals = spiral(24), some_normals(60)
    values = rendered(plastic(), directions, normals)
    values[10:, :20] = np.nan
    values[:, 20] = 0.0
    result, simple = (solve(s, directions, values) for s in (Exemplar(), ResponseBend()))
    np.testing.assert_array_equal(result.scaled[:20], simple.scaled[:20])
    assert result.flags[20] & Flag.NO_SIGNAL
    assert np.isnan(result.scaled[20]).all()


@pytest.mark.parametrize(
    "options",
    [
        {"floor": 0.0},
        {"floor": np.nan},
        {"rounds": 3},
    ],
)
def test_hostile_options_are_refused(options):
    with pytest.raises(OptionError, match="exemplar solver"):
        Exemplar(**options)


def test_few_lights_are_refused():
    with pytest.raises(RigError, match="needs 16 or more"):
        Exemplar().prepare(Rig.distant(spiral(15)))


@pytest.mark.data
@pytest.mark.slow
@pytest.mark.parametrize(("name", "bound"), [("diligent/ballPNG", 1.33), ("diligent/catPNG", 4.88)])
def test_photographs_of_the_benchmark(data_dir, name, bound):
    """The bounds are the best that is published without training; of the larger object one pixel of nine is taken."""
    capture, truth = read_capture(data_dir / name)
    thin = np.zeros(capture.shape, np.bool_)
    step = 3 if name.endswith("catPNG") else 1
    thin[::step, ::step] = True
    capture = replace(capture, mask=capture.effective_mask & thin)
    found = estimate_normals(capture, Exemplar())
    assert summarise_angles(found.normals, truth.normals, capture.mask).mean_deg < bound
