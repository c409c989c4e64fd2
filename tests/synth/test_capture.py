"""Synthetic captures: the images are the forward model, rounded and noisy as said."""

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.lights import StrengthUnit
from psstereo.normals import LeastSquares, estimate_normals
from psstereo.results import AlbedoKind
from psstereo_synth import checker, expose, hills, lambertian_capture, ring, spiral

SURFACE = hills(40, 32, steepness=2.0)
ALBEDO = checker((32, 40), tint=True)
LIGHTS = spiral(7)
STRENGTHS = np.random.default_rng(2).uniform(500, 1500, (7, 3))


def by_hand(strengths):
    """Return radiance by plain loops, (m, h, w, c): ρ E max(0, n·l) with ρ = albedo/π."""
    out = np.zeros((7, 32, 40, 3))
    for i, light in enumerate(LIGHTS):
        cosine = np.maximum(0, (SURFACE.normals * light).sum(axis=-1)) * SURFACE.mask
        for c in range(3):
            out[i, ..., c] = ALBEDO[..., c] / np.pi * strengths[i, c] * cosine
    return out


def frames(capture):
    return np.stack([capture.stack.frame(i) for i in range(len(capture.stack))])


def test_floats_are_the_forward_model():
    capture, truth = lambertian_capture(SURFACE, ALBEDO, LIGHTS, STRENGTHS, bits=None)
    images = frames(capture)
    assert images.dtype == np.float64
    assert images.max() == pytest.approx(0.9, rel=1e-14)
    assert np.allclose(images * capture.radiance_at_white, by_hand(STRENGTHS), rtol=1e-12, atol=1e-12 * 306)
    assert (images == 0).sum() > (~SURFACE.mask).sum() * 7 * 3  # attached shadows
    assert truth.normals is SURFACE.normals
    assert truth.depth is SURFACE.height
    assert truth.albedo is ALBEDO
    assert np.array_equal(capture.mask, SURFACE.mask)
    assert capture.rig.strength_unit is StrengthUnit.IRRADIANCE
    assert np.allclose(capture.rig.strengths(3), STRENGTHS)


@pytest.mark.parametrize(("bits", "dtype"), [(8, np.uint8), (16, np.uint16)])
def test_sensors_round_to_the_nearest_step(bits, dtype):
    exact = frames(lambertian_capture(SURFACE, ALBEDO, LIGHTS, STRENGTHS, bits=None)[0])
    images = frames(lambertian_capture(SURFACE, ALBEDO, LIGHTS, STRENGTHS, bits=bits)[0])
    assert images.dtype == dtype
    off = images - exact * (2**bits - 1)
    assert np.abs(off).max() <= 0.5 + 1e-9
    lit = exact > 0
    assert off[lit].std() == pytest.approx(1 / np.sqrt(12), rel=0.05)  # the spread of rounding


@pytest.mark.parametrize("sigma", [0.002, 0.03])
def test_noise_has_the_spread_that_was_asked_for(sigma):
    image = np.full((4, 50, 50, 3), 0.5)
    noisy = expose(image, bits=None, noise=sigma, seed=9) - 0.5
    assert noisy.std() == pytest.approx(sigma, rel=0.02)
    assert abs(noisy.mean()) < 4 * sigma / np.sqrt(noisy.size)
    rounded = expose(image, bits=16, noise=sigma, seed=9) / 65535 - 0.5
    assert np.abs(rounded - noisy).max() <= 0.51 / 65535
    other = expose(image, bits=None, noise=sigma, seed=10) - 0.5
    assert abs(np.corrcoef(noisy.ravel(), other.ravel())[0, 1]) < 0.03
    assert abs(np.corrcoef(noisy[0].ravel(), noisy[1].ravel())[0, 1]) < 0.06


def test_seeds_decide_and_more_images_leave_the_first_alone():
    image = np.full((5, 6, 7, 1), 0.4)
    first = expose(image, bits=16, noise=0.01, seed=1)
    assert np.array_equal(first, expose(image, bits=16, noise=0.01, seed=1))
    assert not np.array_equal(first, expose(image, bits=16, noise=0.01, seed=2))
    assert np.array_equal(first[:3], expose(image[:3], bits=16, noise=0.01, seed=1))
    assert (image == 0.4).all()  # the input is not touched


def test_values_beyond_full_scale_are_clipped():
    image = np.array([-0.5, 0.0, 0.5, 1.0, 1.7]).reshape(1, 1, 5, 1)
    assert expose(image, bits=8).ravel().tolist() == [0, 0, 128, 255, 255]
    assert expose(image, bits=16).ravel().tolist() == [0, 0, 32768, 65535, 65535]
    assert np.array_equal(expose(image, bits=None), image)


@pytest.mark.parametrize("bits", [1, 12, 32, 0])
def test_other_depths_are_refused(bits):
    with pytest.raises(InputError, match=f"{bits} bits"):
        expose(np.zeros((1, 2, 2, 1)), bits=bits)


def test_a_surface_in_the_dark_is_refused():
    with pytest.raises(InputError, match="black under every light"):
        lambertian_capture(SURFACE, ALBEDO, -spiral(4, max_tilt=0.1))
    with pytest.raises(InputError, match="black under every light"):
        lambertian_capture(SURFACE, 0 * ALBEDO, LIGHTS)


def test_albedo_comes_back_in_absolute_units():
    surface = hills(40, 32, steepness=0.2)
    capture, truth = lambertian_capture(surface, checker((32, 40)), ring(6), bits=None)
    result = estimate_normals(capture, LeastSquares())
    assert result.albedo_kind is AlbedoKind.REFLECTANCE
    inside = surface.mask
    assert np.allclose(result.albedo[inside], truth.albedo[inside], rtol=1e-10)
