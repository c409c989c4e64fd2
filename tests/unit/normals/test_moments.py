import numpy as np
import pytest

from psstereo.lights import Rig
from psstereo.normals.moments import RigFactor, angular_spread, cholesky, solve_cholesky
from psstereo_synth import spiral


def matrices(count=200, seed=0):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(count, 5, 3)) * 10.0 ** rng.uniform(-2, 0, (count, 1, 3))
    return np.einsum("pmi,pmj->pij", rows, rows)


def packed(a):
    return np.stack([a[:, 0, 0], a[:, 0, 1], a[:, 1, 1], a[:, 0, 2], a[:, 1, 2], a[:, 2, 2]])


def test_the_factor_of_a_rig_is_a_qr():
    rig = Rig.distant(spiral(9))
    factor = RigFactor.from_rig(rig)
    np.testing.assert_allclose(factor.q.T @ factor.q, np.eye(3), rtol=0, atol=1e-15)
    np.testing.assert_allclose(factor.q, rig.directions @ factor.r_inverse, rtol=0, atol=1e-14)
    weights = np.random.default_rng(1).uniform(0, 1, 9)
    dense = (factor.q.T * weights) @ factor.q
    np.testing.assert_allclose(factor.moments @ weights, packed(dense[None])[:, 0], rtol=0, atol=1e-15)


def test_cholesky_is_numpys():
    a = matrices()
    factor, singular = cholesky(packed(a))
    g = np.linalg.cholesky(a)
    expected = (g[:, 0, 0], g[:, 1, 0], g[:, 1, 1], g[:, 2, 0], g[:, 2, 1], g[:, 2, 2])
    assert not singular.any()
    for found, wanted in zip(factor, expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-7)
    rhs = np.random.default_rng(2).normal(size=(3, len(a)))
    x = solve_cholesky(factor, rhs)
    backward = np.abs(np.einsum("pij,jp->ip", a, x) - rhs).max(axis=0) / (
        np.linalg.norm(a, axis=(1, 2)) * np.linalg.norm(x, axis=0)
    )
    assert backward.max() < 20 * np.finfo(float).eps


@pytest.mark.parametrize("rank", [0, 1, 2])
def test_singular_matrices_are_told(rank):
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(50, rank, 3))
    factor, singular = cholesky(packed(np.einsum("pmi,pmj->pij", rows, rows)))
    assert singular.all()
    assert np.isnan(solve_cholesky(factor, np.ones((3, 50)))).all()


def test_no_factor_means_the_identity():
    rng = np.random.default_rng(5)
    normals = rng.normal(size=(3, 4))
    normals /= np.linalg.norm(normals, axis=0)
    r_inverse = np.triu(rng.normal(size=(3, 3)))
    ones, zeros = np.ones(4), np.zeros(4)
    identity = (ones, zeros, ones, zeros, zeros, ones)
    found = angular_spread(r_inverse, None, normals)
    np.testing.assert_allclose(found, angular_spread(r_inverse, identity, normals), rtol=1e-14)


def test_angular_spread_is_the_trace_across_the_normal():
    rig = Rig.distant(spiral(9))
    rng = np.random.default_rng(4)
    weights = rng.uniform(0.1, 2, (9, 30))
    normals = rng.normal(size=(3, 30))
    normals /= np.linalg.norm(normals, axis=0)
    factor = RigFactor.from_rig(rig)
    found = angular_spread(factor.r_inverse, cholesky(factor.moments @ weights)[0], normals)
    for p in range(30):
        across = np.eye(3) - np.outer(normals[:, p], normals[:, p])
        covariance = np.linalg.inv((rig.directions.T * weights[:, p]) @ rig.directions)
        assert found[p] == pytest.approx(np.sqrt(np.trace(across @ covariance @ across)), rel=1e-12)
