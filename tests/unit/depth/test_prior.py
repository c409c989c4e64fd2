"""Normals fused with depth known beforehand."""

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import INTEGRATORS, Poisson
from psstereo.depth.prior import Prior
from psstereo.errors import InputError, UnsupportedError
from psstereo.results import Outcome

CAMERA = Orthographic(pixel_size=0.5, length_unit="mm")
PINHOLE = Pinhole(fx=300.0, fy=300.0, cx=24.0, cy=22.0)
SHAPE = (45, 50)


def surface():
    """Return heights in mm of a gentle hill, and its normals."""
    x, y = np.moveaxis(CAMERA.points(np.zeros(SHAPE))[..., :2], -1, 0)
    height = 100.0 + 2.0 * np.sin(x / 4) * np.cos(y / 5)
    slopes = 0.5 * np.cos(x / 4) * np.cos(y / 5), -0.4 * np.sin(x / 4) * np.sin(y / 5)
    return height, np.dstack([-slopes[0], -slopes[1], np.ones(SHAPE)])


def points(depth, where):
    """Return a depth map that knows some pixels only."""
    sparse = np.full(depth.shape, np.nan)
    for place in where:
        sparse[place] = depth[place]
    return sparse


def test_one_point_fixes_the_height():
    height, normals = surface()
    prior = Prior(depth=points(height, [(7, 9)]), sigma=0.1, unit="mm")
    result = Poisson().integrate(normals, CAMERA, prior=prior)
    free = Poisson().integrate(normals, CAMERA).depth
    assert result.unit == "mm"
    assert result.outcome is Outcome.SOLVED
    assert result.depth[7, 9] == pytest.approx(height[7, 9], abs=1e-9)
    np.testing.assert_allclose(result.depth - result.depth.mean(), free, atol=1e-8)


def test_one_point_fixes_the_scale_of_a_pinhole():
    rays = PINHOLE.rays(SHAPE)
    normal = np.array([0.2, -0.1, 1.0])
    truth = -500.0 / (rays @ normal)
    prior = Prior(depth=points(truth, [(20, 20)]), sigma=1.0, unit="mm")
    result = Poisson().integrate(np.broadcast_to(normal, (*SHAPE, 3)), PINHOLE, prior=prior)
    assert result.unit == "mm"
    np.testing.assert_allclose(result.depth, truth, rtol=1e-9)


def test_coarse_depth_mends_what_normals_bend_and_normals_what_depth_blurs():
    """Normals with a common tilt bend the whole; the prior is noisy pixel by pixel: together better than either."""
    height, normals = surface()
    rng = np.random.default_rng(1)
    tilted = normals + np.array([0.03, 0.02, 0.0])
    coarse = height + rng.normal(0, 0.3, SHAPE)
    prior = Prior(depth=coarse, sigma=0.3, unit="mm", angle=0.03)
    fused = Poisson().integrate(tilted, CAMERA, prior=prior).depth
    alone = Poisson().integrate(tilted, CAMERA).depth
    error = np.sqrt(np.mean((fused - height) ** 2))
    assert error < 0.65 * np.std(alone - height)
    assert error < 0.55 * np.std(coarse - height)


def test_the_weights_are_those_of_the_standard_errors():
    """Two pixels, worked out by hand: a step of 0 that is known to angle · spacing, and depths 1 and 3 known to σ."""
    normals = np.broadcast_to([0.0, 0.0, 1.0], (1, 2, 3))
    sigma, angle = 0.2, 0.04
    prior = Prior(depth=np.array([[1.0, 3.0]]), sigma=sigma, unit="mm", angle=angle)
    result = Poisson().integrate(normals, CAMERA, prior=prior).depth
    edge, point = 1.0 / (angle * 0.5) ** 2, 1.0 / sigma**2
    difference = 2.0 * point / (point + 2.0 * edge)
    np.testing.assert_allclose(result, [[2.0 - difference / 2, 2.0 + difference / 2]], atol=1e-9)


def test_components_that_the_prior_does_not_touch_are_left_out():
    height, normals = surface()
    mask = np.ones(SHAPE, bool)
    mask[:, 25] = False
    prior = Prior(depth=points(height, [(7, 9)]), sigma=0.1, unit="mm")
    result = Poisson().integrate(normals, CAMERA, mask=mask, prior=prior)
    assert np.isnan(result.depth[:, 25:]).all()
    assert np.isfinite(result.depth[:, :25]).all()
    assert result.facts["left_out"]["no_prior"] == 45 * 24
    assert result.outcome is Outcome.PARTIAL


@pytest.mark.parametrize(
    "change",
    [
        {"depth": np.ones((3, 3))},
        {"depth": np.full(SHAPE, np.nan)},
        {"depth": np.full(SHAPE, np.inf)},
        {"depth": np.ones(SHAPE, int)},
        {"sigma": 0.0},
        {"sigma": np.nan},
        {"sigma": np.ones((2, 2))},
        {"angle": 0.0},
        {"angle": np.nan},
        {"unit": "m"},
    ],
)
def test_a_prior_that_does_not_fit_is_refused(change):
    height, normals = surface()
    values = {"depth": height, "sigma": 0.1, "unit": "mm"} | change
    with pytest.raises(InputError, match="prior"):
        Poisson().integrate(normals, CAMERA, prior=Prior(**values))


def test_a_distance_behind_the_camera_is_refused():
    with pytest.raises(InputError, match="no valid depth"):
        Poisson().integrate(
            np.broadcast_to([0.0, 0.0, 1.0], (*SHAPE, 3)),
            PINHOLE,
            prior=Prior(depth=np.full(SHAPE, -1.0), sigma=0.1, unit="mm"),
        )


def test_methods_without_a_prior_refuse_it():
    height, normals = surface()
    for kind in INTEGRATORS.values():
        if not kind.takes_prior:
            with pytest.raises(UnsupportedError, match="from normals alone"):
                kind().integrate(normals, CAMERA, prior=Prior(depth=height, sigma=0.1, unit="mm"))
