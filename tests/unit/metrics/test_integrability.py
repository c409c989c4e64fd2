import numpy as np
import pytest

from psstereo.errors import InputError, OptionError
from psstereo.metrics import integrability

y, x = np.mgrid[1:-1:96j, -1:1:96j]


def _normals(height):
    down, right = np.gradient(height * 48)
    return np.stack([-right, down, np.ones_like(height)], axis=-1)


WAVES = _normals(0.3 * np.sin(3 * x + 1) * np.cos(4 * y) + 0.2 * x * y)
FLIP = np.array([1.0, -1.0, 1.0])


@pytest.mark.parametrize("step", [1, 2, 4])
def test_a_smooth_surface_has_no_curl(step):
    figures = integrability(WAVES, step=step)
    assert figures.relative_curl < 0.1
    assert figures.agreement > 0.99
    assert figures.blocks == (96 // step - 1) ** 2


def test_flipping_swaps_the_figures():
    plain, flipped = integrability(WAVES), integrability(WAVES * FLIP)
    assert flipped.relative_curl == pytest.approx(plain.relative_curl_flipped)
    assert flipped.agreement == pytest.approx(-plain.agreement)
    assert plain.relative_curl**2 + plain.relative_curl_flipped**2 == pytest.approx(2)


def test_noise_is_neither():
    noise = np.random.default_rng(3).normal((0, 0, 1), 0.2, (200, 200, 3))
    assert integrability(noise).relative_curl == pytest.approx(1, abs=0.05)


def test_a_cliff_does_not_outweigh_the_rest():
    assert integrability(_normals(WAVES[..., 0] * 0 + 0.3 * x * y + np.where(x > y, 0.5, 0))).agreement > 0.8


def test_wild_normals_do_not_outweigh_the_rest():
    """Without the weights the agreement is 0.01."""
    rng, wild = np.random.default_rng(4), WAVES.copy()
    bad = rng.random(x.shape) < 0.02
    wild[bad] = rng.normal((0, 0, 1), (2, 2, 0), (np.count_nonzero(bad), 3))
    assert integrability(wild, step=1).agreement > 0.7


def test_planes_and_separable_surfaces_say_nothing():
    assert np.isnan(integrability(_normals(0.3 * x + 0.2 * y)).relative_curl)
    assert np.isnan(integrability(_normals(x**2 + np.sin(3 * y))).agreement)


def test_mask_and_nan_take_pixels_out():
    mask = x**2 + y**2 < 0.5
    inside = np.where(mask[..., None], WAVES, np.nan)
    assert integrability(WAVES, mask) == integrability(inside)
    assert integrability(WAVES, mask).blocks < integrability(WAVES).blocks
    empty = integrability(WAVES, np.zeros_like(mask))
    assert empty.blocks == 0
    assert np.isnan(empty.relative_curl)


def test_float32_gives_the_same():
    assert integrability(WAVES.astype(np.float32)).agreement == pytest.approx(integrability(WAVES).agreement, abs=1e-5)


def test_bad_input_is_refused():
    with pytest.raises(InputError):
        integrability(WAVES[..., :2])
    with pytest.raises(InputError):
        integrability(WAVES, np.ones((3, 3), dtype=bool))
    with pytest.raises(OptionError):
        integrability(WAVES, step=0)
