"""Least squares against dense references: numpy.linalg.lstsq pixel by pixel, mpmath, and an SVD for the colours."""

import mpmath
import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.flags import Flag
from psstereo.lights import Rig, StrengthUnit
from psstereo.normals import GATES, LeastSquares, PixelNormals, Samples, estimate_normals
from psstereo.normals.channels import combine_channels
from psstereo.results import AlbedoKind
from psstereo.stack import MemoryStack
from psstereo_synth import checker, hills, lambertian_capture, spiral

EPS = np.finfo(np.float64).eps
NONE = LeastSquares(gate=GATES["none"])
SHADOW = LeastSquares(gate=GATES["shadow"])


def random_values(seed=0, lights=10, count=300, noise=0.03):
    rng = np.random.default_rng(seed)
    directions = spiral(lights, max_tilt=1.2)
    b = rng.normal(size=(3, count)) * [[0.4], [0.4], [0.1]] + [[0], [0], [1]]
    return directions, np.maximum(directions @ b, 0) + rng.normal(0, noise, (lights, count))


def dense(directions, values, weights=None):
    """One lstsq a pixel, rows scaled by the square roots of the weights."""
    root = np.sqrt(np.ones_like(values) if weights is None else weights)
    return np.array([np.linalg.lstsq(r[:, None] * directions, r * v)[0] for r, v in zip(root.T, values.T, strict=True)])


def solve(solver, directions, values, weights=None):
    return solver.solve(solver.prepare(Rig.distant(directions)), Samples(values, weights))


def test_without_gate_it_is_lstsq():
    directions, values = random_values()
    np.testing.assert_allclose(
        solve(NONE, directions, values).scaled, dense(directions, values), rtol=0, atol=100 * EPS
    )


def test_with_weights_it_is_weighted_lstsq():
    directions, values = random_values()
    weights = 10.0 ** np.random.default_rng(1).uniform(-3, 3, values.shape)
    found = solve(NONE, directions, values, weights).scaled
    expected = dense(directions, values, weights)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


def shown(directions, values):
    """The rule of the shadow gate, written down again: what is lit by the values, then by the model."""
    used = values > 0.02 * values.max(axis=0)
    b = dense(directions, values, used.astype(float))
    with_model = np.minimum(directions @ b.T, values) > 0.02 * np.linalg.norm(b, axis=1)
    return np.where(with_model.sum(axis=0) >= 3, with_model, used)


@pytest.mark.parametrize("weighted", [False, True])
def test_with_gate_it_is_lstsq_over_the_same_observations(weighted):
    directions, values = random_values(noise=0.01)
    kept = shown(directions, values)
    assert 0.5 < kept.mean() < 0.99
    weights = np.random.default_rng(2).uniform(0.5, 2.0, values.shape) if weighted else None
    result = solve(SHADOW, directions, values, weights)
    if not weighted:
        np.testing.assert_array_equal(result.used, kept.sum(axis=0))
        expected = dense(directions, values, kept.astype(float))
        np.testing.assert_allclose(result.scaled, expected, rtol=0, atol=1e-12)
    else:  # another first fit: compare with the gate of its own
        same = result.used == kept.sum(axis=0)
        assert same.mean() > 0.9
        expected = dense(directions, values, kept * weights)
        np.testing.assert_allclose(result.scaled[same], expected[same], rtol=0, atol=1e-12)


def narrow(tilt, lights=12):
    """Lights in a cone so narrow that they nearly are one light: condition 2.8 over the tilt."""
    return spiral(lights, max_tilt=tilt)


@pytest.mark.parametrize("condition", [1.5e3, 1.5e5, 1.5e7])
@pytest.mark.parametrize("gate", ["none", "shadow"])
def test_a_nearly_coplanar_rig_costs_its_condition_once(condition, gate):
    tilt = np.linspace(0, np.pi, 7)
    out = np.array([1, -1, 1, -1, 1, -1, 1]) / condition
    directions = np.stack([np.cos(tilt), out, np.sin(tilt) + 1.1], axis=1)
    rig = Rig.distant(directions)
    assert 0.1 * condition < rig.condition() < 10 * condition
    rng = np.random.default_rng(3)
    b = rng.normal(size=(3, 200)) * [[0.2], [0.2], [0.1]] + [[0], [0], [1]]
    found = solve(LeastSquares(gate=GATES[gate]), directions, rig.directions @ b).scaled
    error = np.linalg.norm(found.T - b, axis=0) / np.linalg.norm(b, axis=0)
    # Rounding of the values alone is worth about √m κ ε; normal equations would cost κ² ε, a factor of 1500 or more.
    assert error.max() < 8 * rig.condition() * EPS
    reference = np.linalg.norm(np.linalg.lstsq(rig.directions, rig.directions @ b)[0] - b, axis=0).max()
    assert error.max() < 4 * max(reference, rig.condition() * EPS)


@pytest.mark.parametrize("condition", [1.5e3, 1.5e5, 1.5e7])
def test_a_nearly_coplanar_rig_against_exact_arithmetic(condition):
    directions = Rig.distant(narrow(3.0 / condition, 5)).directions
    # A narrow cone of half-angle t has the condition of about 1/t for the two directions across.
    actual = np.linalg.cond(directions)
    assert 0.3 * condition < actual < 3 * condition
    values = np.random.default_rng(4).uniform(0.9, 1.1, 5)
    with mpmath.workdps(60):
        matrix = mpmath.matrix(directions.tolist())
        exact = mpmath.lu_solve(matrix.T * matrix, matrix.T * mpmath.matrix(values.tolist()))
        b = np.array([float(x) for x in exact])
    found = solve(NONE, directions, values[:, None]).scaled[0]
    # A residual that does not vanish adds κ² ε |r| / |L b|: the bound of backward stability (Wedin).
    residual = np.linalg.norm(values - directions @ b)
    bound = actual * EPS * (np.linalg.norm(b) + actual * residual)
    assert np.linalg.norm(found - b) < 8 * bound


@pytest.mark.parametrize("condition", [1e2, 1e3, 1e4, 3e4])
def test_a_pixel_whose_own_lights_are_nearly_coplanar_costs_its_condition_once(condition):
    """The rig is good; the three lights that reach the pixel are not: the corrected semi-normal equations."""
    trio = np.array([[0.6, 0.0, 0.8], [-0.6, 0.0, 0.8], [0.1, 1 / condition, 1.0]])
    rest = np.array([[0.0, -0.9, 0.3], [0.2, -0.9, 0.2], [-0.2, -0.9, 0.2]])
    rig = Rig.distant(np.concatenate([trio, rest]))
    own = np.linalg.cond(rig.directions[:3])
    assert own > 0.5 * condition
    rng = np.random.default_rng(5)
    b = np.array([0.0, 0.8, 0.6])[:, None] + rng.uniform(-0.05, 0.05, (3, 100))
    values = np.maximum(rig.directions @ b, 0.0)
    assert ((values > 0).sum(axis=0) == 3).all()
    result = solve(SHADOW, rig.directions, values)
    error = np.linalg.norm(result.scaled.T - b, axis=0).max()
    assert error < 8 * own * EPS
    assert not result.flags[np.isnan(result.scaled[:, 0])].any()
    assert (result.flags & Flag.NO_REDUNDANCY).all()


def test_a_pixel_whose_own_lights_are_coplanar_is_flagged():
    trio = np.array([[0.6, 0.0, 0.8], [-0.6, 0.0, 0.8], [0.1, 0.0, 1.0]])
    rig = Rig.distant(np.concatenate([trio, [[0.0, -0.9, 0.3]]]))
    values = np.maximum(rig.directions @ np.array([[0.0], [0.8], [0.6]]), 0.0)
    values[3] = 0.0
    values[:3] += [[0.01], [0.02], [-0.01]]
    result = solve(SHADOW, rig.directions, values)
    assert result.flags[0] & Flag.RANK_DEFICIENT
    assert np.isnan(result.scaled).all()


def channel(scaled, uncertainty=0.01):
    count = len(scaled)
    return PixelNormals(scaled, np.full(count, uncertainty), np.zeros(count, np.uint16), np.full(count, 9, np.uint16))


@pytest.mark.parametrize("noise", [0.0, 1e-6, 0.01, 0.1])
def test_channels_are_combined_as_the_svd_does(noise):
    rng = np.random.default_rng(6)
    normals = rng.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    albedo = rng.uniform(0.2, 1.0, (200, 3))
    b = albedo[..., None] * normals[:, None] + rng.normal(0, noise, (200, 3, 3))
    found, shares, _, _ = combine_channels([channel(b[:, c]) for c in range(3)])
    u, s, vt = np.linalg.svd(b)
    sign = np.sign((vt[:, 0] * normals).sum(axis=1))
    # The gap of the singular values says how well the vector is determined.
    tolerance = 1e-13 / (1 - (s[:, 1] / s[:, 0])[:, None] ** 2)
    assert (np.abs(found - vt[:, 0] * sign[:, None]) <= tolerance).all()
    np.testing.assert_allclose(shares, u[..., 0] * (s[:, 0] * sign)[:, None], rtol=0, atol=1e-12)


@pytest.mark.parametrize("tint", [False, True])
def test_albedo_is_absolute_where_radiances_are_known(tint):
    albedo = checker((40, 40), tint=tint)
    irradiance = np.random.default_rng(7).uniform(300, 900, (10, 3) if tint else 10)
    capture, truth = lambertian_capture(
        hills(40, 40, steepness=0.6), albedo, spiral(10, max_tilt=0.6), irradiance, bits=None
    )
    result = estimate_normals(capture, gray="per-channel" if tint else "mean")
    assert result.albedo_kind is AlbedoKind.REFLECTANCE
    mask = capture.mask
    np.testing.assert_allclose(result.albedo[mask], truth.albedo[mask], rtol=1e-9)
    # L = ρ E: the albedo over π is the constant BRDF [sr⁻¹] that made the images
    facing = np.einsum("mx,hwx->mhw", capture.rig.directions, truth.normals)
    radiance = capture.stack.read() * capture.radiance_at_white
    rho = (result.albedo / np.pi).reshape(40, 40, -1)
    expected = rho * facing[..., None] * capture.rig.strengths(rho.shape[2])[:, None, None]
    np.testing.assert_allclose(radiance[:, mask], expected[:, mask], rtol=1e-9)


@pytest.mark.parametrize("missing", ["radiance", "unit"])
def test_albedo_is_relative_where_something_is_unknown(missing):
    capture, truth = lambertian_capture(hills(24, 24), checker((24, 24)), spiral(10, max_tilt=0.6), bits=None)
    unit = StrengthUnit.RELATIVE if missing == "unit" else StrengthUnit.IRRADIANCE
    rig = Rig.distant(capture.rig.directions, capture.rig.strengths(1), strength_unit=unit)
    white = None if missing == "radiance" else capture.radiance_at_white
    other = Capture(stack=MemoryStack(capture.stack.read()), rig=rig, mask=capture.mask, radiance_at_white=white)
    result = estimate_normals(other)
    assert result.albedo_kind is AlbedoKind.RELATIVE
    factor = (result.albedo / truth.albedo)[capture.mask]
    np.testing.assert_allclose(factor, 1 / (np.pi * capture.radiance_at_white), rtol=1e-9)
