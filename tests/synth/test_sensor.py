"""The sensor: exact where it has no noise, and with the statistics of EMVA 1288 where it has."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.lights import Rig, StrengthUnit
from psstereo.stack import MemoryStack, Response
from psstereo_synth import expose
from psstereo_synth.sensor import Sensor

DEPTHS = [(8, np.uint8), (10, np.uint16), (12, np.uint16), (14, np.uint16), (16, np.uint16)]
CURVES = [Response(), Response("srgb"), Response("gamma", 2.2), Response("gamma", 0.6)]


def flat(value, side=400):
    return np.full((side, side, 3), float(value))


def ramp(low=0.0, high=1.0, shape=(200, 150, 3)):
    return np.random.default_rng(7).uniform(low, high, shape)


@pytest.mark.parametrize(("bits", "dtype"), DEPTHS)
def test_values_round_to_the_nearest_step_without_bias(bits, dtype):
    light = ramp(0.0, 3.0)
    sensor = Sensor(bits=bits, white=3.0)
    image = sensor.expose(light, 0)
    top = 2**bits - 1
    assert image.dtype == dtype == sensor.dtype
    assert sensor.white_value == top
    off = image - light / 3.0 * top
    assert np.abs(off).max() <= 0.5
    assert abs(off.mean()) < 4 * np.sqrt(1 / 12 / off.size)
    assert off.std() == pytest.approx(1 / np.sqrt(12), rel=0.01)


@pytest.mark.parametrize(("bits", "dtype"), DEPTHS)
def test_saturation_is_exact_at_white(bits, dtype):
    top = 2**bits - 1
    light = np.array([0.0, 1 - 0.51 / top, 1 - 0.49 / top, 1.0, 1.0 + 1e-9, 2.0, 1e300]).reshape(1, 7, 1) * 5.0
    image = Sensor(bits=bits, white=5.0).expose(light, 0)
    assert image.dtype == dtype
    assert image.ravel().tolist() == [0, top - 1, top, top, top, top, top]


def test_it_agrees_with_the_plain_exposure():
    light = ramp(0.0, 1.3)
    for bits in (8, 16, None):
        np.testing.assert_array_equal(Sensor(bits=bits, white=1.0).expose(light, 3), expose(light[None], bits=bits)[0])


def test_floats_go_on_beyond_full_scale():
    light = ramp(0.0, 10.0)
    image = Sensor(bits=None, white=4.0, dark_level=0.125).expose(light, 0)
    assert image.dtype == np.float64
    np.testing.assert_allclose(image, light / 4.0 + 0.125, rtol=1e-15)
    noisy = Sensor(bits=None, white=1.0, full_well=1e4, read_noise=20.0).expose(flat(0.0, 100), 0)
    assert (noisy < 0).mean() == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("response", CURVES, ids=lambda r: f"{r.name} {r.exponent}")
@pytest.mark.parametrize("bits", [8, 12, 16, None])
def test_response_curves_are_undone_by_the_library(response, bits):
    light = np.linspace(0.0, 1.0, 60000).reshape(200, 100, 3)
    sensor = Sensor(bits=bits, white=1.0, response=response)
    values = sensor.expose(light, 0)
    back = response.linearise(values.astype(np.float64), sensor.white_value) / sensor.white_value
    if bits is None:
        np.testing.assert_allclose(back, light, rtol=0, atol=1e-15)
        return
    # rounding moves a value by half a step at most, and the curve says what that is in light
    half = 0.5 + 1e-9
    up, down = (response.curve(np.clip((values + s) / sensor.white_value, 0, None)) for s in (half, -half))
    assert (back >= down).all()
    assert (light <= up).all()
    assert (light >= down).all()
    assert values.min() == 0
    assert values.max() == sensor.white_value


def test_srgb_against_its_definition():
    values = Sensor(bits=8, white=1.0, response=Response("srgb")).expose(np.array([[[0.002, 0.0214, 0.2140, 0.5]]]), 0)
    assert values.ravel().tolist() == [7, 40, 127, 188]


def test_dark_level_is_taken_off_by_a_dark_image():
    light = ramp(0.0, 0.9)
    sensor = Sensor(bits=12, white=1.0, dark_level=0.0625)
    assert sensor.dark_value == 0.0625 * 4095
    image = sensor.expose(light, 0)
    assert (sensor.expose(0 * light, 0) == 256).all()
    assert np.abs((image - sensor.dark_value) / 4095 - light).max() <= 0.5 / 4095 + 1e-12
    # the pedestal takes up part of the range
    assert sensor.expose(flat(0.9374, 2), 0).max() == 4095
    assert sensor.expose(flat(0.93, 2), 0).max() < 4095
    rig = Rig.distant([[0, 0, 1.0]], [1.0], strength_unit=StrengthUnit.IRRADIANCE)
    stack = MemoryStack(image[None], white=sensor.white_value)
    dark = np.full(image.shape, sensor.dark_value)
    capture = Capture(stack=stack, rig=rig, dark=dark, radiance_at_white=sensor.white)
    radiance = (capture.stack.frame(0) - capture.dark) / capture.stack.white * capture.radiance_at_white
    assert np.abs(radiance - light).max() < 1.3e-4


@pytest.mark.parametrize("shape", [(41, 61, 1), (40, 62, 3)])
def test_vignetting_is_the_fourth_power_of_the_cosine(shape):
    height, width, _ = shape
    loss = 0.4
    image = Sensor(bits=None, white=1.0, vignetting=loss).expose(np.ones(shape), 0)
    corner = np.hypot((height - 1) / 2, (width - 1) / 2)
    field = np.arccos((1 - loss) ** 0.25)  # of the corners
    for row, column in ((0, 0), (height - 1, 0), (height // 2, width // 2), (7, 50), (33, 12)):
        radius = np.hypot(row - (height - 1) / 2, column - (width - 1) / 2)
        angle = np.arctan(np.tan(field) * radius / corner)
        np.testing.assert_allclose(image[row, column], np.cos(angle) ** 4, rtol=1e-13)
    assert image.min() == pytest.approx(1 - loss, rel=1e-13)
    np.testing.assert_allclose(image, image[::-1, ::-1], rtol=1e-14)


def test_vignetting_of_one_pixel_and_none():
    assert Sensor(bits=None, white=1.0, vignetting=0.5).expose(np.ones((1, 1, 1)), 0) == 1.0
    np.testing.assert_array_equal(Sensor(bits=None, white=1.0, vignetting=0.0).expose(ramp(), 0), ramp())


@pytest.mark.parametrize("electrons", [4.0, 100.0, 2000.0, 30000.0])
def test_variance_of_photon_noise_is_the_mean(electrons):
    sensor = Sensor(bits=None, white=1.0, full_well=100_000.0, seed=2)
    counts = sensor.expose(flat(electrons / 1e5, 600), 0) * 1e5
    assert np.abs(counts - np.rint(counts)).max() < 1e-9  # whole electrons
    assert counts.var() == pytest.approx(electrons, rel=0.01)
    assert counts.mean() == pytest.approx(electrons, abs=4 * np.sqrt(electrons / counts.size))


@pytest.mark.parametrize(("bits", "gain"), [(12, 1.0), (14, 1.0), (14, 4.0), (16, 0.5)])
def test_photon_transfer_curve(bits, gain):
    """Variance over mean is a line: its slope is the system gain, and what it starts from the read noise."""
    well, read = 15_000.0, 6.0
    sensor = Sensor(bits=bits, white=1.0, full_well=well, read_noise=read, gain=gain, dark_level=0.02, seed=4)
    system = sensor.white_value * gain / well  # [steps per electron]
    levels = np.linspace(0.0, 0.85 * min(gain, 1.0), 16)
    means, variances = [], []
    for index, level in enumerate(levels):
        image = sensor.expose(flat(level), index).astype(np.float64) - sensor.dark_value
        means.append(image.mean())
        variances.append(image.var())
    slope, start = np.polyfit(means, variances, 1, w=1 / np.array(variances))
    assert slope == pytest.approx(system, rel=0.005)
    assert start == pytest.approx((read * system) ** 2 + 1 / 12, rel=0.01)
    np.testing.assert_allclose(means, levels * sensor.white_value, rtol=0, atol=0.02 * sensor.white_value / 100)


@pytest.mark.parametrize("read", [1.5, 12.0])
def test_read_noise_in_the_dark(read):
    sensor = Sensor(bits=None, white=1.0, full_well=8000.0, read_noise=read)
    dark = sensor.expose(flat(0.0), 0) * 8000.0
    assert dark.std() == pytest.approx(read, rel=0.006)
    assert abs(dark.mean()) < 4 * read / np.sqrt(dark.size)


@pytest.mark.parametrize("bits", [8, 12, 16, None])
@pytest.mark.parametrize("response", CURVES, ids=lambda r: f"{r.name} {r.exponent}")
def test_noise_is_what_it_is_said_to_be(bits, response):
    sensor = Sensor(
        bits=bits, white=2.0, full_well=3000.0, read_noise=8.0, gain=1.5, prnu=0.01, dark_level=0.05, response=response
    )
    for share in (0.06, 0.3, 0.8):
        values = sensor.expose(flat(2.0 * share), 1).astype(np.float64)
        light = response.linearise(values, sensor.white_value) / sensor.white_value - 0.05
        assert light.std() == pytest.approx(float(sensor.noise_sigma(share)), rel=0.01)
        assert light.mean() == pytest.approx(share, abs=0.002)


@pytest.mark.parametrize("response", CURVES, ids=lambda r: f"{r.name} {r.exponent}")
def test_rounding_alone_is_what_it_is_said_to_be(response):
    sensor = Sensor(bits=8, white=1.0, response=response)
    for share in (0.2, 0.7):
        light = ramp(share - 0.05, share + 0.05, (300, 300, 3))
        back = response.linearise(sensor.expose(light, 0).astype(np.float64), 255.0) / 255.0
        expected = np.sqrt((sensor.noise_sigma(light) ** 2).mean())
        assert (back - light).std() == pytest.approx(expected, rel=0.02)


def test_noise_of_a_perfect_sensor_and_of_odd_values():
    assert Sensor(bits=None).noise_sigma(0.5) == 0.0
    sigma = Sensor(full_well=1e4).noise_sigma(np.array([[-0.1, 0.0, np.nan]]))
    assert sigma.shape == (1, 3)
    assert sigma[0, 0] == sigma[0, 1] == pytest.approx(1 / 65535 / np.sqrt(12))
    assert np.isnan(sigma[0, 2])


def test_the_sensitivity_pattern_stays_the_same():
    sensor = Sensor(bits=None, white=1.0, full_well=1e6, prnu=0.02, seed=1)
    images = np.stack([sensor.expose(flat(0.5, 200), i) for i in range(24)])
    pattern = images.mean(axis=0) / 0.5 - 1
    assert pattern.std() == pytest.approx(0.02, rel=0.01)
    assert (images - images.mean(axis=0)).std(ddof=0) == pytest.approx(np.sqrt(0.5e-6 * 23 / 24), rel=0.01)
    exact = Sensor(bits=None, white=1.0, prnu=0.02, seed=1).expose(flat(0.5, 200), 0)
    assert np.corrcoef(pattern.ravel(), exact.ravel())[0, 1] > 0.995
    other = Sensor(bits=None, white=1.0, prnu=0.02, seed=2).expose(flat(0.5, 200), 0)
    assert abs(np.corrcoef(other.ravel(), exact.ravel())[0, 1]) < 0.02
    assert (Sensor(bits=None, white=1.0, prnu=5.0).expose(flat(0.5, 50), 0) >= 0).all()  # no negative sensitivity


def test_the_full_well_ends_before_full_scale_at_low_gain():
    sensor = Sensor(bits=16, white=1.0, full_well=10_000.0, gain=0.5)
    image = sensor.expose(flat(0.9, 50), 0)
    assert (image == round(0.5 * 65535)).all()
    noisy = Sensor(bits=None, white=1.0, full_well=10_000.0, gain=0.5, read_noise=30.0).expose(flat(0.9), 0)
    assert noisy.std() == pytest.approx(30 * 0.5 / 10_000, rel=0.01)  # what is left is read noise


def test_gain_makes_the_same_exposure_noisier():
    quiet, loud = (Sensor(bits=None, white=1.0, full_well=1e4, gain=g).expose(flat(0.2), 0) for g in (1.0, 4.0))
    assert loud.mean() == pytest.approx(quiet.mean(), rel=1e-3)
    assert loud.std() / quiet.std() == pytest.approx(2.0, rel=0.01)


def test_neighbours_channels_and_images_are_independent():
    sensor = Sensor(bits=None, white=1.0, full_well=5000.0, read_noise=10.0)
    a, b = (sensor.expose(flat(0.4), i) for i in (0, 1))
    other = Sensor(bits=None, white=1.0, full_well=5000.0, read_noise=10.0, seed=1).expose(flat(0.4), 0)
    pairs = [(a, b), (a, other), (a[:, 1:], a[:, :-1]), (a[1:], a[:-1]), (a[..., 0], a[..., 1])]
    for first, second in pairs:
        assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 4 / np.sqrt(first.size)


@pytest.mark.parametrize("bits", [8, 12, None])
def test_same_bytes_in_any_order_and_on_any_number_of_threads(bits):
    light = ramp(0.0, 1.1, (97, 131, 3))
    sensor = Sensor(bits=bits, white=1.0, full_well=900.0, read_noise=2.0, prnu=0.01, vignetting=0.2, seed=6)
    images = [sensor.expose(light, i) for i in range(12)]
    for i in reversed(range(12)):
        np.testing.assert_array_equal(sensor.expose(light, i), images[i])
    for threads in (1, 4):
        with ThreadPoolExecutor(threads) as pool:
            again = list(pool.map(lambda i: sensor.expose(light, i), [5, 3, 11, 0, 7, 1, 2, 10, 4, 6, 9, 8]))
        for i, image in zip([5, 3, 11, 0, 7, 1, 2, 10, 4, 6, 9, 8], again, strict=True):
            assert image.tobytes() == images[i].tobytes()
    assert not np.array_equal(images[0], images[1])


def test_without_noise_the_index_and_the_seed_do_not_matter():
    light = ramp()
    first = Sensor(white=1.0, dark_level=0.1, vignetting=0.3, seed=0).expose(light, 0)
    second = Sensor(white=1.0, dark_level=0.1, vignetting=0.3, seed=5).expose(light, 9)
    np.testing.assert_array_equal(first, second)


def test_the_input_is_left_alone_whatever_its_type():
    for kind in (np.float64, np.float32, np.int32):
        light = (ramp() * 100).astype(kind)
        light.flags.writeable = False
        kept = light.copy()
        image = Sensor(white=100.0, full_well=500.0, vignetting=0.1, response=Response("srgb")).expose(light, 0)
        assert image.flags.c_contiguous
        np.testing.assert_array_equal(light, kept)
    turned = ramp().transpose(1, 0, 2)
    straight = np.ascontiguousarray(turned)
    sensor = Sensor(white=1.0, full_well=500.0)
    np.testing.assert_array_equal(sensor.expose(turned, 0), sensor.expose(straight, 0))


def test_wide_images_are_worked_on_row_by_row():
    image = Sensor(bits=8, white=1.0, vignetting=0.5).expose(np.ones((3, 40_000, 1)), 0)
    assert image[1, 20_000, 0] == 255
    assert image[0, 0, 0] == 128


def test_the_exposure_must_be_said():
    sensor = Sensor(bits=8)
    with pytest.raises(OptionError, match="with_white"):
        sensor.expose(ramp(), 0)
    assert sensor.with_white(2.0) == Sensor(bits=8, white=2.0)
    assert sensor.with_white(2.0).expose(flat(1.0, 2), 0).max() == 128


@pytest.mark.parametrize("bad", [-1e-9, np.nan, np.inf, -np.inf])
def test_radiances_that_cannot_be_are_refused(bad):
    light = ramp()
    light[199, 149, 2] = bad
    for sensor in (Sensor(white=1.0), Sensor(white=1.0, full_well=100.0), Sensor(bits=None, white=1.0)):
        with pytest.raises(InputError, match="zero or more"):
            sensor.expose(light, 0)


@pytest.mark.parametrize("shape", [(4, 4), (0, 4, 3), (1, 4, 4, 3), (4, 4, 0)])
def test_other_shapes_are_refused(shape):
    with pytest.raises(InputError, match="shape"):
        Sensor(white=1.0).expose(np.zeros(shape), 0)


@pytest.mark.parametrize(
    "options",
    [
        {"bits": 9},
        {"bits": 0},
        {"white": 0.0},
        {"white": -1.0},
        {"white": np.nan},
        {"full_well": 0.0},
        {"full_well": np.inf},
        {"full_well": 1e4, "read_noise": -1.0},
        {"full_well": 1e4, "read_noise": np.nan},
        {"full_well": 1e4, "gain": 0.0},
        {"full_well": 1e4, "gain": np.inf},
        {"prnu": -0.1},
        {"dark_level": -0.1},
        {"dark_level": 1.0},
        {"vignetting": 1.0},
        {"vignetting": np.nan},
        {"seed": -1},
        {"seed": 0.5},
        {"read_noise": 1.0},
        {"gain": 2.0},
    ],
    ids=str,
)
def test_options_that_cannot_be_are_refused(options):
    with pytest.raises(OptionError) as caught:
        Sensor(**options)
    assert caught.value.given
    assert caught.value.remedy
