"""Motion between exposures."""

import numpy as np
import pytest
from scipy.ndimage import fourier_shift

from psstereo.errors import OptionError
from psstereo_synth.faults import Draws, Motion


def bumps(height, width, right=0.0, down=0.0):
    """Return smooth bumps in three channels, shifted exactly."""
    rows, columns = np.indices((height, width), dtype=float)
    y, x = rows - height / 2 - down, columns - width / 2 - right
    channels = [np.exp(-((x - a) ** 2 + (y + a) ** 2) / (2 * s * s)) for a, s in ((0, 4.0), (3, 5.0), (-4, 6.0))]
    return np.stack(channels, axis=-1)


@pytest.mark.parametrize("kind", ["jitter", "walk"])
def test_the_content_moves_by_the_recorded_shift(kind):
    fault, draws = Motion(rms=0.9, kind=kind), Draws(4)
    shifts = fault.shifts(6, draws)
    image = bumps(64, 80)
    for index, (right, down) in enumerate(shifts):
        moved = fault.radiance(image, index, draws)
        assert np.abs(moved - bumps(64, 80, right, down)).max() < 3e-4  # of cubic splines on bumps this narrow
        weight = moved[..., 0].sum()
        rows, columns = np.indices((64, 80))
        assert (moved[..., 0] * columns).sum() / weight - 40 == pytest.approx(right, abs=1e-4)
        assert (moved[..., 0] * rows).sum() / weight - 32 == pytest.approx(down, abs=1e-4)


def test_splines_against_fourier():
    fault, draws = Motion(rms=0.6), Draws(1)
    right, down = fault.shift(3, draws)
    image = bumps(96, 96)
    moved = fault.radiance(image, 3, draws)
    for c in range(3):
        exact = np.fft.ifft2(fourier_shift(np.fft.fft2(image[..., c]), (down, right))).real
        assert np.abs(moved[..., c] - exact)[8:-8, 8:-8].max() < 3e-4


@pytest.mark.parametrize("kind", ["jitter", "walk"])
def test_the_first_image_stays(kind):
    fault = Motion(rms=2.0, kind=kind)
    image = bumps(20, 20)
    assert fault.radiance(image, 0, Draws(0)) is image
    assert (fault.shifts(3, Draws(0))[0] == 0).all()
    assert (fault.shifts(3, Draws(0))[1:] != 0).all()
    assert fault.shifts(0, Draws(0)).shape == (0, 2)


def test_jitter_is_even_over_a_square_of_the_right_size():
    shifts = Motion(rms=0.5).shifts(8001, Draws(2))[1:]
    half = 0.5 * np.sqrt(1.5)
    assert np.sqrt((shifts**2).sum(axis=1).mean()) == pytest.approx(0.5, rel=0.015)
    assert np.abs(shifts).max() <= half
    for axis in (0, 1):
        counts = np.histogram(shifts[:, axis], 10, (-half, half))[0]
        assert np.abs(counts / 800 - 1).max() < 0.15
    assert abs(np.corrcoef(shifts.T)[0, 1]) < 0.04
    assert abs(np.corrcoef(shifts[1:, 0], shifts[:-1, 0])[0, 1]) < 0.04


def test_a_walk_adds_up_steps_of_the_right_size():
    shifts = Motion(rms=0.5, kind="walk").shifts(3001, Draws(2))
    steps = np.diff(shifts, axis=0)
    assert np.sqrt((steps**2).sum(axis=1).mean()) == pytest.approx(0.5, rel=0.03)
    assert abs(np.corrcoef(steps[1:, 0], steps[:-1, 0])[0, 1]) < 0.06
    ends = [Motion(rms=0.5, kind="walk").shift(100, Draws(seed)) for seed in range(600)]
    assert np.sqrt((np.array(ends) ** 2).sum(axis=1).mean()) == pytest.approx(5.0, rel=0.07)


def test_edges_continue_and_constants_stay():
    fault, draws = Motion(rms=3.0), Draws(0)
    flat = np.full((15, 12, 2), 0.7)
    np.testing.assert_allclose(fault.radiance(flat, 5, draws), 0.7, rtol=1e-12)
    image = np.zeros((16, 16, 1))
    image[:, 8:] = 1.0  # a hard edge rings, but never below the dark
    moved = fault.radiance(image, 5, draws)
    assert (moved >= 0).all()
    np.testing.assert_allclose(moved[:, -1], 1.0, atol=0.05)


@pytest.mark.parametrize("options", [{"rms": -1.0}, {"rms": np.nan}, {"kind": "spin"}], ids=str)
def test_bad_options_are_refused(options):
    with pytest.raises(OptionError):
        Motion(**options)
