import numpy as np
import pytest

from psstereo.errors import OptionError
from psstereo.stack import LINEAR, Response


def srgb_encode(light):
    """IEC 61966-2-1, the direction that the camera takes."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def test_srgb_undoes_the_standard():
    light = np.linspace(0, 1, 1001)
    # The standard's two rounded thresholds do not meet exactly: 2e-8 at the joint.
    np.testing.assert_allclose(Response("srgb").linearise(srgb_encode(light), 1.0), light, rtol=0, atol=1e-7)
    encoded = np.array([0.02, 0.04045, 0.5])
    expected = [0.02 / 12.92, 0.04045 / 12.92, (0.555 / 1.055) ** 2.4]
    np.testing.assert_allclose(Response("srgb").linearise(encoded, 1.0), expected, rtol=1e-15)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.2])
def test_gamma_is_a_power(exponent):
    values = np.linspace(0, 1, 100)
    np.testing.assert_allclose(Response("gamma", exponent).linearise(values, 1.0), values**exponent, rtol=1e-15)


@pytest.mark.parametrize("response", [LINEAR, Response("srgb"), Response("gamma", 2.2)], ids=lambda r: r.name)
@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 65535), (np.uint16, 4095), (np.float32, 1)])
def test_black_stays_black_and_white_white(response, dtype, white):
    values = np.array([0, white], dtype)
    light = response.linearise(values, float(white))
    assert light.dtype == np.float32
    np.testing.assert_allclose(light, [0, white], rtol=1e-7)
    assert response.is_linear == (response is LINEAR)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_integers_and_floats_agree(dtype):
    top = np.iinfo(dtype).max
    values = np.arange(0, top + 1, 7, dtype=dtype)
    table = Response("srgb").linearise(values, float(top))
    np.testing.assert_allclose(table, Response("srgb").linearise(values / top, 1.0) * top, rtol=1e-6)


def test_not_a_number_stays_so():
    light = Response("srgb").linearise(np.array([np.nan, -1.0, 0.5]), 1.0)
    assert np.isnan(light[0])
    assert light[1] == 0.0


@pytest.mark.parametrize(("name", "exponent"), [("log", 1.0), ("gamma", 0.0), ("gamma", np.nan), ("gamma", 11.0)])
def test_unknown_curves_are_refused(name, exponent):
    with pytest.raises(OptionError):
        Response(name, exponent)
