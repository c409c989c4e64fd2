"""The passes around the cosine transform against their references."""

import numpy as np
import pytest

from psstereo.kernels import poisson_steps, poisson_transform, poisson_transform_compiled

ORTHOGRAPHIC = np.diag([0.5, -0.5, 0.0])
PINHOLE = np.array([[0.01, -2e-5, -0.1], [0.0, -0.011, 0.09], [0.0, 0.0, -1.0]])
SIZES = [(1, 1), (1, 9), (8, 1), (13, 17)]


def parts(height):
    return [(0, height // 3), (height // 3, height)] if height > 2 else [(0, height)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("central", [False, True])
def test_divergence(size, central):
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(size[0] + 2, size[1] + 3, 3)) * 0.3 + [0.0, 0.0, 1.0]
    if size == (13, 17):
        normals[5, 6] = normals[5, 7] = (1.0, 0.0, 1e-12)
    inside, matrix = np.ones(size, bool), PINHOLE if central else ORTHOGRAPHIC
    found = []
    for module in (poisson_transform, poisson_transform_compiled):
        out, lost = np.full(size, np.nan), np.full(size[0], -1)
        for first, last in parts(size[0]):
            module.divergence(normals, 2, 1, inside, matrix, np.zeros((0, 0, 0)), central, out, lost, first, last)
        found.append((out, lost))
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found[0][1], found[1][1])
    assert found[0][0].sum() == pytest.approx(0.0, abs=1e-9)
    if not central:
        assert (found[0][1].sum() > 0) == (size == (13, 17))


@pytest.mark.parametrize("size", SIZES)
def test_division_and_mismatch(size):
    rng = np.random.default_rng(2)
    value, right_side = rng.normal(size=(2, *size))
    rows, columns = np.arange(size[0]) * 0.3, np.arange(size[1]) * 0.2
    found = []
    for module in (poisson_transform, poisson_transform_compiled):
        spectrum, sums = value.copy(), np.zeros((size[0], 2))
        for first, last in parts(size[0]):
            module.divide(spectrum, rows, columns, first, last)
            module.mismatch(value, right_side, sums, first, last)
        found.append((spectrum, sums))
    for one, two in zip(*found, strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-12)
    assert found[0][0][0, 0] == 0.0


def test_the_divergence_is_that_of_the_steps():
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(9, 7, 3)) * 0.3 + [0.0, 0.0, 1.0]
    inside, nothing = np.ones((9, 7), bool), np.zeros((0, 0, 0))
    right, right_weight = np.zeros((2, 9, 6))
    down, down_weight = np.zeros((2, 8, 7))
    lost, out = np.zeros(9, np.int64), np.zeros((9, 7))
    poisson_steps.steps(
        normals, 0, 0, inside, np.zeros((0, 0)), ORTHOGRAPHIC, nothing, False, 0.0, 0.0,
        right, down, right_weight, down_weight, lost, 0, 9,
    )  # fmt: skip
    poisson_transform_compiled.divergence(normals, 0, 0, inside, ORTHOGRAPHIC, nothing, False, out, lost, 0, 9)
    values = rng.normal(size=(9, 7))
    pull = np.sum(np.diff(values, axis=1) * right) + np.sum(np.diff(values, axis=0) * down)
    assert np.sum(values * out) == pytest.approx(pull, rel=1e-12)
