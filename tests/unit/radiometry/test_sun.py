import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.radiometry import SOLAR_CONSTANT, SUN_RADIANCE, incidence_cosine, sun_irradiance, sun_radiance


def unit(rng, *shape):
    v = rng.normal(size=(*shape, 3))
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1e-9, 1e9))
def test_sun_there_and_back(seed, radiance):
    rng = np.random.default_rng(seed)
    normals, sun = unit(rng, 50), unit(rng)
    irradiance = sun_irradiance(radiance, normals, sun)
    lit = incidence_cosine(normals, sun) > 0
    back = sun_radiance(irradiance, normals, sun)
    np.testing.assert_allclose(back[lit], radiance, rtol=1e-14)
    assert np.isnan(back[~lit]).all()
    assert (irradiance[~lit] == 0).all()


def test_facing_the_sun_is_the_solar_constant():
    assert sun_irradiance(SUN_RADIANCE, [0, 0, 1], [0, 0, 1]) == pytest.approx(SOLAR_CONSTANT)


def test_unknown_normals_stay_unknown():
    irradiance = sun_irradiance(1.0, [[np.nan, 0, 1], [0, 0, 1]], [0, 0, 1], solid_angle=1e-4)
    assert np.isnan(irradiance[0])
    assert irradiance[1] == pytest.approx(1e-4)


def test_wrong_input_raises():
    with pytest.raises(InputError, match="normals"):
        sun_irradiance(1.0, [0, 0, 2], [0, 0, 1])
    with pytest.raises(InputError, match="direction"):
        sun_irradiance(1.0, [0, 0, 1], [0, 0, 0])
    with pytest.raises(InputError, match="radiance"):
        sun_irradiance(-1.0, [0, 0, 1], [0, 0, 1])
    with pytest.raises(InputError, match="solid angle"):
        sun_radiance(1.0, [0, 0, 1], [0, 0, 1], solid_angle=0.0)
