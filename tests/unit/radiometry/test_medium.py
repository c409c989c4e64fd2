import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.radiometry import transmittance


@pytest.mark.parametrize("depth", [1e-12, 0.3, 1.0, 20.0, 700.0])
def test_beer_and_lambert(depth):
    with mp.workdps(30):
        want = float(mp.exp(-mp.mpf(depth)))
    assert float(transmittance(2.0 * depth, 0.5)) == pytest.approx(want, rel=1e-15, abs=0)


@given(st.floats(0, 50), st.floats(0, 50), st.floats(0, 3))
def test_ways_one_after_the_other_multiply(first, second, extinction):
    both = transmittance(first, extinction) * transmittance(second, extinction)
    assert float(transmittance(first + second, extinction)) == pytest.approx(float(both), rel=1e-12)


def test_nothing_takes_nothing_and_infinity_takes_all_that_can_be_taken():
    assert transmittance(0.0, 3.0) == 1.0
    assert transmittance(np.inf, 0.0) == 1.0
    assert transmittance(np.inf, 1e-9) == 0.0
    assert transmittance([1.0, np.inf], [[0.0], [2.0]]).tolist() == [[1.0, 1.0], [float(np.exp(-2.0)), 0.0]]


def test_what_is_not_known_stays_so():
    assert np.isnan(transmittance([np.nan, 1.0], 0.0)).tolist() == [True, False]
    assert np.isnan(transmittance(1.0, [np.nan, 0.0])).tolist() == [True, False]


@pytest.mark.parametrize(
    ("distance", "extinction"), [(-1, 1), (1, -1), (np.nan, 1), (1, np.nan), (1, np.inf), ([-1], 1)]
)
def test_what_means_nothing_is_refused(distance, extinction):
    with pytest.raises(InputError, match=r"distance|extinction"):
        transmittance(distance, extinction)
