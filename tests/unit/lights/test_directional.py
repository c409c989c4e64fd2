import numpy as np
import pytest

from psstereo.errors import RigError
from psstereo.lights import Directional


def test_irradiance_is_strength_times_cosine():
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(100, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    light = Directional(direction=[0.0, 3.0, 4.0], strength=[2.0, 0.5])
    expected = [[s * max(0.0, 0.6 * n[1] + 0.8 * n[2]) for s in (2.0, 0.5)] for n in normals]
    np.testing.assert_allclose(light.irradiance(np.zeros((100, 3)), normals), expected, rtol=0, atol=4e-16)


def test_a_sun_is_radiance_times_solid_angle():
    sun = Directional.sun([0, 0, 2], radiance=2.0e7, solid_angle=6.8e-5)
    assert sun.irradiance(np.zeros(3), np.array([0.0, 0.6, 0.8])) == pytest.approx([1360 * 0.8], rel=1e-15)


@pytest.mark.parametrize("direction", [[1.0, 2.0], [0.0, 0.0, 0.0], [np.nan, 0, 1], [[0, 0, 1]], 3.0])
def test_directions_that_are_none_are_refused(direction):
    with pytest.raises(RigError, match="light direction"):
        Directional(direction=direction, strength=1.0)
