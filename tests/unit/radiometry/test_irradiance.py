import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.radiometry import incidence_cosine, narrow_irradiance, sphere_irradiance, sphere_solid_angle


def unit(rng, *shape):
    v = rng.normal(size=(*shape, 3))
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def test_broadcasting():
    rng = np.random.default_rng(0)
    normals, lights = unit(rng, 4, 5), unit(rng, 6)
    assert incidence_cosine(normals, lights[0]).shape == (4, 5)
    many = incidence_cosine(normals, lights[:, None, None, :])
    assert many.shape == (6, 4, 5)
    np.testing.assert_allclose(many, np.maximum(0, np.einsum("hwi,mi->mhw", normals, lights)), atol=1e-15)


def test_narrow_form_is_the_limit_of_the_sphere():
    distance = np.array([1e2, 1e4, 1e6])
    narrow = narrow_irradiance(3.0, sphere_solid_angle(1.0, distance), 0.5)
    exact = sphere_irradiance(3.0, 1.0, distance, 0.5)
    np.testing.assert_allclose(narrow / exact - 1, np.tan(np.arcsin(1 / distance) / 2) ** 2, rtol=1e-6, atol=1e-15)


def test_turned_away_is_dark():
    np.testing.assert_allclose(narrow_irradiance(2.0, 0.5, [-1.0, 0.0, 0.5, np.nan]), [0.0, 0.0, 0.5, np.nan])


def test_wrong_input_raises():
    with pytest.raises(InputError, match="radiance"):
        narrow_irradiance(-1.0, 1.0)
    with pytest.raises(InputError, match="solid angle"):
        narrow_irradiance(1.0, 13.0)
    with pytest.raises(InputError, match="cosine"):
        narrow_irradiance(1.0, 1.0, 1.5)
    with pytest.raises(InputError, match="normals"):
        incidence_cosine([0, 0, 0], [0, 0, 1])
