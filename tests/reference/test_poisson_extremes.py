"""Plain integration where it is hard: steep, torn, coarse and large; sizes at which the compiled loops work."""

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import Poisson
from psstereo.depth.domain import COMPILED
from psstereo.results import Outcome

CAMERA = Orthographic()
SIDE = 330
assert SIDE**2 > COMPILED


def ball(side=SIDE):
    """Return heights, normals and mask of a ball's cap, which the chord rule gets right whatever the sampling."""
    v, u = np.indices((side, side)) - (side - 1) / 2
    radius = 0.52 * side
    square = u**2 + v**2
    mask = square < (0.45 * side) ** 2
    height = np.sqrt(np.where(mask, radius**2 - square, radius**2))
    return height, np.dstack([u, -v, height]) / radius, mask


def deviation(depth, height, mask):
    used = mask & np.isfinite(depth)
    return float(np.std((depth - height)[used]))


def test_a_slope_of_ten_thousand():
    """A wall between two floors: 10⁴ pixels high over one column."""
    normals = np.zeros((SIDE, SIDE, 3))
    normals[..., 2] = 1.0
    normals[:, 160:162] = (-1.0, 0.0, 1e-4)
    result = Poisson().integrate(normals, CAMERA)
    assert result.outcome is Outcome.SOLVED
    # Floor to wall is a mid normal of 45 degrees, wall to wall the slope itself.
    rise = result.depth[:, 161] - result.depth[:, 160]
    np.testing.assert_allclose(rise, 1e4, rtol=1e-6)
    assert np.ptp(result.depth[:, :160]) < 1e-4


def test_bridges_of_one_pixel_hold_rooms_together():
    height, normals, _ = ball()
    mask = np.ones((SIDE, SIDE), bool)
    mask[::30] = mask[:, ::30] = False
    mask[::30, 15::30] = mask[15::30, ::30] = True
    mask &= ball()[2]
    result = Poisson().integrate(normals, CAMERA, mask=mask)
    largest = result.components == np.bincount(result.components[mask]).argmax()
    assert largest.sum() > 0.9 * mask.sum()
    assert deviation(result.depth, height, largest) < 1e-6
    assert result.iterations <= 25


def test_ten_thousand_islands():
    rows, columns = np.indices((410, 410))
    mask = (rows % 4 < 3) & (columns % 4 < 3)
    mask &= (rows < 404) & (columns < 404)
    height, normals, _ = ball(410)
    normals = np.where(normals[..., 2:] > 0.05, normals, [0.0, 0.0, 1.0])
    result = Poisson().integrate(normals, CAMERA, mask=mask)
    assert result.facts["components"] == 101**2
    assert result.outcome is Outcome.SOLVED
    labels = result.components[mask]
    inner = ball(410)[2][mask]
    truth = height[mask] - (np.bincount(labels, height[mask]) / np.maximum(np.bincount(labels), 1))[labels]
    whole = np.bincount(labels, ~inner)[labels] == 0
    assert np.abs(result.depth[mask] - truth)[whole].max() < 1e-9


def test_holes_without_a_normal():
    height, normals, mask = ball()
    rng = np.random.default_rng(0)
    holes = rng.random(mask.shape) < 0.05
    holes[100:140, 150:170] = True
    result = Poisson().integrate(np.where(holes[..., None], np.nan, normals), CAMERA, mask=mask)
    assert result.outcome is Outcome.PARTIAL
    assert result.facts["left_out"]["no_normal"] == np.count_nonzero(holes & mask)
    largest = result.components == np.bincount(result.components[mask & ~holes]).argmax()
    assert deviation(result.depth, height, largest) < 1e-6
    assert result.iterations <= 15


def test_single_precision_normals_differ_by_their_rounding():
    height, normals, mask = ball()
    single = Poisson().integrate(normals.astype(np.float32), CAMERA, mask=mask).depth
    double = Poisson().integrate(normals, CAMERA, mask=mask).depth
    assert deviation(double, height, mask) < 1e-8
    assert 1e-9 < np.nanmax(np.abs(single - double)) < 2e-5


def test_eight_bits_cost_a_fiftieth_of_a_pixel():
    height, normals, mask = ball()
    coarse = np.round((normals + 1) * 127.5) / 127.5 - 1
    assert deviation(Poisson().integrate(coarse, CAMERA, mask=mask).depth, height, mask) < 0.02
    fine = np.round((normals + 1) * 32767.5) / 32767.5 - 1
    assert deviation(Poisson().integrate(fine, CAMERA, mask=mask).depth, height, mask) < 1e-4


def test_noise_is_weighed_down_where_it_is_known():
    height, normals, mask = ball()
    rng = np.random.default_rng(1)
    rows, columns = np.indices(mask.shape)
    blots = (rows % 40 < 25) & (columns % 40 < 25)
    sigma = np.where(blots, 0.06, 0.002)
    noisy = normals + sigma[..., None] * rng.normal(size=normals.shape)
    plain = deviation(Poisson().integrate(noisy, CAMERA, mask=mask).depth, height, mask)
    weighed = Poisson().integrate(noisy, CAMERA, mask=mask, weights=1.0 / sigma**2).depth
    assert deviation(weighed, height, mask & ~blots) < 0.3 * plain


@pytest.mark.parametrize("camera", [CAMERA, Pinhole(fx=500.0, fy=480.0, cx=160.0, cy=150.0, skew=3.0)])
def test_a_camera_without_a_matrix_gives_the_same(camera, monkeypatch):
    _, normals, mask = ball()
    normals = normals * [0.3, 0.3, 1.0]
    by_matrix = Poisson().integrate(normals, camera, mask=mask).depth
    monkeypatch.setattr("psstereo.depth.domain._matrices", lambda _camera: (None, None))
    by_array = Poisson().integrate(normals, camera, mask=mask).depth
    np.testing.assert_allclose(by_array, by_matrix, rtol=1e-9, atol=1e-8)


def test_threads_and_layout_of_the_input_change_no_byte():
    height, normals, mask = ball()
    one = Poisson().integrate(normals, CAMERA, mask=mask).depth.tobytes()
    assert Poisson(threads=3).integrate(normals, CAMERA, mask=mask).depth.tobytes() == one
    assert Poisson().integrate(np.asfortranarray(normals), CAMERA, mask=mask).depth.tobytes() == one
    wide = np.repeat(normals, 2, axis=1)[:, ::2]
    assert Poisson().integrate(wide, CAMERA, mask=np.asfortranarray(mask)).depth.tobytes() == one
    assert height.shape == mask.shape


def test_a_crease_pulls_less_than_an_arc():
    """A ramp beside a floor, its foot in the middle between two pixels: exact either way; torn, it keeps its shape."""
    height, normals, mask = ball()
    cliff = normals.copy()
    cliff[:, 165:] = (0.0, 0.5, 1.0)  # another surface to the right, of unknown height
    truth = np.where(np.arange(SIDE) < 165, height, 0.5 * np.indices(mask.shape)[0])
    found = {}
    for turn in (None, np.radians(8.0)):
        depth = Poisson(turn=turn).integrate(cliff, CAMERA, mask=mask).depth
        found[turn] = deviation(depth[:, :165], truth[:, :165], mask[:, :165])
    assert found[np.radians(8.0)] < 0.6 * found[None]
