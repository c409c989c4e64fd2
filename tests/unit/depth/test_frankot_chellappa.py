import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth.frankot_chellappa import FrankotChellappa
from psstereo.errors import UnsupportedError

CAMERA = Orthographic(pixel_size=0.25, length_unit="mm")


def waves(shape):
    """Return heights and normals of a surface that repeats, of waves down to three pixels."""
    rows, columns = np.indices(shape)
    height, right, down = np.zeros((3, *shape))
    rng = np.random.default_rng(2)
    for _ in range(12):
        k, m = rng.integers(0, shape[0] // 3 + 1), rng.integers(0, shape[1] // 3 + 1)
        if (k, m) == (0, 0):
            continue
        a, phase = rng.normal(), rng.uniform(0, 6)
        u, v = 2 * np.pi * m / shape[1], 2 * np.pi * k / shape[0]
        height += a * np.sin(u * columns + v * rows + phase)
        right += a * u * np.cos(u * columns + v * rows + phase)
        down += a * v * np.cos(u * columns + v * rows + phase)
    return height, np.dstack([-right / 0.25, down / 0.25, np.ones(shape)])


@pytest.mark.parametrize("shape", [(32, 40), (31, 40), (30, 45), (17, 23), (1, 12), (9, 1), (1, 1)])
def test_a_surface_that_repeats_is_exact(shape):
    height, normals = waves(shape)
    result = FrankotChellappa().integrate(normals, CAMERA)
    np.testing.assert_allclose(result.depth, height - height.mean(), rtol=0, atol=1e-11 * max(np.ptp(height), 1.0))
    assert result.unit == "mm"


def test_threads_change_no_byte():
    _, normals = waves((64, 48))
    one, two = (FrankotChellappa(threads=threads).integrate(normals, CAMERA).depth for threads in (1, 2))
    assert one.tobytes() == two.tobytes()


@pytest.mark.parametrize("case", ["mask", "hole", "weights", "pinhole"])
def test_what_a_transform_cannot_do_is_refused(case):
    _, normals = waves((12, 14))
    mask, weights, camera = None, None, CAMERA
    if case == "mask":
        mask = np.ones((12, 14), bool)
        mask[0] = False
    elif case == "hole":
        normals[4, 5] = np.nan
    elif case == "weights":
        weights = np.ones((12, 14))
    else:
        camera = Pinhole(fx=100.0, fy=100.0, cx=6.0, cy=7.0)
    with pytest.raises(UnsupportedError, match="poisson"):
        FrankotChellappa().integrate(normals, camera, mask=mask, weights=weights)
