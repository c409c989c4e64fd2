import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import Poisson, with_distance
from psstereo.errors import InputError, UnsupportedError

PINHOLE = Pinhole(fx=100.0, fy=100.0, cx=4.0, cy=3.0)


def result(camera, mask=None):
    normals = np.broadcast_to([0.2, -0.1, 1.0], (7, 9, 3))
    return Poisson().integrate(normals, camera, mask=mask)


def test_the_median_becomes_the_distance_and_shape_stays():
    before = result(PINHOLE)
    after = with_distance(before, distance=1500.0, unit="mm")
    assert np.median(after.depth) == pytest.approx(1500.0)
    assert after.unit == "mm"
    np.testing.assert_allclose(after.depth / before.depth, after.depth[0, 0] / before.depth[0, 0])
    assert after.facts["components_relative_scale_known"] is True
    assert before.unit == "relative"


def test_several_components_are_said_to_have_unknown_relative_scale():
    mask = np.ones((7, 9), bool)
    mask[:, 4] = False
    after = with_distance(result(PINHOLE, mask), distance=2.0, unit="m")
    assert np.nanmedian(after.depth) == pytest.approx(2.0)
    assert after.facts["components_relative_scale_known"] is False


@pytest.mark.parametrize("distance", [0.0, -1.0, np.nan, np.inf])
def test_a_distance_that_is_none_is_refused(distance):
    with pytest.raises(InputError, match="positive length"):
        with_distance(result(PINHOLE), distance=distance, unit="mm")


def test_heights_have_no_free_scale():
    with pytest.raises(UnsupportedError, match="heights"):
        with_distance(result(Orthographic()), distance=1.0, unit="mm")
