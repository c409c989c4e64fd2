"""The least error bars of integer images: against the covariance written out, and against what rounding really does."""

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.lights import Rig
from psstereo.normals import GATES, LeastSquares, estimate_normals
from psstereo.normals.rounding import raise_bars, rounding_of
from psstereo.normals.solver import PixelNormals
from psstereo.stack import FlatField, MemoryStack, Response, colour_reading
from psstereo_synth import ring, spiral

PLAIN = LeastSquares(gate=GATES["none"])
NORMAL = np.array([0.28, -0.16, 0.9465])
NORMAL /= np.linalg.norm(NORMAL)


def angles(found, truth):
    return np.arctan2(np.linalg.norm(np.cross(found, truth), axis=-1), (found * truth).sum(axis=-1))


def written_out(directions, deviation, normal, albedo):
    """√tr(P C P) / ρ with C = M diag(σ²) Mᵀ and M the pseudo-inverse of the light matrix."""
    inverse = np.linalg.pinv(directions)
    across = np.eye(3) - np.outer(normal, normal)
    return np.sqrt(np.trace(across @ (inverse * deviation**2) @ inverse.T @ across)) / albedo


def floor_of(images, rig):
    """Solve images whose white is so low that a step is large beside what they are off Lambert's law."""
    capture = Capture(stack=MemoryStack(images, white=60000.0), rig=rig)
    return estimate_normals(capture, PLAIN, covariance=True)


def raised(found, expected):
    """The bar is the residual's or the floor, whichever is larger; here both are known."""
    assert found.uncertainty[0, 0] == pytest.approx(expected, rel=2e-3)
    trace = found.covariance[0, 0, [0, 2, 5]].sum()
    assert np.sqrt(trace) == pytest.approx(found.uncertainty[0, 0], rel=1e-5)


def lattice():
    """Lights and a normal of whole sixteenths: products are whole numbers of steps, and the residual is zero."""
    directions = np.array([[2, 1, 2], [-2, 1, 2], [1, 2, 2], [1, -2, 2], [-1, 2, 2], [-1, -2, 2], [0, 0, 3]]) / 3.0
    return directions, np.array([0.0, 0.6, 0.8])


@pytest.mark.parametrize("strengths", [None, [1.0, 2.0, 4.0, 0.5, 1.0, 1.0, 8.0]])
def test_the_floor_is_the_propagated_step(strengths):
    directions, normal = lattice()
    rig = Rig.distant(directions, strengths)
    power = rig.strengths(1)[:, 0]
    levels = 1500 * (directions @ normal) * power
    np.testing.assert_allclose(levels, np.rint(levels), rtol=1e-12)
    found = floor_of(np.rint(levels).astype(np.uint16)[:, None, None, None], rig)
    deviation = 1 / 12**0.5 / 60000 / power
    raised(found, written_out(directions, deviation, normal, 1500 / 60000))


def test_channels_round_independently():
    directions, normal = lattice()
    gains = np.array([1.0, 2.0, 4.0])
    rig = Rig.distant(directions, np.tile(gains, (7, 1)))
    images = np.rint(1500 * (directions @ normal)[:, None] * gains).astype(np.uint16)[:, None, None, :]
    deviation = np.full(7, np.sqrt((1 / gains**2).sum()) / 3 / 12**0.5 / 60000)
    raised(floor_of(images, rig), written_out(directions, deviation, normal, 1500 / 60000))


@pytest.mark.parametrize(("dark", "gain"), [(0.0, 1.0), (0.1, 1.0), (0.05, 1.6)])
def test_a_tone_curve_makes_steps_of_its_slope(dark, gain):
    """Bars of zero, as if nothing were left over, become those of steps that the curve stretches."""
    rig, response = Rig.distant(spiral(24, max_tilt=0.6)), Response("gamma", 2.2)
    light = 0.8 * rig.directions @ NORMAL
    images = np.rint((light / gain + dark) ** (1 / 2.2) * 60000).astype(np.uint16)[:, None, None, None]
    level = np.full((1, 1, 1), dark * 60000) if dark else None
    flat = None if gain == 1 else FlatField(np.full((1, 1, 1), gain))
    stack = MemoryStack(images, white=60000.0)
    capture = Capture(stack=stack, rig=rig, response=response, dark=level, flat=flat)
    part = PixelNormals(
        scaled=0.8 * NORMAL[None], uncertainty=np.zeros(1), flags=np.zeros(1, np.uint16), used=np.full(1, 24)
    )
    rounding = rounding_of(capture, colour_reading("mean", 1), np.array([0]))
    raise_bars(rounding, part, light[:, None], None, channel=0, start=0)
    slope = gain * 2.2 * (light / gain + dark) ** (1 - 1 / 2.2)  # d(v^γ)/dv at v = light^(1/γ)
    assert part.uncertainty[0] == pytest.approx(
        written_out(rig.directions, slope / 12**0.5 / 60000, NORMAL, 0.8), rel=1e-3
    )


def test_the_floor_is_what_rounding_does_where_values_span_many_steps():
    """Errors of many normals, rounded without any noise, have the size that the floor says; the bars cover them."""
    rng = np.random.default_rng(5)
    directions, count = spiral(8, max_tilt=0.7), 4000
    tilt = np.column_stack([rng.uniform(-0.3, 0.3, (count, 2)), np.ones(count)])
    normals = tilt / np.linalg.norm(tilt, axis=1, keepdims=True)
    images = np.rint(230 * directions @ normals.T).astype(np.uint8)[:, None]
    found = estimate_normals(Capture(stack=MemoryStack(images), rig=Rig.distant(directions)), PLAIN)
    actual = angles(found.normals[0], normals)
    across = [written_out(directions, np.full(8, 1 / 12**0.5 / 255), n, 230 / 255) for n in normals[:50]]
    assert np.sqrt(np.mean(actual**2)) == pytest.approx(np.mean(across), rel=0.05)
    assert found.uncertainty[0, :50].min() >= 0.98 * np.min(across)
    assert (actual <= 3.2 * found.uncertainty[0]).all()


@pytest.mark.parametrize("half", [0.05, 0.5, 2.0])
def test_a_narrow_cone_is_never_silently_wrong(half):
    directions = spiral(48, max_tilt=np.radians(half))
    rng = np.random.default_rng(2)
    turn, radius = rng.uniform(0, 2 * np.pi, 500), 0.42 * np.sqrt(rng.random(500))
    normals = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)], axis=1)
    exact = 0.9 * directions @ normals.T
    rig = Rig.distant(directions)
    coarse = MemoryStack(np.rint(255 * exact).astype(np.uint8)[:, None])
    found = estimate_normals(Capture(stack=coarse, rig=rig), PLAIN)
    off = angles(found.normals[0], normals)
    assert off.max() > 10 * np.radians(0.1)
    assert (off <= 6 * found.uncertainty[0]).all()
    # the residual alone says nothing of it, which the same values as floats show
    alone = estimate_normals(Capture(stack=MemoryStack(coarse.read() / 255.0), rig=rig), PLAIN)
    np.testing.assert_allclose(alone.normals, found.normals, atol=1e-4)
    assert (off > 6 * alone.uncertainty[0]).sum() > 5


def test_bars_that_noise_makes_larger_and_those_that_are_unknown_stay():
    rng = np.random.default_rng(0)
    directions = spiral(12, max_tilt=0.6)
    shade = 0.8 * directions @ NORMAL
    noisy = np.rint(255 * (shade[:, None] + 0.02 * rng.standard_normal((12, 200)))).astype(np.uint8)[:, None]
    rig = Rig.distant(directions)
    found = estimate_normals(Capture(stack=MemoryStack(noisy), rig=rig), PLAIN)
    floats = estimate_normals(Capture(stack=MemoryStack(noisy / 255.0), rig=rig), PLAIN)
    np.testing.assert_allclose(found.uncertainty, floats.uncertainty, rtol=1e-4)
    three = Rig.distant(ring(3))
    values = np.rint(200 * three.directions @ NORMAL).astype(np.uint8)[:, None, None]
    assert np.isnan(estimate_normals(Capture(stack=MemoryStack(values), rig=three), PLAIN).uncertainty).all()


def test_channels_on_their_own_have_floors_of_their_own():
    directions, normal = lattice()
    rig, gains = Rig.distant(directions), np.array([1.0, 0.5, 0.02])
    images = np.rint(15000 * (directions @ normal)[:, None] * gains).astype(np.uint16)[:, None, None, :]
    capture = Capture(stack=MemoryStack(images, white=60000.0), rig=rig)
    found = estimate_normals(capture, PLAIN, gray="per-channel")
    each = np.array([written_out(directions, np.full(7, 1 / 12**0.5 / 60000), normal, 0.25 * g) for g in gains])
    expected = np.sqrt(((gains**2 * each) ** 2).sum()) / (gains**2).sum()
    assert found.uncertainty[0, 0] == pytest.approx(expected, rel=2e-3)
