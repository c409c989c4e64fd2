"""The compiled steps against their reference, through the domain that both are made for."""

import numpy as np
import pytest

from psstereo.kernels import poisson_steps, poisson_steps_compiled

ORTHOGRAPHIC = np.diag([0.5, -0.5, 0.0])
PINHOLE = np.array([[0.01, -2e-5, -0.1], [0.0, -0.011, 0.09], [0.0, 0.0, -1.0]])
TOWARD = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def scene(dtype):
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(19, 23, 3)) * [1.0, 1.0, 0.4]
    normals[..., 2] += 0.4
    normals *= 10.0 ** rng.uniform(-30, 30, (19, 23, 1))
    normals[3, 4] = np.nan
    normals[5, 6, 1] = np.inf
    normals[7, 8] = 0.0
    normals[9, 10] = (1.0, 0.0, 1e-12)
    normals[9, 11] = (1.0, 0.0, 1e-12)
    wanted = rng.random((19, 23)) < 0.85
    weights = 10.0 ** rng.uniform(-6, 0, (19, 23))
    weights[11, 12:15] = 0.0
    return normals.astype(dtype), wanted, weights


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("weighed", [False, True])
@pytest.mark.parametrize("rays", ["toward", "pinhole", "array"])
def test_classes(dtype, weighed, rays):
    normals, wanted, weights = scene(dtype)
    weights[0, :3] = np.nan, -1.0, np.inf
    matrix = TOWARD if rays == "toward" else PINHOLE
    array = poisson_steps.places_of(PINHOLE, np.zeros((0, 0, 0)), 0, 19, 23) if rays == "array" else np.zeros((0, 0, 0))
    found = []
    for module in (poisson_steps, poisson_steps_compiled):
        state, counts = np.zeros((19, 23), np.uint8), np.zeros((19, 6), np.int64)
        for first, last in ((0, 7), (7, 19)):
            module.classify(
                normals, wanted, weights if weighed else np.zeros((0, 0)), matrix, array, state, counts, first, last
            )
        found.append((state, counts))
    for one, two in zip(*found, strict=True):
        np.testing.assert_array_equal(one, two)
    assert set(np.unique(found[0][0])) == (set(range(6)) if weighed else set(range(4)))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("weighed", [False, True])
@pytest.mark.parametrize("form", ["height", "distance", "array"])
@pytest.mark.parametrize(("exponent", "keen"), [(0.0, 0.0), (2.0, 50.0), (1.5, 0.0)])
def test_steps(dtype, weighed, form, exponent, keen):
    normals, wanted, weights = scene(dtype)
    central = form != "height"
    matrix = PINHOLE if central else ORTHOGRAPHIC
    top, left, size = 2, 1, (16, 21)
    window = slice(top, top + size[0]), slice(left, left + size[1])
    state, counts = np.zeros((19, 23), np.uint8), np.zeros((19, 6), np.int64)
    rays = PINHOLE if central else TOWARD
    nothing = np.zeros((0, 0, 0))
    poisson_steps.classify(normals, wanted, weights, rays, nothing, state, counts, 0, 19)
    inside = state[window] == poisson_steps.INSIDE
    array = poisson_steps.places_of(PINHOLE, nothing, 0, *size) if form == "array" else nothing
    heavy = np.ascontiguousarray(weights[window]) if weighed else np.zeros((0, 0))
    found = []
    for module in (poisson_steps, poisson_steps_compiled):
        right, right_weight = np.zeros((2, size[0], size[1] - 1))
        down, down_weight = np.zeros((2, size[0] - 1, size[1]))
        lost = np.zeros(size[0], np.int64)
        for first, last in ((0, 5), (5, 16)):
            module.steps(
                normals, top, left, inside, heavy, matrix, array, central, exponent, keen,
                right, down, right_weight, down_weight, lost, first, last,
            )  # fmt: skip
        found.append((right, down, right_weight, down_weight, lost))
    for one, two in zip(*found, strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-9, atol=1e-13)
    assert (found[0][2] > 0).any()


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.9, 1.0])
def test_components(share):
    rng = np.random.default_rng(5)
    inside = rng.random((40, 37)) < share
    right = (inside[:, 1:] & inside[:, :-1] & (rng.random((40, 36)) < 0.9)).astype(float)
    down = (inside[1:] & inside[:-1] & (rng.random((39, 37)) < 0.9)).astype(float)
    one, two = np.zeros((2, 40, 37), np.int32)
    number = poisson_steps.components(inside, right, down, one)
    assert poisson_steps_compiled.components(inside, right, down, two) == number
    np.testing.assert_array_equal(one, two)
    assert number == one.max()


def test_components_of_a_comb_that_is_joined_at_its_last_row():
    inside = np.ones((30, 41), bool)
    inside[:-1, 1::2] = False
    right = (inside[:, 1:] & inside[:, :-1]).astype(float)
    down = (inside[1:] & inside[:-1]).astype(float)
    labels = np.zeros(inside.shape, np.int32)
    assert poisson_steps_compiled.components(inside, right, down, labels) == 1
    np.testing.assert_array_equal(labels, inside)
