"""Which basis makes normals those of a surface: exact up to a bas-relief transformation, known beforehand."""

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.normals.bas_relief import BasRelief, is_plausible, transformed, typical_facing, upright
from psstereo.normals.integrability import integrable_basis
from psstereo.normals.smoothing import smoothed, steady_basis, trust_of


def waves(size=80, bend=1.0):
    """Return normals (3, p) of length other than one of a smooth surface given in closed form, and a full mask."""
    rows, columns = np.indices((size, size))
    x, y = (columns - size / 2) * bend / 8, (size / 2 - rows) * bend / 8
    zx = 0.5 * np.cos(x) * np.cos(0.7 * y) - 0.1 * x
    zy = -0.35 * np.sin(x) * np.sin(0.7 * y) - 0.1 * y
    normals = np.stack([-zx, -zy, np.ones_like(zx)]).reshape(3, -1)
    albedo = 0.5 + 0.3 * (np.arange(size * size) % 7 > 3)
    return normals * albedo / np.linalg.norm(normals, axis=0), np.ones((size, size), bool)


def relief_left(matrix, mixing):
    """Return basis times mixing over its first entry: the bas-relief transformation Kᵀ that is left."""
    left = matrix @ mixing
    return left / left[0, 0]


MIXING = np.array([[0.3, -1.0, 0.2], [0.8, 0.1, -0.5], [0.4, 0.6, 0.9]])


@pytest.mark.parametrize("mixing", [np.eye(3), MIXING, np.diag([1.0, -1.0, 1.0]) @ MIXING, 1e3 * MIXING])
def test_a_known_matrix_is_undone_up_to_a_bas_relief_transformation(mixing):
    normals, mask = waves(bend=0.4)
    basis = integrable_basis(mixing @ normals, np.zeros(normals.shape[1]), mask)
    left = relief_left(basis.matrix, mixing)
    np.testing.assert_allclose(left[1], [0, 1, left[1, 2]], atol=3e-3)
    np.testing.assert_allclose(left[0, 1], 0, atol=3e-3)
    np.testing.assert_allclose(left[2, :2], 0, atol=3e-3)
    assert basis.ratio > 100


def test_the_error_is_that_of_differences_of_second_order():
    errors = []
    for bend in (0.8, 0.4, 0.2):
        normals, mask = waves(size=int(64 / bend), bend=bend)
        left = relief_left(integrable_basis(MIXING @ normals, np.zeros(normals.shape[1]), mask).matrix, MIXING)
        errors.append(np.abs([left[0, 1], left[1, 0], left[1, 1] - 1, left[2, 0], left[2, 1]]).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.7).all()


def test_normals_face_the_camera_afterwards():
    normals, mask = waves()
    for sign in (1.0, -1.0):
        basis = integrable_basis(sign * MIXING @ normals, np.zeros(normals.shape[1]), mask)
        assert np.median((basis.matrix @ (sign * MIXING @ normals))[2]) > 0


def test_badly_fitted_pixels_and_holes_hardly_matter():
    normals, mask = waves(bend=0.4)
    rng = np.random.default_rng(0)
    bad = rng.random(normals.shape[1]) < 0.05
    spoiled = np.where(bad, rng.normal(size=normals.shape), normals)
    spread = np.where(bad, 0.3, 1e-3)
    spread[rng.random(len(spread)) < 0.02] = np.inf
    left = relief_left(integrable_basis(MIXING @ spoiled, spread, mask).matrix, MIXING)
    np.testing.assert_allclose([left[0, 1], left[1, 0], left[2, 0], left[2, 1]], 0, atol=0.02)
    assert left[1, 1] == pytest.approx(1, abs=0.02)


def test_the_true_basis_violates_nothing_and_others_do():
    normals, mask = waves(bend=0.4)
    basis = integrable_basis(MIXING @ normals, np.zeros(normals.shape[1]), mask)
    relief = BasRelief(mu=0.4, nu=-0.7, depth=2.0).matrix.T
    for free in (np.eye(3), relief, 5 * relief):
        assert np.abs(basis.form.violations(free @ basis.matrix)).max() < 1e-3
    turned = np.array([[1, 0, 0], [0, 0.9, 0.4359], [0, -0.4359, 0.9]]) @ np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1.0]])
    assert np.abs(basis.form.violations(turned @ basis.matrix)).max() > 10


def test_normals_of_no_surface_do_not_stand_out():
    normals, mask = waves()
    shuffled = normals[:, np.random.default_rng(1).permutation(normals.shape[1])]
    around = smoothed(shuffled, np.ones(normals.shape[1]), mask, 3.0)
    assert integrable_basis(around, np.zeros(normals.shape[1]), mask).ratio < 1.6


@pytest.mark.parametrize("second", [1.0, -1.0])
def test_a_surface_of_second_degree_is_refused(second):
    """Its normals are a projective image of the plane, so that any matrix makes another such surface of them."""
    y, x = np.indices((60, 60)) - 30.0
    normals = np.stack([-x / 60, second * y / 60, np.ones_like(x)]).reshape(3, -1)
    with pytest.raises(InputError, match="second degree"):
        integrable_basis(normals, np.zeros(3600), np.ones((60, 60), bool))


def test_too_few_pixels_are_refused():
    normals, _ = waves()
    mask = np.zeros((80, 80), bool)
    mask[::2, ::2] = True
    with pytest.raises(InputError, match="0 pixels have a normal and four neighbours"):
        integrable_basis(normals[:, mask.ravel()], np.zeros(mask.sum()), mask)


def test_noise_is_smoothed_away_and_clean_normals_are_left_as_they_are():
    normals, mask = waves(bend=0.4)
    spread = np.zeros(normals.shape[1])
    _, same = steady_basis(normals, spread, mask)
    assert same is normals
    noisy = normals + 0.01 * np.random.default_rng(2).normal(size=normals.shape)
    basis, even = steady_basis(noisy, spread, mask)
    assert basis.ratio > 2 * integrable_basis(noisy, spread, mask).ratio
    assert np.abs(even - normals).mean() < 0.5 * np.abs(noisy - normals).mean() or basis.ratio > 3


def test_smoothing_keeps_what_is_even_and_gives_distrusted_pixels_no_say():
    mask = np.ones((9, 9), bool)
    normals = np.repeat(np.array([[0.1], [0.2], [0.9]]), 81, axis=1)
    trust = np.ones(81)
    np.testing.assert_allclose(smoothed(normals, trust, mask, 2.0), normals, rtol=1e-12)
    spoiled = normals.copy()
    spoiled[:, 40], trust[40] = 99.0, 0.0
    others = np.arange(81) != 40
    np.testing.assert_allclose(smoothed(spoiled, trust, mask, 2.0)[:, others], normals[:, others], rtol=1e-12)


def test_trust_is_a_half_at_the_median_and_zero_without_a_normal():
    np.testing.assert_allclose(trust_of(np.array([0.01, 0.02, 0.04, np.inf])), [0.8, 0.5, 0.2, 0.0])
    np.testing.assert_array_equal(trust_of(np.array([0.0, np.inf])), [1.0, 0.0])


@pytest.mark.parametrize("depth", [0.5, 3.0, -2.0])
def test_a_bas_relief_transformation_keeps_images_and_heights(depth):
    rng = np.random.default_rng(3)
    normals, lights = rng.normal(size=(3, 40)), rng.normal(size=(6, 3))
    relief = BasRelief(mu=0.3, nu=-0.2, depth=depth)
    np.testing.assert_allclose(relief.lights(lights) @ relief.normals(normals), lights @ normals, atol=1e-12)
    # slopes −b₁/b₃: with K they become (slope − μ)/λ, those of the surface (z − μ x − ν y)/λ
    b = relief.normals(normals)
    np.testing.assert_allclose(-b[0] / b[2], (-normals[0] / normals[2] - 0.3) / depth, rtol=1e-9)
    np.testing.assert_allclose(-b[1] / b[2], (-normals[1] / normals[2] + 0.2) / depth, rtol=1e-9)


def test_several_transformations_at_once_are_those_one_by_one():
    normals = np.random.default_rng(4).normal(size=(3, 25))
    parameters = np.array([[0.0, 0.0, 0.0], [0.4, -1.0, 0.7]])
    for found, (mu, nu, log) in zip(transformed(normals, parameters), parameters, strict=True):
        np.testing.assert_allclose(found, BasRelief(mu=mu, nu=nu, depth=np.exp(log)).normals(normals), atol=1e-12)


def test_upright_normals_face_the_camera_with_the_usual_slope():
    normals, _ = waves()
    leaning = BasRelief(mu=0.8, nu=-0.5, depth=0.2).normals(normals)
    unit = leaning / np.linalg.norm(leaning, axis=0)
    straight = upright(leaning, np.ones(normals.shape[1])).normals(unit)
    np.testing.assert_allclose((straight[:2] * straight[2]).mean(axis=1), 0, atol=1e-12)
    assert (straight[:2] ** 2).sum() == pytest.approx(0.49 * (straight[2] ** 2).sum())


def test_flat_and_edge_on_surfaces_are_not_plausible():
    normals, _ = waves()
    facing = typical_facing(normals, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [0.0, 0.0, -5.0]]))
    assert 0.6 < facing[0] < 0.995 < facing[1]
    assert facing[2] < 0.3
    assert is_plausible(normals, np.array([[0.0, 0, 0], [0.0, 0, 5], [0.0, 0, -5]])).tolist() == [True, False, False]
