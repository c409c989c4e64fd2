import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from psstereo.errors import OptionError
from psstereo.matching import Noise

PARTS = st.fixed_dictionaries(
    {
        "read": st.floats(1e-5, 0.1),
        "step": st.floats(0, 0.01),
        "electrons": st.one_of(st.just(np.inf), st.floats(10, 1e6)),
        "relative": st.one_of(st.just(0.0), st.floats(1e-4, 0.3)),
    }
)


@given(PARTS, st.floats(0, 1), st.floats(0, 1))
def test_the_stabilised_scale_is_the_integral_of_one_over_sigma(parts, a, b):
    noise = Noise(**parts)
    low, high = min(a, b), max(a, b)
    x = low + (high - low) * np.linspace(0, 1, 8001) ** 4  # close together where sigma is small
    integral = np.trapezoid(1 / noise.sigma(x), x)
    below, above = noise.stabilised(np.array([low, high]))
    assert above - below == pytest.approx(integral, rel=1e-3, abs=1e-6)


def test_scatter_on_the_stabilised_scale_is_one():
    rng = np.random.default_rng(0)
    noise = Noise(read=0.002, electrons=5000, relative=0.01)
    for level in (0.05, 0.3, 0.9):
        values = level + noise.sigma(level) * rng.standard_normal(20_000)
        assert noise.stabilised(values).std() == pytest.approx(1, abs=0.03)


def test_below_zero_it_goes_on_in_a_line():
    noise = Noise(read=0.01, relative=0.1)
    np.testing.assert_allclose(noise.stabilised(np.array([-0.02, 0.0])), [-2.0, 0.0], atol=1e-12)


def test_scaled_values_have_scaled_noise():
    noise = Noise(read=0.002, step=0.001, electrons=3000, relative=0.02)
    np.testing.assert_allclose(noise.scaled(2.5).sigma(2.5 * 0.4), 2.5 * noise.sigma(0.4), rtol=1e-12)


@pytest.mark.parametrize(
    "parts", [{}, {"read": -1.0}, {"read": np.nan}, {"electrons": 0.0}, {"relative": np.inf}, {"step": -0.1, "read": 1}]
)
def test_noise_that_is_none_is_refused(parts):
    with pytest.raises(OptionError):
        Noise(**parts)
