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


def test_a_curve_goes_through_its_knots_and_rises_between_them():
    values, light = np.array([0, 0.1, 0.35, 0.36, 0.8, 1.0]), np.array([0, 0.004, 0.2, 0.2, 0.5, 1.0])
    curve = Response.from_knots(values, light)
    np.testing.assert_allclose(curve.curve(values), light, atol=1e-12)
    fine = curve.curve(np.linspace(0, 1.2, 500))
    assert (np.diff(fine) >= 0).all()
    assert fine[-1] > 1
    table = curve.linearise(np.arange(256, dtype=np.uint8), 255.0)
    np.testing.assert_allclose(table, curve.curve(np.arange(256) / 255.0) * 255, rtol=1e-6)
    assert hash(curve) == hash(Response.from_knots(values, light))


@pytest.mark.parametrize(
    "knots",
    [
        ((0, 0),),
        ((0, 0), (1, 0.9)),
        ((0, 0.1), (1, 1)),
        ((0, 0), (0.5, 0.6), (0.7, 0.5), (1, 1)),
        ((0, 0), (np.nan, 1)),
    ],
)
def test_hostile_knots_are_refused(knots):
    with pytest.raises(OptionError, match="knots"):
        Response("curve", knots=knots)


@pytest.mark.parametrize("given", [{"name": "curve"}, {"name": "gamma", "exponent": 2.0, "knots": ((0, 0), (1, 1))}])
def test_knots_belong_to_curves(given):
    with pytest.raises(OptionError, match="knots"):
        Response(**given)
