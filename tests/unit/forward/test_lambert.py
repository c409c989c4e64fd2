import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.forward import lambertian_images
from psstereo.lights import Led, Rig
from psstereo_synth import spiral


def scene(shape=(5, 6), seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(*shape, 3))
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True), rng.uniform(0, 0.3, shape)


@pytest.mark.parametrize("colours", [(1, 1), (3, 1), (1, 3), (3, 3)])
def test_against_a_loop(colours):
    """L_out = ρ E_sun max(0, n·l), pixel by pixel, channel by channel."""
    of_paint, of_light = colours
    normals, _ = scene()
    rng = np.random.default_rng(1)
    rho, strengths = rng.uniform(0, 0.3, (5, 6, of_paint)), rng.uniform(100, 1000, (7, of_light))
    directions = spiral(7)
    images = lambertian_images(normals, rho, Rig.distant(directions, strengths))
    channels = max(colours)
    assert images.shape == (7, 5, 6, channels)
    for i, y, x, c in np.ndindex(images.shape):
        cosine = sum(normals[y, x, k] * directions[i, k] for k in range(3))
        expected = rho[y, x, c % of_paint] * strengths[i, c % of_light] * max(0.0, cosine)
        assert images[i, y, x, c] == pytest.approx(expected, rel=1e-12, abs=1e-13)


def test_a_near_lamp_needs_points():
    normals, rho = scene()
    lamp = Led(position=[0.0, 0.0, 5.0], axis=[0.0, 0.0, -1.0], mu=1.0, flux=3.0)
    points = np.random.default_rng(2).uniform(-1, 1, normals.shape)
    images = lambertian_images(normals, rho, Rig((lamp,)), points=points)
    np.testing.assert_allclose(images[0, ..., 0], rho * lamp.irradiance(points, normals)[..., 0], rtol=1e-15)
    with pytest.raises(InputError, match="no surface points"):
        lambertian_images(normals, rho, Rig((lamp,)))


def test_no_surface_is_black():
    normals, rho = scene()
    normals[1, 2], rho[3, 3] = np.nan, np.nan
    images = lambertian_images(normals, rho, Rig.distant([[0, 0, 1]]))
    assert images[0, 1, 2, 0] == images[0, 3, 3, 0] == 0.0
    assert np.count_nonzero(images) == np.count_nonzero((normals[..., 2] > 0) & (rho > 0))


@pytest.mark.parametrize("shape", [(5, 6, 3, 1), (5, 5), (5,), ()])
def test_rho_of_another_shape_is_refused(shape):
    normals, _ = scene()
    with pytest.raises(InputError, match="ρ"):
        lambertian_images(normals, np.zeros(shape), Rig.distant([[0, 0, 1]]))


@pytest.mark.parametrize("shape", [(5, 5, 3), (3,), (5, 6)])
def test_points_of_another_shape_are_refused(shape):
    normals, rho = scene()
    with pytest.raises(InputError, match="Points"):
        lambertian_images(normals, rho, Rig.distant([[0, 0, 1]]), points=np.zeros(shape))


def test_channels_that_disagree_are_refused():
    normals, _ = scene()
    with pytest.raises(InputError, match="channels"):
        lambertian_images(normals, np.zeros((5, 6, 3)), Rig.distant([[0, 0, 1]], np.ones((1, 2))))


def test_negative_rho_is_refused():
    normals, rho = scene()
    rho[2, 2], rho[0, 0] = -1e-9, np.nan
    with pytest.raises(InputError, match=r"smallest ρ is -1e-09"):
        lambertian_images(normals, rho, Rig.distant([[0, 0, 1]]))
