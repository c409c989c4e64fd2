"""What the contract tests of the normal solvers share: rigs, captures, and what each method is owed of them."""

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import RigError
from psstereo.flags import fatal_mask
from psstereo.lights import Rig
from psstereo.normals import estimate_normals
from psstereo.stack import MemoryStack
from psstereo_synth import checker, hills, lambertian_capture, ring, spiral

EXACT = np.radians(1e-6)
RIGS = {
    "ring 3": ring(3),
    "ring 5": ring(5),
    "spiral 12 to 75 deg": spiral(12, max_tilt=np.radians(75)),
    "spiral 24": spiral(24),
    "spiral 48": spiral(48),
}
MANY = 48
"""Lights for a method that refuses the few which others get."""
SIZE = 26
"""Rows and columns of images, if a test does not ask for more."""


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))


def assert_refused(method, directions):
    """Assert that a method refuses so few lights before anything is decoded, and says what would serve."""
    for attempt in (
        lambda: method().prepare(Rig.distant(directions)),
        lambda: estimate_normals(pixelwise(np.array([[0.0, 0.0, 1.0]]), directions), method()),
    ):
        with pytest.raises(RigError, match=f"needs {method.least_lights} or more") as caught:
            attempt()
        assert str(len(directions)) in caught.value.given
        assert "least-squares" in caught.value.remedy


def on_one_circle(method, directions):
    """Whether lights stand on one circle, which tells nobody a constant besides the normal."""
    rows = np.column_stack([directions, np.ones(len(directions))])
    return method.unknowns > 3 and len(directions) > 3 and np.linalg.matrix_rank(rows, tol=1e-9) < 4


def assert_circle_refused(method, directions):
    with pytest.raises(RigError, match="on one circle") as caught:
        method().prepare(Rig.distant(directions))
    assert "least-squares" in caught.value.remedy


def design(method, directions):
    """Light matrix, with a column of ones where a constant is unknown too."""
    return np.column_stack([directions, np.ones(len(directions))]) if method.unknowns > 3 else directions


def arrange(method, make, count, **how):
    """Directions of some lights; of many for a method that refuses so few, once it has done so."""
    directions = make(count, **how)
    if on_one_circle(method, directions):
        assert_circle_refused(method, directions)
        return np.concatenate([directions, [[0.0, 0.0, 1.0]]])
    if count >= method.least_lights:
        return directions
    assert_refused(method, directions)
    return make(MANY, **how)


def flexible(method):
    """Whether a method has more unknowns than the normal, for which Lambert's law would be too easy a trial."""
    return method.least_lights > 3


def trial(method, count, size=SIZE, *, many=MANY, **how):
    """A capture of hills for what holds whatever the surface is like; not matte for methods that look for that.

    Those get many lights too, so that what they do beyond Lambert's law has a part in the answer.
    """
    make = {key: how.pop(key) for key in ("max_tilt",) if key in how}
    if not flexible(method):
        return hilly(spiral(count, **make), size, **how)[0]
    arrange(method, spiral, count, **make)  # for its refusal
    capture, _ = hilly(spiral(max(many, method.least_lights), **make), size, **how)
    images = frames(capture)
    white = 65535.0 if images.dtype == np.uint16 else 1.0
    bent = white * np.maximum(images / white, 0.0) ** 1.4
    return with_images(capture, np.rint(bent).astype(np.uint16) if white > 1 else bent)


def hilly(directions, size=SIZE, *, steepness=1.0, bits=None, noise=0.0, tint=False):
    surface = hills(size, size, steepness=steepness)
    albedo = checker((size, size), tint=tint)
    return lambertian_capture(surface, albedo, directions, bits=bits, noise=noise)


def frames(capture):
    return capture.stack.read()


def with_images(capture, images, **changes):
    kept = {"rig": capture.rig, "mask": capture.mask} | changes
    return Capture(stack=MemoryStack(images), **kept)


def pixelwise(normals, directions, albedo=1.0, **changes):
    """A capture whose image is a list of normals."""
    values = np.maximum(directions @ normals.T, 0.0) * albedo
    return Capture(stack=MemoryStack(values[:, None]), rig=Rig.distant(directions), **changes)


def random_normals(rng, count, *, tilt=80.0):
    z = rng.uniform(np.cos(np.radians(tilt)), 1.0, count)
    turn = rng.uniform(0, 2 * np.pi, count)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


def conditions(lit, directions):
    """Condition number of the lights (or of rows of a design) that reach each pixel, (p,)."""
    shown = np.where(lit.T[..., None], directions, 0.0)
    values = np.linalg.svd(shown, compute_uv=False)
    with np.errstate(divide="ignore", invalid="ignore"):
        return values[:, 0] / values[:, -1]


def assert_explained(result):
    unknown = ~np.isfinite(result.normals).all(axis=2)
    np.testing.assert_array_equal(unknown, fatal_mask(result.flags))
    known = result.normals[~unknown]
    tolerance = 4 * np.finfo(known.dtype).eps
    np.testing.assert_allclose(np.linalg.norm(known.astype(float), axis=1), 1.0, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(np.isnan(result.normals).all(axis=2), unknown)
    assert (result.albedo[~unknown] > 0).all()
    assert np.isnan(result.albedo[unknown]).all()
    assert np.isnan(result.uncertainty[unknown]).all()
