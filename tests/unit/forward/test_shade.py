"""Shading: exact where it is matte, a sum of beams where it is not, and nothing from behind."""

import numpy as np
import pytest

from psstereo.brdf import Brdf, Lambert
from psstereo.errors import InputError
from psstereo.forward import Geometry, Shadows, lambertian_images, shade
from psstereo.lights import Beam, Directional, Led, Rig
from psstereo.lights.light import Light

UP = np.array([0.0, 0.0, 1.0])


class Shiny(Brdf):
    """A lobe about the mirror direction, enough to tell one viewpoint from another."""

    name = "shiny"

    @property
    def channels(self):
        return 1

    def evaluate(self, normals, to_light, to_eye):
        half = to_light + to_eye
        half = half / np.linalg.norm(half, axis=-1, keepdims=True)
        return np.einsum("...i,...i->...", normals, half)[..., None] ** 30


class Pair(Light):
    """Two suns as one light with an extent."""

    name = "pair"
    positional = False
    extended = True
    channels = 1
    suns = (
        Directional(direction=[0.6, 0.0, 0.8], strength=2.0),
        Directional(direction=[-0.6, 0.0, 0.8], strength=6.0),
    )

    def directions(self, points):
        return np.full_like(points, np.nan)

    def irradiance(self, points, normals):
        return sum(sun.irradiance(points, normals) for sun in self.suns)

    def beams(self, points, count):
        for sun in self.suns:
            yield from sun.beams(points, 1)

    def moved(self, rotation, translation):
        raise NotImplementedError


class Blind(Shadows):
    """Blocks whatever comes from the left."""

    name = "blind"

    def lit(self, points, normals, beam):
        toward = np.broadcast_to(beam.directions, points.shape)
        return toward[:, 0] >= 0


def bowl(count=11, to_eye=UP, **changes):
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(count * count, 3)) + 1.5 * UP
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = rng.uniform(-1, 1, (count * count, 3))
    return Geometry(points=points, normals=normals, to_eye=to_eye, mask=np.ones((count, count), bool), **changes)


def test_a_matte_surface_is_as_in_the_plain_model():
    seen = bowl()
    rho = np.random.default_rng(0).uniform(0.1, 0.9, (121, 3))
    lamps = Rig((Directional(direction=[1, 2, 3], strength=[3.0, 2.0, 1.0]),
                 Led(position=[0, 2, 5], axis=[0, 0, -1], mu=1.0, flux=9.0)))  # fmt: skip
    images = lambertian_images(
        seen.scatter(seen.normals), seen.scatter(rho / np.pi), lamps, points=seen.scatter(seen.points)
    )
    facing = seen.normals[:, 2] > 0
    for light, image in zip(lamps.lights, images, strict=True):
        shading = shade(seen, Lambert(albedo=rho), light)
        np.testing.assert_allclose(shading.radiance[facing], image.reshape(-1, 3)[facing], rtol=1e-14)
        assert not shading.radiance[~facing].any()
        lit = (light.directions(seen.points) * seen.normals).sum(axis=1) > 0
        np.testing.assert_array_equal(shading.visibility, lit)


def test_matte_by_beams_and_by_closed_form_agree():
    class Slow(Lambert):
        constant = False

    seen = bowl()
    for light in (Pair(), Led(position=[0, 2, 5], axis=[0, 0, -1], mu=1.0, flux=9.0)):
        for shadows in (None, Blind()):
            plain = shade(seen, Lambert(albedo=[0.5]), light, shadows=shadows)
            slow = shade(seen, Slow(albedo=[0.5]), light, shadows=shadows)
            np.testing.assert_allclose(slow.radiance, plain.radiance, rtol=1e-13, atol=1e-15)
            np.testing.assert_allclose(slow.visibility, plain.visibility, rtol=1e-13)


def test_a_penumbra_is_the_share_that_arrives():
    flat = Geometry(points=np.zeros((1, 3)), normals=UP[None], to_eye=UP, mask=np.ones((1, 1), bool))
    shading = shade(flat, Lambert(albedo=[0.5]), Pair(), shadows=Blind())
    assert shading.visibility == pytest.approx(0.25)
    assert shading.radiance == pytest.approx(0.5 / np.pi * 2.0 * 0.8)


def test_a_glossy_surface_depends_on_the_viewpoint_a_matte_one_does_not():
    sun = Directional(direction=[0.3, 0.2, 0.9], strength=1.0)
    side = np.array([0.5, 0.0, np.sqrt(0.75)])
    both = (bowl().normals @ UP > 0) & (bowl().normals @ side > 0)
    matte = [shade(bowl(to_eye=eye), Lambert(albedo=[0.5]), sun).radiance[both] for eye in (UP, side)]
    shiny = [shade(bowl(to_eye=eye), Shiny(), sun).radiance[both] for eye in (UP, side)]
    np.testing.assert_array_equal(*matte)
    assert np.abs(shiny[0] - shiny[1]).max() > 0.1


def test_fog_takes_its_share_on_both_ways():
    distance = 4.0
    flat = Geometry(
        points=np.zeros((1, 3)), normals=UP[None], to_eye=UP[None], mask=np.ones((1, 1), bool),
        eye_distances=np.array([distance]),
    )  # fmt: skip
    lamp = Led(position=[0, 0, 3.0], axis=[0, 0, -1], mu=0.0, flux=7.0)
    sun = Directional(direction=UP, strength=2.0)
    for brdf in (Lambert(albedo=[0.5]), Shiny()):
        clear = shade(flat, brdf, lamp).radiance
        foggy = shade(flat, brdf, lamp, extinction=0.2).radiance
        np.testing.assert_allclose(foggy, clear * np.exp(-0.2 * (3.0 + distance)), rtol=1e-14)
        # A sun is beyond the fog's business: its strength is given where it arrives.
        np.testing.assert_allclose(
            shade(flat, brdf, sun, extinction=0.2).radiance, shade(flat, brdf, sun).radiance * np.exp(-0.2 * distance)
        )


def test_maps_and_channels_have_to_fit():
    seen = bowl()
    sun = Directional(direction=UP, strength=[1.0, 2.0])
    assert shade(seen, Lambert(albedo=[0.5]), sun).radiance.shape == (121, 2)
    with pytest.raises(InputError, match="channels"):
        shade(seen, Lambert(albedo=[0.5, 0.4, 0.3]), sun)
    with pytest.raises(InputError, match="map of 7 points"):
        shade(seen, Lambert(albedo=np.full((7, 1), 0.5)), sun)
    for wrong in ({"beams": 0}, {"extinction": -1.0}, {"extinction": np.nan}):
        with pytest.raises(InputError, match="beams"):
            shade(seen, Lambert(albedo=[0.5]), sun, **wrong)


@pytest.mark.parametrize(
    "changes",
    [
        {"points": np.zeros((5, 3))},
        {"normals": np.zeros((6, 2))},
        {"to_eye": np.zeros((5, 3))},
        {"points": np.full((6, 3), np.nan)},
        {"normals": np.full((6, 3), np.inf)},
    ],
)
def test_geometry_that_does_not_fit_is_refused(changes):
    good = {
        "points": np.zeros((6, 3)),
        "normals": np.tile(UP, (6, 1)),
        "to_eye": UP,
        "mask": np.array([[True, True, False, True], [True, False, True, True]]),
    }
    seen = Geometry(**good)
    np.testing.assert_array_equal(seen.scatter(np.arange(1.0, 7.0)), [[1, 2, 0, 3], [4, 0, 5, 6]])
    assert seen.scatter(seen.normals, np.nan).shape == (2, 4, 3)
    with pytest.raises(InputError, match="mask"):
        Geometry(**{**good, **changes})


def test_a_beam_is_parallel_only_from_infinity():
    assert Beam(directions=UP, irradiance=np.ones(1)).parallel
    assert not Beam(directions=UP, irradiance=np.ones(1), distances=4.0).parallel
    assert not Beam(directions=UP[None], irradiance=np.ones(1)).parallel
