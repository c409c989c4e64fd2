"""Colour and ambient light from the images to the record of a run."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.flags import Flag
from psstereo.lights import Led, Rig
from psstereo.normals import estimate_normals
from psstereo.normals.ambient import AmbientLeastSquares
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.memory import plan_memory
from psstereo.normals.strengths import estimate_strengths
from psstereo.pipeline import Options, reconstruct
from psstereo.stack import MemoryStack, PixelSet
from psstereo_synth import hills, lambertian_capture, spiral

TINT = np.array([0.9, 0.25, 0.08])


def tinted(size=64, *, lights=12, noise=0.0, bits=None):
    surface = hills(size, size, steepness=0.6)
    albedo = np.random.default_rng(0).uniform(0.4, 0.9, (size, size, 1)) * TINT
    return lambertian_capture(surface, albedo, spiral(lights, max_tilt=0.6), bits=bits, noise=noise)


def degrees(result, truth, mask):
    n, t = result.normals.astype(float)[mask], truth.normals[mask]
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(n, t), axis=1), (n * t).sum(axis=1)))


@pytest.mark.parametrize("gray", ["chroma", "specular-free"])
def test_exact_without_noise(gray):
    capture, truth = tinted()
    result = estimate_normals(capture, gray=gray)
    assert degrees(result, truth, capture.mask).max() < 1e-6
    expected = truth.albedo.mean(axis=2)[capture.mask]
    np.testing.assert_allclose(result.albedo[capture.mask], expected, rtol=1e-8)
    assert result.facts["gray"] == gray


def test_chroma_is_less_noisy_than_fixed_weights():
    capture, truth = tinted(noise=0.01)
    rms = {}
    for gray in ("chroma", "mean", "bt601", "per-channel", "specular-free"):
        found = estimate_normals(capture, LeastSquares(), gray=gray)
        rms[gray] = np.sqrt((degrees(found, truth, capture.mask) ** 2).mean())
    theory = np.sqrt(3 * (TINT**2).sum()) / TINT.sum()
    assert rms["mean"] / rms["chroma"] == pytest.approx(theory, rel=0.03)
    assert rms["bt601"] > rms["mean"]
    assert rms["chroma"] <= 1.02 * min(rms.values())


def fits(capture, pixels, limit):
    try:
        plan_memory(capture.stack, pixels, 3, limit, 1, projected=True)
    except InputError:
        return False
    return True


@pytest.mark.parametrize("bits", [None, 16])
def test_any_tiling_and_threads_give_the_same_bytes(bits):
    capture, _ = tinted(100, noise=0.01, bits=bits)
    expected = estimate_normals(capture, gray="chroma")
    pixels = PixelSet.from_mask(capture.mask)
    whole = plan_memory(capture.stack, pixels, 3, None, 1, projected=True).sample_bytes
    limit = next(n for n in range(0, 1 << 30, whole // 8) if fits(capture, pixels, n))
    with ThreadPoolExecutor(2) as pool:
        tiled = estimate_normals(capture, gray="chroma", over=pool.map, max_memory=limit)
    assert tiled.facts["samples_in"] == "temporary file"
    assert tiled.normals.tobytes() == expected.normals.tobytes()
    assert tiled.albedo.tobytes() == expected.albedo.tobytes()


def test_a_saturated_channel_takes_its_observation_along():
    capture, _ = tinted(bits=16)
    images = capture.stack.read().copy()
    images[3, 30, 30, 0] = 65535
    spoiled = replace(capture, stack=MemoryStack(images))
    flags = estimate_normals(spoiled, gray="chroma").flags
    assert flags[30, 30] & Flag.UNUSABLE_SAMPLE
    assert not flags[30, 31] & Flag.UNUSABLE_SAMPLE


def test_methods_without_it_refuse_to_project():
    capture, _ = tinted()
    with pytest.raises(OptionError, match="'chroma'"):
        estimate_strengths(capture, gray="chroma")
    places = [(90.0, 0.0), (-90.0, 0.0), (0.0, 90.0), (20.0, -90.0)]
    lamps = tuple(Led(position=(x, y, 300.0), axis=(0, 0, -1), mu=1.0, flux=1.0) for x, y in places)
    near = Capture(stack=MemoryStack(capture.stack.read()[:4]), rig=Rig(lamps), mask=capture.mask)
    with pytest.raises((OptionError, InputError)):
        reconstruct(near, Options(gray="chroma"))


def test_ambient_light_is_found_and_said():
    capture, truth = tinted(lights=16, noise=0.001)
    images = capture.stack.read()
    lit = replace(capture, stack=MemoryStack(images + 0.3 * images.max(axis=0)))
    naive = degrees(estimate_normals(lit), truth, capture.mask).mean()
    answer = reconstruct(lit, Options(solver=AmbientLeastSquares(), integrator=None))
    assert naive > 2
    assert degrees(answer.normals, truth, capture.mask).mean() < naive / 4
    low, middle, high = answer.normals.facts["ambient_share"]
    assert low < middle < high
    # some light nearly faces every pixel, so that a / (a + ρ) is about 0.3 / 1.3
    assert middle == pytest.approx(0.3 / 1.3, rel=0.1)
    step = {step.name: step for step in answer.steps}["ambient light"]
    assert f"{middle:.1%}" in step.reason
    plain = reconstruct(lit, Options(integrator=None, solver=LeastSquares()))
    assert "ambient light" not in {step.name for step in plain.steps}
    assert plain.normals.facts["ambient_share"] is None


def test_channels_with_ambient_light():
    capture, truth = tinted(lights=16)
    images = capture.stack.read()
    lit = replace(capture, stack=MemoryStack(images + np.array([0.05, 0.1, 0.15])))
    result = estimate_normals(lit, AmbientLeastSquares(), gray="per-channel")
    assert degrees(result, truth, capture.mask).max() < 1e-6
    assert 0 < result.facts["ambient_share"][1] < 1


def test_a_dark_image_brighter_than_the_photographs_is_said():
    capture, _ = tinted(bits=16)
    level = np.full(capture.stack.shape[1:], 300.0)
    images = capture.stack.read() + np.uint16(300)
    fine = replace(capture, stack=MemoryStack(images), dark=level)
    for dark, share in ((level, 0.0), (level * 60, 0.05)):
        answer = reconstruct(replace(fine, dark=dark), Options(integrator=None))
        reason = {step.name: step for step in answer.steps}["dark level"].reason
        assert ("brighter than the photographs" in reason) == (share > 0)
        assert answer.normals.facts["below_dark"] >= share
        assert (answer.normals.facts["below_dark_most"][1] > 0) == (share > 0)
    assert reconstruct(capture, Options(integrator=None)).normals.facts["below_dark"] is None
