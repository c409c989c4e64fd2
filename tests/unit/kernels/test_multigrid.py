"""The compiled passes of the grid's multigrid against their references, and what both must hold."""

import numpy as np
import pytest

from psstereo.kernels import (
    multigrid,
    multigrid_compiled,
    multigrid_krylov,
    multigrid_krylov_compiled,
    multigrid_setup,
    multigrid_setup_compiled,
)

SIZES = [(1, 1), (1, 6), (7, 1), (2, 3), (9, 12), (16, 7)]
NONE = np.zeros((0, 0), np.float32)


def stencil(size, *, nine, held, seed=0):
    """Return a random level on a mask with holes, spits and bridges, padded."""
    height, width = size
    rng = np.random.default_rng(seed)
    arrays = [np.zeros((height + 3, width + 3), np.float32) for _ in range(5)]
    inside = np.zeros((height + 3, width + 3), bool)
    inside[1:-2, 1:-2] = rng.random(size) < 0.75
    for array, (down, across) in zip(arrays, [(0, 1), (1, 0), (1, 1), (1, -1)], strict=False):
        other = np.roll(inside, (-down, -across), (0, 1))
        array[...] = np.where(inside & other, 10.0 ** rng.uniform(-3, 0, inside.shape), 0.0)
    if nine:  # Galerkin products bring a few negative weights
        arrays[2] *= np.where(rng.random(inside.shape) < 0.2, -0.01, 1.0).astype(np.float32)
    arrays[4][...] = np.where(inside & (rng.random(inside.shape) < 0.4), 0.1, 0.0)
    east, south, southeast, southwest, prior = arrays
    return east, south, southeast if nine else NONE, southwest if nine else NONE, prior if held else NONE


def padded(size, seed):
    field = np.zeros((size[0] + 3, size[1] + 3), np.float32)
    field[1:-2, 1:-2] = np.random.default_rng(seed).normal(size=size)
    return field


def coarse_of(size):
    return (size[0] + 1) // 2, (size[1] + 1) // 2


def halves(last):
    """Return two ranges of rows; a pass must not care."""
    return [(1, (last + 1) // 2), ((last + 1) // 2, last)] if last > 2 else [(1, last)]


def level(size, *, nine, held, module=multigrid_setup):
    """Return stencil, smoother's scale, interpolation and coarse stencil."""
    weights = stencil(size, nine=nine, held=held)
    inverse = np.zeros_like(weights[0])
    coarse = coarse_of(size)
    shares = np.zeros((8, coarse[0] + 3, coarse[1] + 3), np.float32)
    made = [np.zeros((coarse[0] + 3, coarse[1] + 3), np.float32) for _ in range(4)]
    made.append(np.zeros_like(made[0]) if held else NONE)
    twin = multigrid if module is multigrid_setup else multigrid_compiled
    for first, last in halves(size[0] + 1):
        twin.invert(*weights, inverse, 1e-5, first, last)
    for step in (module.interpolation, module.centres):
        for first, last in halves(coarse[0] + 1):
            step(*weights[:4], shares, first, last)
    for first, last in halves(coarse[0] + 1):
        module.galerkin(*weights, shares, *made, first, last)
    return weights, inverse, shares, made


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("nine", [False, True])
@pytest.mark.parametrize("held", [False, True])
class TestTwins:
    def test_setup(self, size, nine, held):
        one = level(size, nine=nine, held=held)
        two = level(size, nine=nine, held=held, module=multigrid_setup_compiled)
        for a, b in zip(one[1:3], two[1:3], strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-6)
        for a, b in zip(one[3], two[3], strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-6)

    def test_passes(self, size, nine, held):
        weights, inverse, shares, _ = level(size, nine=nine, held=held)
        right_side, value, coarse = padded(size, 1), padded(size, 2), padded(coarse_of(size), 3)
        found = []
        for module in (multigrid, multigrid_compiled):
            a, b, c, d = np.zeros_like(value), np.zeros_like(coarse), np.zeros_like(value), np.zeros_like(value)
            sums = np.zeros(value.shape[0])
            for first, last in halves(size[0] + 1):
                module.relax_first(*weights, inverse, right_side, np.float32(0.6), np.float32(1.2), a, first, last)
                module.correct_relax(
                    *weights, inverse, shares, coarse, right_side, np.float32(1.2), value, c, first, last
                )
                module.relax_last(*weights, inverse, right_side, np.float32(0.6), value, d, sums, first, last)
            for first, last in halves(coarse_of(size)[0] + 1):
                module.restrict_residual(*weights, shares, value, right_side, b, first, last)
            found.append((a, b, c, d, sums))
        for one, two in zip(*found, strict=True):
            np.testing.assert_allclose(one, two, rtol=1e-5, atol=2e-5)

    def test_coarse_energy_is_that_of_the_interpolated_values(self, size, nine, held):
        """Zᵀ A_c Z = (P Z)ᵀ A (P Z) for any Z: what makes the cycle safe as a preconditioner."""
        weights, _, shares, made = level(size, nine=nine, held=held)
        coarse = padded(coarse_of(size), 4)
        fine = multigrid.prolong(shares, coarse, weights[0].shape)
        assert energy(made, coarse) == pytest.approx(energy(weights, fine), rel=1e-4, abs=1e-5)

    def test_restriction_is_the_transpose_of_the_interpolation(self, size, nine, held):
        weights, _, shares, _ = level(size, nine=nine, held=held)
        right_side, coarse = padded(size, 5), padded(coarse_of(size), 6)
        restricted = np.zeros_like(coarse)
        nothing = np.zeros_like(right_side)
        multigrid.restrict_residual(*weights, shares, nothing, right_side, restricted, 1, coarse.shape[0] - 2)
        fine = multigrid.prolong(shares, coarse, right_side.shape)
        assert np.sum(restricted * coarse) == pytest.approx(np.sum(right_side * fine), rel=1e-4, abs=1e-4)


def energy(weights, value):
    east, south, southeast, southwest, prior = (np.float64(part) for part in weights)
    value = np.float64(value)
    total = np.sum(east[:, :-1] * np.diff(value, axis=1) ** 2) + np.sum(south[:-1] * np.diff(value, axis=0) ** 2)
    if southeast.size:
        total += np.sum(southeast[:-1, :-1] * (value[1:, 1:] - value[:-1, :-1]) ** 2)
        total += np.sum(southwest[:-1, 1:] * (value[1:, :-1] - value[:-1, 1:]) ** 2)
    return total + (np.sum(prior * value**2) if prior.size else 0.0)


@pytest.mark.parametrize("nine", [False, True])
def test_shares_of_every_pixel_that_has_an_edge_sum_to_one(nine):
    size = (21, 18)
    _, inverse, shares, _ = level(size, nine=nine, held=False)
    ones = np.ones((coarse_of(size)[0] + 3, coarse_of(size)[1] + 3), np.float32)
    fine = multigrid.prolong(shares, ones, inverse.shape)
    np.testing.assert_allclose(fine[inverse > 0], 1.0, atol=1e-6)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("held", [False, True])
def test_passes_of_conjugate_gradients(size, held):
    height, width = size
    rng = np.random.default_rng(7)
    right_weight, down_weight = rng.random((height, width - 1)), rng.random((height - 1, width))
    right, down = rng.normal(size=(height, width - 1)), rng.normal(size=(height - 1, width))
    prior_weight = rng.random(size) if held else np.zeros((0, 0))
    prior = rng.normal(size=size) if held else np.zeros((0, 0))
    found = []
    for module in (multigrid_krylov, multigrid_krylov_compiled):
        value, left, out = rng.normal(size=(3, *size)) * 0 + np.arange(height * width).reshape(size) % 5
        direction, scaled, sums = padded(size, 1), padded(size, 2), np.zeros(height)
        residual, image = np.zeros(size), np.zeros(size)
        for first, last in [(0, height // 2), (height // 2, height)] if height > 1 else [(0, 1)]:
            module.residual(right_weight, down_weight, right, down, prior_weight, prior, value, residual, first, last)
            module.multiply(right_weight, down_weight, prior_weight, direction, image, sums, first, last)
            module.advance(0.3, direction, image, 2.0, out, left, scaled, first, last)
        module.turn(scaled, 0.7, direction, 0, height)
        found.append((residual, image, sums, out, left, scaled, direction))
    for one, two in zip(*found, strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-6, atol=1e-6)
    # What is multiplied is what the residual is of.
    nothing = np.zeros_like(right), np.zeros_like(down)
    value, residual = np.float64(padded(size, 1)[1:-2, 1:-2]), np.zeros(size)
    multigrid_krylov.residual(
        right_weight, down_weight, *nothing, prior_weight, np.zeros_like(prior), value, residual, 0, height
    )
    np.testing.assert_allclose(residual, -found[0][1], atol=1e-12)
