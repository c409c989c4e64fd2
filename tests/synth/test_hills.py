"""The hills: analytic slopes agree with the heights, seeds, and the disc."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo_synth import hills


def difference_error(size):
    """Return the largest difference between analytic slopes and central differences, inside."""
    surface = hills(size, size, seed=3)
    n, z = surface.normals, surface.height
    zx, zy = -n[..., 0] / n[..., 2], -n[..., 1] / n[..., 2]
    by_x = (z[:, 2:] - z[:, :-2])[1:-1] / 2
    by_y = (z[:-2] - z[2:])[:, 1:-1] / 2  # y is up, rows run down
    return max(np.abs(by_x - zx[1:-1, 1:-1]).max(), np.abs(by_y - zy[1:-1, 1:-1]).max())


def test_normals_are_the_gradient_of_the_heights_to_second_order():
    coarse, fine, finer = difference_error(64), difference_error(128), difference_error(256)
    assert finer < 1e-3
    assert 3.5 < coarse / fine < 4.5  # half the step, a quarter of the error
    assert 3.5 < fine / finer < 4.5


@settings(max_examples=25, deadline=None)
@given(st.integers(8, 60), st.integers(8, 60), st.integers(0, 2**32), st.floats(0, 5), st.integers(0, 30))
def test_any_hills_are_a_height_field(width, height, seed, steepness, count):
    surface = hills(width, height, seed=seed, steepness=steepness, count=count)
    assert surface.height.shape == surface.mask.shape == (height, width)
    assert surface.normals.shape == (height, width, 3)
    assert np.abs(np.linalg.norm(surface.normals, axis=-1) - 1).max() < 1e-14
    assert (surface.normals[..., 2] > 0).all()
    scale = max(np.abs(surface.height).max(), 1)
    assert abs(surface.height[surface.mask].mean()) < 1e-13 * scale
    assert np.array_equal(surface.mask, surface.mask[::-1, ::-1])  # centred


def test_the_mask_is_a_disc():
    mask = hills(200, 120).mask
    assert mask.sum() == pytest.approx(np.pi * (0.45 * 120) ** 2, rel=0.01)
    assert not mask[0].any()
    assert not mask[:, :40].any()


def test_without_hills_it_is_flat():
    surface = hills(10, 12, count=0)
    assert (surface.height == 0).all()
    assert (surface.normals == [0, 0, 1]).all()


def test_seeds_decide():
    first, again, other = hills(20, 20, seed=1), hills(20, 20, seed=1), hills(20, 20, seed=2)
    assert np.array_equal(first.height, again.height)
    assert not np.array_equal(first.height, other.height)


def test_steepness_scales_heights():
    one, two = hills(30, 30, steepness=0.5), hills(30, 30, steepness=1.0)
    assert np.allclose(two.height, 2 * one.height, rtol=1e-12, atol=1e-12)


def test_a_single_hill_is_as_steep_as_promised():
    surface = hills(400, 400, count=1, steepness=1.0, seed=4)
    slope = np.hypot(surface.normals[..., 0], surface.normals[..., 1]) / surface.normals[..., 2]
    assert 0.5 * 0.6 < slope.max() <= np.exp(-0.5) + 1e-9  # amplitudes are 0.5 to 1 of the steepness


@pytest.mark.parametrize("size", [(7, 20), (20, 7), (0, 0), (-5, 20)])
def test_too_small_an_image_is_refused(size):
    with pytest.raises(InputError, match=f"{size[0]} × {size[1]} pixels"):
        hills(*size)
