"""Normal maps of any origin: flags, weights, priors, and what stays free."""

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import Poisson, Prior
from psstereo.depth.given_normals import free_constants, integrate_normals, mark_missing_depth
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.flags import Flag, fatal_mask
from psstereo.results import Outcome
from psstereo_synth import hills

CAMERA = Orthographic(pixel_size=0.5, length_unit="mm")
PINHOLE = Pinhole(fx=300.0, fy=300.0, cx=15.5, cy=11.5)
SHAPE = (24, 32)
TILT = np.array([0.2, -0.1, 1.0])


def plane(camera=CAMERA):
    """Return the normals of a plane, and its depth."""
    normals = np.broadcast_to(TILT, (*SHAPE, 3)).copy()
    if isinstance(camera, Pinhole):
        return normals, -500.0 / (camera.rays(SHAPE) @ TILT)
    points = camera.points(np.zeros(SHAPE))
    return normals, -(points @ TILT)


def test_each_pixel_is_accounted_for():
    normals, _ = plane()
    normals[2, 3], normals[2, 4], normals[2, 5], normals[6, 7] = 0.0, np.nan, np.inf, (0.1, 0.0, -1.0)
    mask = np.ones(SHAPE, np.bool_)
    mask[:, 20:] = False
    uncertainty = np.full(SHAPE, 0.02)
    uncertainty[9, 9] = np.inf
    found = integrate_normals(normals, CAMERA, mask=mask, uncertainty=uncertainty)
    expected = np.zeros(SHAPE, np.uint16)
    expected[~mask] = Flag.OUTSIDE_MASK
    expected[2, 3:6] = Flag.NOT_FINITE | Flag.NO_DEPTH
    expected[6, 7] = Flag.FACING_AWAY | Flag.NO_DEPTH
    expected[9, 9] = Flag.NO_DEPTH
    assert np.array_equal(found.flags, expected)
    assert np.array_equal(np.isfinite(found.depth.depth), expected == 0)
    assert np.array_equal(np.isnan(found.normals).all(axis=2), fatal_mask(expected))
    assert np.nanmax(np.abs(np.linalg.norm(found.normals, axis=2) - 1)) < 1e-15
    assert len(found.mesh.vertices) == np.count_nonzero(expected == 0)
    assert found.depth.facts["left_out"] == {"no_normal": 3, "facing_away": 1, "zero_weight": 1, "beyond_range": 0}
    assert found.depth.outcome is Outcome.PARTIAL


def test_uncertain_normals_give_way_to_certain_ones():
    """A blot of wrong normals bends the surroundings, unless it is known to be one."""
    surface = hills(48, 40, steepness=1.0)
    rows, columns = np.indices(surface.mask.shape)
    blot = np.hypot(rows - 18, columns - 24) < 6
    normals = surface.normals + blot[..., None] * np.array([0.3, 0.1, 0.0])
    uncertainty = np.where(blot, 0.3, 0.003)
    alike, weighed = (
        integrate_normals(normals, Orthographic(), mask=surface.mask, uncertainty=one).depth.depth
        for one in (None, uncertainty)
    )
    around = surface.mask & ~blot
    off = [np.std((depth - surface.height)[around]) for depth in (alike, weighed)]
    assert off[1] < 0.1 * off[0]


def test_only_ratios_of_uncertainties_matter_and_unknown_ones_are_the_worst():
    surface = hills(24, 24, steepness=1.0)
    rng = np.random.default_rng(4)
    spread = rng.uniform(0.01, 0.1, surface.mask.shape)
    unknown = spread.copy()
    spread[4, 4] = spread[14, 14] = spread.max()
    unknown[4, 4] = unknown[14, 14] = np.nan
    noisy = surface.normals + 0.1 * rng.normal(size=surface.normals.shape)
    depths = [
        integrate_normals(noisy, Orthographic(), mask=surface.mask, uncertainty=one).depth.depth
        for one in (spread, spread * 7, unknown)
    ]
    np.testing.assert_allclose(depths[1], depths[0], atol=1e-8)
    np.testing.assert_allclose(depths[2], depths[0], atol=1e-8)
    certain = integrate_normals(noisy, Orthographic(), mask=surface.mask, uncertainty=0 * spread).depth.depth
    alike = integrate_normals(noisy, Orthographic(), mask=surface.mask).depth.depth
    np.testing.assert_allclose(certain, alike, atol=1e-8)  # none counts more than another


def test_the_uncertainty_says_how_much_normals_weigh_beside_a_prior():
    """Two pixels, worked out by hand: a step of 0 that is known to angle · spacing, and depths 1 and 3 known to σ."""
    normals = np.broadcast_to([0.0, 0.0, 1.0], (1, 2, 3))
    sigma, angle = 0.2, 0.04
    prior = Prior(depth=np.array([[1.0, 3.0]]), sigma=sigma, unit="mm")
    uncertainty = np.full((1, 2), angle * np.sqrt(2))  # the root-mean-square angle has a part in each of two planes
    found = integrate_normals(normals, CAMERA, prior=prior, uncertainty=uncertainty)
    edge, point = 1.0 / (angle * 0.5) ** 2, 1.0 / sigma**2
    difference = 2.0 * point / (point + 2.0 * edge)
    np.testing.assert_allclose(found.depth.depth, [[2.0 - difference / 2, 2.0 + difference / 2]], atol=1e-9)
    step = next(step for step in found.steps if step.name == "prior")
    assert step.done
    assert f"{np.degrees(angle):.3g}°" in step.reason
    assert "2 pixels" in step.reason


def test_what_stays_free_is_said():
    normals, _ = plane()
    two = np.ones(SHAPE, np.bool_)
    two[:, 12:14] = False
    heights = free_constants(integrate_normals(normals, CAMERA, mask=two).depth)
    assert (heights.kind, heights.count) == ("offset", 2)
    assert "known in mm" in heights.sentence
    relative = free_constants(integrate_normals(normals, PINHOLE, mask=two).depth)
    assert (relative.kind, relative.count) == ("scale", 2)
    assert "relative" in relative.sentence
    scaled = integrate_normals(normals, PINHOLE, mask=two, distance=500.0).depth
    assert np.nanmedian(scaled.depth) == pytest.approx(500.0)
    assert (free_constants(scaled).kind, free_constants(scaled).count) == ("scale", 1)
    assert "500 mm" in free_constants(scaled).sentence
    whole = free_constants(integrate_normals(normals, PINHOLE, distance=500.0).depth)
    assert (whole.kind, whole.count) == ("none", 0)


def test_a_prior_settles_the_components_that_it_touches():
    normals, depth = plane(PINHOLE)
    two = np.ones(SHAPE, np.bool_)
    two[:, 12:14] = False
    sparse = np.full(SHAPE, np.nan)
    sparse[3, 4] = depth[3, 4]
    found = integrate_normals(normals, PINHOLE, mask=two, prior=Prior(depth=sparse, sigma=1.0, unit="mm"))
    np.testing.assert_allclose(found.depth.depth[:, :12], depth[:, :12], rtol=1e-9)
    untouched = np.zeros(SHAPE, np.bool_)
    untouched[:, 14:] = True
    assert np.array_equal(found.flags, np.where(untouched, Flag.NO_DEPTH, 0) | np.where(two, 0, Flag.OUTSIDE_MASK))
    free = free_constants(found.depth)
    assert (free.kind, free.count) == ("none", 0)
    assert f"{untouched.sum()} pixels" in free.sentence


def test_what_makes_no_sense_is_refused():
    normals, depth = plane()
    prior = Prior(depth=depth, sigma=1.0, unit="mm")
    with pytest.raises(UnsupportedError, match="size of a pixel"):
        integrate_normals(normals, CAMERA, distance=500.0)
    with pytest.raises(OptionError, match="Both a prior and the distance"):
        integrate_normals(normals, PINHOLE, prior=prior, distance=500.0)
    for distance in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="positive length"):
            integrate_normals(normals, PINHOLE, distance=distance)
    for uncertainty in (np.ones((3, 3)), -np.ones(SHAPE), np.full(SHAPE, np.nan)):
        with pytest.raises(InputError, match="uncertainty"):
            integrate_normals(normals, CAMERA, uncertainty=uncertainty)
    for wrong in (normals[..., :2], normals.astype(int), normals[:0], normals[0]):
        with pytest.raises(InputError, match="normals have shape"):
            integrate_normals(wrong, CAMERA)
    with pytest.raises(InputError, match="mask"):
        integrate_normals(normals, CAMERA, mask=np.ones((3, 3), np.bool_))
    with pytest.raises(InputError, match="face away"):
        integrate_normals(-normals, CAMERA)


def test_without_a_word_it_is_poisson():
    normals, depth = plane()
    found = integrate_normals(normals, CAMERA)
    assert np.array_equal(found.depth.depth, Poisson().integrate(normals, CAMERA).depth)
    np.testing.assert_allclose(found.depth.depth, depth - depth.mean(), atol=1e-8)
    assert [step.name for step in found.steps if step.done] == ["depth (poisson)", "mesh"]


def test_missing_depth_is_marked_inside_the_mask_only():
    flags = np.array([[0, Flag.SHADOWED, Flag.OUTSIDE_MASK]], np.uint16)
    marked = mark_missing_depth(flags, np.array([[1.0, np.nan, np.nan]]))
    assert marked.tolist() == [[0, Flag.SHADOWED | Flag.NO_DEPTH, Flag.OUTSIDE_MASK]]
    assert flags[0, 1] == Flag.SHADOWED
