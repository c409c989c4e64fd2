"""Captures for the tests of unknown strengths, and what is compared."""

from dataclasses import replace

import numpy as np

from psstereo.capture import Capture
from psstereo.lights import Rig
from psstereo.stack import MemoryStack
from psstereo_synth import checker, hills, lambertian_capture, spiral


def drawn(count, seed=0, channels=None):
    """Strengths from 0.3 to 3, log-uniform."""
    shape = count if channels is None else (count, channels)
    return np.exp(np.random.default_rng(seed).uniform(np.log(0.3), np.log(3.0), shape))


def hilly(directions=None, size=40, *, steepness=2.0, noise=0.0, tint=False, seed=0):
    surface = hills(size, size, steepness=steepness)
    lights = spiral(12) if directions is None else directions
    return lambertian_capture(surface, checker((size, size), tint=tint), lights, bits=None, noise=noise, seed=seed)[0]


def lit_by(capture, strengths, **changes):
    """The same capture under lamps of other strengths, which it does not know of."""
    factors = strengths.reshape(len(strengths), 1, 1, -1)
    return replace(capture, stack=MemoryStack(capture.stack.read() * factors), **changes)


def relative(found, true):
    """Found over true strengths, less one, the common factor taken out."""
    ratio = found / true
    return ratio / np.exp(np.log(ratio).mean(axis=0)) - 1.0


def bent(height, size=48):
    """Normals of waves of some height over their length, down to a plane."""
    y, x = np.mgrid[0:size, 0:size] / size
    slopes = height * np.dstack([np.sin(7 * x) * np.cos(6 * y), np.cos(7 * x) * np.sin(6 * y)])
    normals = np.dstack([-slopes + [0.2, -0.1], np.ones((size, size))])
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def seen(normals, directions, noise, seed=0):
    rng = np.random.default_rng(seed)
    values = np.maximum(np.einsum("mc,hwc->mhw", directions, normals), 0) * rng.uniform(0.3, 0.9, normals.shape[:2])
    values += noise * rng.standard_normal(values.shape)
    return Capture(stack=MemoryStack(values), rig=Rig.distant(directions))
