"""Of several normals the true one explains a pixel best, whatever the pixel is made of."""

import numpy as np
import pytest
from scipy.optimize import nnls

from psstereo.brdf.blinn_phong import BlinnPhong
from psstereo.brdf.ggx import Ggx
from psstereo.brdf.lambert import Lambert
from psstereo.brdf.lunar_lambert import LunarLambert
from psstereo.brdf.oren_nayar import OrenNayar
from psstereo.plan import explanation
from psstereo.plan.explanation import best_explained, unexplained
from psstereo_synth import spiral

EYE = np.array([0.0, 0.0, 1.0])


def tilted(count, most, seed=0):
    rng = np.random.default_rng(seed)
    angle, tilt = rng.uniform(0, 2 * np.pi, count), rng.uniform(0.05, most, count)
    return np.stack([np.cos(angle) * np.sin(tilt), np.sin(angle) * np.sin(tilt), np.cos(tilt)], axis=1)


def shown(brdf, normals, lights):
    """Return what a surface of one material shows, (m, n)."""
    cosine = np.maximum(lights @ normals.T, 0.0)
    values = [
        brdf.evaluate(normals, np.broadcast_to(light, normals.shape), np.broadcast_to(EYE, normals.shape))
        for light in lights
    ]
    return np.stack([np.asarray(one).reshape(len(normals), -1)[:, 0] for one in values]) * cosine


MATERIALS = {
    "matte": Lambert(albedo=0.5),
    "rough": OrenNayar(albedo=0.5, roughness=0.5),
    "moon": LunarLambert(albedo=0.5),
    "plastic": BlinnPhong(diffuse=0.3, specular=0.3, exponent=40),
    "metal": Ggx(albedo=0.0, f0=0.8, roughness=0.4),
}


@pytest.mark.parametrize("material", MATERIALS)
def test_the_true_normal_leaves_less_than_one_that_is_five_degrees_off(material):
    lights, normals = spiral(48, max_tilt=1.1), tilted(60, 0.8)
    values = shown(MATERIALS[material], normals, lights)
    across = np.cross(normals, EYE)
    across /= np.linalg.norm(across, axis=1)[:, None]
    left = unexplained(normals, lights, values)
    for side in (across, np.cross(across, normals)):
        off = np.cos(np.radians(5)) * normals + np.sin(np.radians(5)) * side
        assert np.mean(left < unexplained(off, lights, values)) > 0.7
        found = best_explained(np.stack([off, normals]), lights, values)
        assert np.mean((found == normals).all(axis=1)) > 0.7


def test_a_level_of_either_sign_is_part_of_the_mixture():
    lights, normals = spiral(24), tilted(10, 0.5)
    values = lights @ normals.T
    for level in (0.1, -0.1):
        assert unexplained(normals, lights, values + level).max() < 1e-3


def test_the_scale_of_the_values_does_not_matter():
    lights, normals = spiral(24), tilted(10, 0.7)
    values = shown(MATERIALS["plastic"], normals, lights)
    off = tilted(10, 0.7, seed=1)
    np.testing.assert_allclose(unexplained(off, lights, values), unexplained(off, lights, values * 2.0**-90), rtol=1e-9)


def test_a_fifth_of_the_observations_may_be_cast_shadows():
    lights, normals = spiral(40), tilted(30, 0.5)
    values = shown(MATERIALS["matte"], normals, lights)
    values[::7] = 0.0
    assert np.median(unexplained(normals, lights, values)) < 1e-3


def test_what_is_missing_is_passed_over():
    lights, normals = spiral(24), tilted(4, 0.5)
    values = shown(MATERIALS["matte"], normals, lights)
    gone = values.copy()
    gone[::3] = np.nan
    assert unexplained(normals, lights, gone).max() < 1e-3
    gone[3:] = np.nan
    assert np.isinf(unexplained(normals, lights, gone)).all()
    assert np.isinf(unexplained(normals, lights, np.zeros_like(values))).all()
    candidates = np.stack([np.full_like(normals, np.nan), normals])
    np.testing.assert_array_equal(best_explained(candidates, lights, values), normals)
    assert np.isnan(best_explained(candidates[:1], lights, values)).all()


def test_the_first_round_is_least_squares_without_negative_parts(monkeypatch):
    monkeypatch.setattr(explanation, "_ROUNDS", 1)
    monkeypatch.setattr(explanation, "_RIDGE", 1e-13)
    lights, normals, off = spiral(30), tilted(6, 0.6), tilted(6, 0.6, seed=2)
    values = shown(MATERIALS["plastic"], normals, lights)
    found = unexplained(off, lights, values)
    mixture, lit = explanation._mixture(off, lights)
    for pixel in range(6):
        rows = lit[pixel]
        level = mixture[pixel, rows, -1:]
        columns = np.hstack([mixture[pixel, rows], -level])
        bright = np.sort(values[:, pixel])[int(np.ceil(0.8 * 30)) - 1]
        right = values[rows, pixel] / bright
        residual = np.sort(np.abs(right - columns @ nnls(columns, right)[0]))
        assert found[pixel] == pytest.approx(residual[int(np.ceil(0.85 * len(right))) - 1], rel=1e-4)
