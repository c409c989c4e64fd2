"""Captures with one thing the matter with them, as samples."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from psstereo.lights import Rig
from psstereo.plan.diagnosis import MotionProbe
from psstereo.plan.sample import Sample, sample_pixels
from psstereo.stack import MemoryStack
from psstereo.types import BoolArray, FloatArray

SIZE = 80


def bumps(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Height and slopes of three bumps of different widths, which bend in all directions."""
    z, p, q = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for cx, cy, height, width in ((-0.3, 0.2, 0.5, 0.45), (0.4, -0.3, 0.45, 0.4), (0.3, 0.5, -0.25, 0.3)):
        bump = height * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * width**2))
        z += bump
        p -= bump * (x - cx) / width**2
        q -= bump * (y - cy) / width**2
    return z, p, q


@dataclass(frozen=True, kw_only=True)
class Shot:
    """Images (m, h, w) of a matte surface, as shares of full scale, and what they show."""

    images: FloatArray
    normals: FloatArray
    height: FloatArray
    albedo: FloatArray
    mask: BoolArray
    places: FloatArray


def shoot(
    directions: FloatArray, *, sphere: bool = False, texture: float = 0.3, lamps: float | None = None, size: int = SIZE
) -> Shot:
    """Photograph bumps or a ball; with lamps at a distance (in half widths) if it is given."""
    axis = (np.arange(size) - (size - 1) / 2) / (size / 2)
    x, y = np.meshgrid(axis, -axis)
    if sphere:
        radius = 0.9
        mask = x**2 + y**2 < (0.95 * radius) ** 2
        z = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 1e-9))
        normals = np.stack([x, y, z]) / radius
        normals /= np.sqrt((normals**2).sum(axis=0))
    else:
        mask = np.ones(x.shape, np.bool_)
        z, p, q = bumps(x, y)
        normals = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p**2 + q**2)
    albedo = 0.5 * (1 + texture * np.sin(9 * x + 4 * y) * np.cos(8 * y - 5 * x))
    places = np.stack([x, y, z])
    images = []
    for direction in directions:
        if lamps is None:
            images.append(albedo * np.maximum(np.tensordot(direction, normals, 1), 0.0))
        else:
            toward = lamps * direction[:, None, None] - places
            distance = np.sqrt((toward**2).sum(axis=0))
            images.append(albedo * np.maximum((toward * normals).sum(axis=0), 0.0) * lamps**2 / distance**3)
    return Shot(images=np.array(images) * mask, normals=normals, height=z, albedo=albedo, mask=mask, places=places)


def to_sample(
    images: FloatArray,
    directions: FloatArray,
    mask: BoolArray | None = None,
    *,
    noise: float = 0.002,
    bits: int = 16,
    seed: int = 0,
    strengths: FloatArray | None = None,
) -> Sample:
    """Expose images (shares of full scale) and take the planner's sample of them."""
    rng = np.random.default_rng(seed)
    top = 2**bits - 1
    exposed = np.rint(np.clip(images + noise * rng.standard_normal(images.shape), 0, 1) * top)
    stack = MemoryStack(exposed[..., None].astype(np.uint8 if bits == 8 else np.uint16))
    where = sample_pixels(np.ones(images.shape[1:], np.bool_) if mask is None else mask)
    rig = Rig.distant(directions, strengths)
    rows, columns = where.pixels.T
    raw = np.stack([stack.frame(i)[rows, columns] for i in range(len(images))])
    values = raw[..., 0] / top / rig.strengths(1)
    values[raw[..., 0] >= 0.98 * top] = np.nan
    return Sample.fitted(values, where, stack, rig, raw)


def probed(images: FloatArray) -> MotionProbe:
    """Feed a probe with all images."""
    probe = MotionProbe(len(images), (images.shape[1] // 2, images.shape[2] // 2))
    for i, image in enumerate(images):
        probe.feed(image[..., None], i)
    return probe


@pytest.fixture
def shot() -> Callable[..., Shot]:
    return shoot


@pytest.fixture
def sampled() -> Callable[..., Sample]:
    return to_sample


@pytest.fixture
def probe() -> Callable[[FloatArray], MotionProbe]:
    return probed
