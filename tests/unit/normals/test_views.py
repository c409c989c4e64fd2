"""What is seen of images under near lamps: against the model written out, pixel by pixel."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.errors import UnsupportedError
from psstereo.lights import Rig
from psstereo.normals.views import lamp_directions, views_under_lamps
from psstereo.results import DepthKind, DepthResult, NormalsResult
from psstereo.stack import MemoryStack
from psstereo_synth import ring as distant_ring
from tests.unit.near.near_scenes import pinhole_sphere, ring, shoot


@pytest.fixture(scope="module")
def scene():
    camera, depth, normals, mask = pinhole_sphere(40)
    lamps = ring(8, flux=np.array([1.0, 0.8, 0.5]))
    capture = shoot(camera, depth, normals, mask, lamps)
    flags = np.zeros(mask.shape, np.uint16)
    unknown = np.full(mask.shape, np.nan)
    found = NormalsResult(normals=normals, albedo=unknown, uncertainty=unknown, flags=flags)
    surface = DepthResult(
        depth=depth, kind=DepthKind.DISTANCE, unit="mm", components=mask.astype(int), iterations=0, residual=0.0
    )
    return capture, found, surface


def test_a_matte_surface_leaves_nothing_over_and_images_are_over_the_flux(scene):
    capture, found, surface = scene
    views = views_under_lamps(capture, found, surface, side=20)
    assert np.nanmax(views.residual) < 1e-5
    np.testing.assert_array_equal(np.isfinite(views.residual), capture.mask)
    assert views.images.shape == (8, 20, 20)
    third = capture.stack.frame(3)[::2, ::2] / (capture.rig.lights[3].flux * capture.stack.white)
    expected = np.where(capture.mask[::2, ::2], third.mean(axis=2), np.nan)
    np.testing.assert_allclose(views.images[3], expected, rtol=1e-5)
    assert views.names == capture.stack.names


def test_the_residual_is_that_of_the_best_matte_surface(scene):
    capture, found, surface = scene
    rng = np.random.default_rng(4)
    images = capture.stack.read() * (1 + 0.1 * rng.standard_normal(capture.stack.shape))
    images[2, 20, 20] = np.nan
    views = views_under_lamps(replace(capture, stack=MemoryStack(images)), found, surface)
    points = capture.camera.points(surface.depth)
    for row, column in ((20, 20), (12, 25)):
        kept = np.isfinite(images[:, row, column]).all(axis=1)
        lights = [lamp for lamp, one in zip(capture.rig.lights, kept, strict=True) if one]
        value = (images[kept, row, column] / [lamp.flux for lamp in lights]).mean(axis=1)
        shade = [lamp.irradiance(points[row, column], found.normals[row, column])[0] / lamp.flux[0] for lamp in lights]
        lit = np.array(shade) > 0
        a, b = np.array(shade)[lit], value[lit]
        scale, rest, *_ = np.linalg.lstsq(a[:, None], b, rcond=None)
        assert views.residual[row, column] == pytest.approx(
            np.sqrt(rest[0] / lit.sum()) / (scale[0] * np.sqrt(np.mean(a**2))), rel=1e-5
        )


def test_without_depth_there_are_images_only_and_lamps_stand_where_they_are(scene):
    capture, found, surface = scene
    bare = views_under_lamps(capture, found, None)
    assert np.isnan(bare.residual).all()
    assert np.isfinite(bare.images).any()
    toward = lamp_directions(capture, surface)
    middle = np.nanmedian(capture.camera.points(surface.depth).reshape(-1, 3), axis=0)
    positions = np.array([lamp.position for lamp in capture.rig.lights])
    np.testing.assert_allclose(np.linalg.norm(toward, axis=1), 1.0)
    np.testing.assert_allclose(np.cross(toward, positions - middle), 0.0, atol=1e-9)
    assert (toward[:, 2] > 0).all()  # around the camera, before the object


def test_distant_lights_are_not_for_it(scene):
    capture, found, surface = scene
    distant = replace(capture, rig=Rig.distant(distant_ring(8)))
    with pytest.raises(UnsupportedError, match="8 of the 8 lights are no lamps"):
        views_under_lamps(distant, found, surface)
    assert lamp_directions(distant, surface) is None
