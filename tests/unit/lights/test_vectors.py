import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from psstereo.errors import RigError
from psstereo.lights.vectors import strengths, unit_vector


@given(st.tuples(*[st.floats(-1e300, 1e300)] * 3))
def test_any_finite_vector_but_zero_becomes_a_unit_vector(v):
    if not any(v):
        with pytest.raises(RigError):
            unit_vector(v, "axis")
        return
    u = unit_vector(v, "axis")
    assert np.linalg.norm(u) == pytest.approx(1.0, abs=4e-16)
    largest = int(np.argmax(np.abs(v)))
    # the same direction: ratios to the largest component stay (those below 1e-300 of it may vanish)
    np.testing.assert_allclose(u / u[largest], np.array(v) / v[largest], rtol=1e-14, atol=1e-300)
    assert np.sign(u[largest]) == np.sign(v[largest])


@pytest.mark.parametrize(("given_", "expected"), [(2, [2.0]), ([1, 2, 3], [1.0, 2.0, 3.0])])
def test_strengths_are_one_a_channel(given_, expected):
    s = strengths(given_, "flux")
    assert s.tolist() == expected
    assert s.dtype == np.float64
    assert not s.flags.writeable
