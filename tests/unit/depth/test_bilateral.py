"""The bilateral baseline: against the published equations written out, on planes, cliffs and what it cannot do."""

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import Poisson
from psstereo.depth.bilateral import Bilateral
from psstereo.depth.prior import Prior
from psstereo.errors import OptionError


def bumps(shape, seed=0):
    rows, columns = np.indices(shape) / 5.0
    normals = np.dstack([np.sin(rows + seed), np.cos(columns * 1.3), np.full(shape, 1.2)])
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def published(normals, k, rounds):
    """The four equations a pixel of the paper on a full rectangle, n_z D z = ∓ n_x, n_y, as one dense matrix."""
    height, width = normals.shape[:2]
    index = np.arange(height * width).reshape(height, width)
    n_x, n_y, n_z = (normals[..., k].ravel() for k in range(3))
    blocks, sides = [], []
    for rows, columns, right_side in ((0, 1, -n_x), (0, -1, -n_x), (1, 0, n_y), (-1, 0, n_y)):
        matrix, values = np.zeros((index.size, index.size)), np.zeros(index.size)
        for (row, column), here in np.ndenumerate(index):
            if 0 <= row + rows < height and 0 <= column + columns < width:
                there = index[row + rows, column + columns]
                sign = rows + columns
                matrix[here, there], matrix[here, here] = sign * n_z[here], -sign * n_z[here]
                values[here] = right_side[here]
        blocks.append(matrix)
        sides.append(values)
    weights = [np.full(index.size, 0.5)] * 4
    for _ in range(rounds):
        scale = [np.sqrt(w)[:, None] for w in weights]
        stack = np.concatenate([s * b for s, b in zip(scale, blocks, strict=True)])
        wanted = np.concatenate([s[:, 0] * v for s, v in zip(scale, sides, strict=True)])
        z = np.linalg.lstsq(stack, wanted, rcond=1e-13)[0]
        steps = [(block @ z) ** 2 for block in blocks]
        right, down = (1 / (1 + np.exp(-k * (steps[i + 1] - steps[i]))) for i in (0, 2))
        weights = [right, 1 - right, down, 1 - down]
    return (z - z.mean()).reshape(height, width)


@pytest.mark.parametrize("rounds", [1, 2, 4])
def test_it_solves_the_published_equations(rounds):
    normals = bumps((9, 10))
    normals[3:6, 4:9] = np.array([-0.8, 0.1, 0.6]) / np.linalg.norm([-0.8, 0.1, 0.6])
    found = Bilateral(rounds=rounds, settled=0.0).integrate(normals, Orthographic())
    np.testing.assert_allclose(found.depth, published(normals, 2.0, rounds), rtol=0, atol=1e-5)
    assert found.facts["rounds"] == rounds


def test_without_steepness_it_is_linear_and_done_at_once():
    normals = bumps((11, 12))
    found = Bilateral(steepness=0.0).integrate(normals, Orthographic())
    assert found.facts["rounds"] <= 3
    assert found.facts["components_unsettled"] == 0
    np.testing.assert_allclose(found.depth, published(normals, 0.0, 1), rtol=0, atol=1e-7)


def test_the_pixel_size_only_scales_the_height():
    normals = bumps((18, 16))
    one = Bilateral(rounds=5).integrate(normals, Orthographic())
    small = Bilateral(rounds=5).integrate(normals, Orthographic(pixel_size=0.01, length_unit="mm"))
    np.testing.assert_allclose(small.depth, 0.01 * one.depth, rtol=0, atol=1e-10)


def test_a_steep_cliff_is_found():
    rows, columns = np.indices((60, 60), dtype=float)
    left = columns < 30
    hill = np.where(left, 25 * np.exp(-((columns - 29.5) ** 2 + (rows - 30) ** 2) / (2 * 6.0**2)), 0.0)
    normals = np.dstack([hill * (columns - 29.5) / 36, -hill * (rows - 30) / 36, np.ones((60, 60))])
    error = [np.std(m.integrate(normals, Orthographic()).depth - hill) for m in (Bilateral(), Poisson(turn=None))]
    assert error[1] > 0.8
    assert error[0] < 0.6 * error[1]


@pytest.mark.parametrize("camera", [Orthographic(), Pinhole(fx=90.0, fy=80.0, cx=9.0, cy=8.0)])
def test_a_gentle_sphere_is_right_to_first_order(camera):
    """One-sided steps are off by half the curvature; the error stays within it times the width."""
    errors = []
    for size in (20, 40):
        rows, columns = np.indices((size, size)) - (size - 1) / 2
        radius = 2.0 * size
        if isinstance(camera, Pinhole):
            camera = Pinhole(fx=5.0 * size, fy=5.0 * size, cx=(size - 1) / 2, cy=(size - 1) / 2)
            rays = camera.rays((size, size))
            square, along = (rays**2).sum(-1), -rays[..., 2]
            truth = (along - np.sqrt(along**2 - square * (1 - 0.16))) / square
            normals = rays * truth[..., None] + [0, 0, 1.0]
        else:
            truth = np.sqrt(radius**2 - columns**2 - rows**2) / size
            normals = np.dstack([columns, -rows, truth * size])
        depth = Bilateral().integrate(normals, camera).depth
        if isinstance(camera, Pinhole):
            errors.append(np.std(np.log(depth / truth)))
        else:
            errors.append(np.std(depth / size - truth))
    assert errors[1] < 0.75 * errors[0] < 0.01


@pytest.mark.parametrize(
    "options",
    [{"steepness": -1.0}, {"steepness": np.nan}, {"settled": 1.0}, {"rounds": 0}, {"tolerance": 0.0}, {"threads": 0}],
)
def test_options_that_mean_nothing_are_refused(options):
    with pytest.raises(OptionError) as caught:
        Bilateral(**options)
    assert caught.value.remedy


def test_a_known_point_fixes_the_height_and_many_place_both_sides_of_a_cliff():
    rows, columns = np.indices((30, 32), dtype=float)
    normals = np.broadcast_to([0.3, 0.1, 1.0], (30, 32, 3)).copy()
    plane = -0.3 * columns + 0.1 * rows + 40.0
    one = np.full((30, 32), np.nan)
    one[4, 5] = plane[4, 5]
    found = Bilateral().integrate(normals, Orthographic(), prior=Prior(depth=one, sigma=0.1, unit="px"))
    np.testing.assert_allclose(found.depth, plane, atol=1e-6)
    cliff = plane + np.where(columns < 16, 25.0, 0.0)
    known = np.where((rows % 5 == 0) & (columns % 5 == 0), cliff, np.nan)
    found = Bilateral().integrate(normals, Orthographic(), prior=Prior(depth=known, sigma=0.1, unit="px"))
    apart = (columns <= 15) | (columns >= 20)  # in between nothing says where the cliff is
    assert np.abs(found.depth - cliff)[apart].max() < 0.01
