"""Normals from depth: exact on planes, second order elsewhere, and no look across gaps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.camera import CAMERAS, Camera, Orthographic, Pinhole
from psstereo.depth import normals_from_depth
from psstereo.errors import InputError, UnsupportedError

ORTHOGRAPHIC = Orthographic(pixel_size=0.3, length_unit="mm")
PINHOLE = Pinhole(fx=70.0, fy=61.0, cx=12.3, cy=8.9, skew=1.7)
SHAPE = (18, 25)


def plane(camera: Camera, normal):
    """Return the depth of the plane through (0, 0, −500) of a pinhole, or (0, 0, 0)."""
    normal = np.asarray(normal) / np.linalg.norm(normal)
    if camera.name == "orthographic":
        points = camera.points(np.zeros(SHAPE))
        return -(points[..., 0] * normal[0] + points[..., 1] * normal[1]) / normal[2], normal
    return -500.0 * normal[2] / (camera.rays(SHAPE) @ normal), normal


@settings(max_examples=15)
@given(
    st.sampled_from([ORTHOGRAPHIC, PINHOLE]),
    st.tuples(st.floats(-2, 2), st.floats(-2, 2)),
    st.floats(0, 0.5),
    st.integers(0, 99),
)
def test_planes_are_exact_around_any_holes(camera, slope, holes, seed):
    depth, normal = plane(camera, [-slope[0], -slope[1], 1.0])
    known = np.random.default_rng(seed).random(SHAPE) >= holes
    known &= np.isfinite(depth) & (np.abs(depth) < 5e3) & ((depth > 0) | (camera is ORTHOGRAPHIC))
    found = normals_from_depth(np.where(known, depth, np.nan), camera)
    across, along = np.zeros(SHAPE, bool), np.zeros(SHAPE, bool)
    across[:, 1:] |= known[:, :-1]
    across[:, :-1] |= known[:, 1:]
    along[1:] |= known[:-1]
    along[:-1] |= known[1:]
    wanted = known & across & along
    np.testing.assert_array_equal(np.isfinite(found).all(axis=-1), wanted)
    np.testing.assert_allclose(found[wanted], np.broadcast_to(normal, (*SHAPE, 3))[wanted], rtol=0, atol=1e-10)


def saddle(x, y):
    angle = 3 * x + y
    height = 0.3 * np.sin(angle) + 0.2 * x * y
    return height, 0.9 * np.cos(angle) + 0.2 * y, 0.3 * np.cos(angle) + 0.2 * x


def worst_error(camera, size):
    if camera == "orthographic":
        points = (eye := Orthographic(pixel_size=1.2 / size)).points(np.zeros((size, size)))
        height, p, q = saddle(points[..., 0] - 0.6, points[..., 1] + 0.6)
        depth = height
    else:
        eye = Pinhole(fx=2.0 * size, fy=1.9 * size, cx=size / 2, cy=size / 2)
        rays, depth = eye.rays((size, size)), np.full((size, size), 3.0)
        for _ in range(25):
            depth = 3.0 - saddle(depth * rays[..., 0], depth * rays[..., 1])[0]
        _, p, q = saddle(depth * rays[..., 0], depth * rays[..., 1])
    depth[size // 4 : size // 2, size // 4 : size // 2] = np.nan
    truth = np.stack([-p, -q, np.ones_like(p)], axis=-1)
    error = np.abs(normals_from_depth(depth, eye) - truth / np.linalg.norm(truth, axis=-1, keepdims=True))
    return np.nanmax(error)


@pytest.mark.parametrize("camera", CAMERAS)
def test_smooth_surfaces_are_of_second_order_up_to_borders_and_holes(camera):
    errors = np.array([worst_error(camera, size) for size in (32, 64, 128, 256)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert (orders > 1.85).all(), orders
    assert errors[-1] < 6e-4


def test_components_keep_a_step_out():
    depth = np.zeros((6, 8))
    depth[:, 4:] = 30.0
    assert normals_from_depth(depth, ORTHOGRAPHIC)[0, 3, 2] < 0.1
    parts = np.where(np.arange(8) < 4, 1, 2) * np.ones((6, 1), np.int64)
    parts[0, 0] = 0
    found = normals_from_depth(depth, ORTHOGRAPHIC, components=parts)
    assert np.isnan(found[0, 0]).all()
    np.testing.assert_allclose(found[1:], np.broadcast_to([0.0, 0.0, 1.0], (5, 8, 3)), rtol=0, atol=1e-15)


def test_lone_pixels_have_no_normal():
    depth = np.full((5, 5), np.nan)
    depth[2, 2], depth[0] = 1.0, 1.0
    assert np.isnan(normals_from_depth(depth, ORTHOGRAPHIC)).all()
    assert np.isnan(normals_from_depth(np.ones((1, 1)), PINHOLE)).all()


def test_huge_steps_give_no_number_rather_than_a_wrong_one():
    found = normals_from_depth(np.array([[0.0, 1e200], [0.0, 1e200]]), ORTHOGRAPHIC)
    assert np.isnan(found).all()


@pytest.mark.parametrize(
    ("depth", "options", "message"),
    [
        (np.ones((3, 3), int), {}, "type int"),
        (np.ones(3), {}, "shape"),
        (np.ones((3, 0)), {}, "shape"),
        (np.array([[1.0, 0.0]]), {}, "1 pixels have a distance of 0 or less"),
        (np.ones((3, 3)), {"components": np.ones((3, 3))}, "components"),
        (np.ones((3, 3)), {"components": np.ones((3, 2), int)}, "components"),
        (np.ones((3, 3)), {"components": -np.ones((3, 3), int)}, "components"),
    ],
)
def test_hostile_input_is_refused(depth, options, message):
    with pytest.raises(InputError, match=message):
        normals_from_depth(depth, PINHOLE, **options)


def test_other_cameras_are_refused():
    class Other:
        name = "fish-eye"

    with pytest.raises(UnsupportedError, match="fish-eye"):
        normals_from_depth(np.ones((3, 3)), Other())
