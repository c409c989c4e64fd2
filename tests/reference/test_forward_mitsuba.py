"""The forward model against an independent renderer, Mitsuba 3, in absolute radiances; nothing is fitted."""

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from psstereo.errors import UnsupportedError
from psstereo.lights import Ambient, Directional, Disc, Led
from psstereo_synth.meshes.relief import mesh_of_relief
from psstereo_synth.mitsuba_twin import MitsubaTwin
from psstereo_synth.patterns import Checker, Constant
from psstereo_synth.rendering import render
from psstereo_synth.scenes import Material, Scene, Viewpoint
from psstereo_synth.sensor import Sensor
from psstereo_synth.shapes import GaussianHills, Sphere
from psstereo_synth.view import centred_orthographic, centred_pinhole

pytest.importorskip("mitsuba", reason="Mitsuba comes with the extra `test`")

TOWARD = np.array([0.5, 0.3, 0.8])
HILLS = GaussianHills(steepness=2.0)
SUN = Directional(direction=TOWARD, strength=1000.0)
LAMP = Led(position=2 * TOWARD, axis=[0, 0, -1], mu=0.0, flux=500.0)
SKYLIGHT = Disc(centre=3 * TOWARD, axis=-TOWARD / np.linalg.norm(TOWARD), radius=0.5, radiance=100.0)
SURROUNDING = Ambient(radiance=10.0)


def scene(surface, light, size, *, pinhole=False, beams=64):
    """A gray matte surface, seen by a sensor that delivers radiances as they are."""
    camera, pose = centred_orthographic((size, size))
    if pinhole:
        camera, pose = centred_pinhole((size, size), focal=3.5 * size, distance=8.0)
    return Scene(
        surface=surface,
        material=Material(albedo=Constant(albedo=0.6)),
        viewpoints=(Viewpoint(camera=camera, pose=pose),),
        size=(size, size),
        lights=(light,),
        sensor=Sensor(bits=None, white=1.0),
        beams=beams,
    )


def ours(made):
    return render(made, engine="rays")[0].capture.stack.frame(0)[..., 0]


def inner(*images):
    """Pixels that are lit in all images, as are their neighbours: no outlines, no edges of shadows."""
    return binary_erosion(np.all([image > 0 for image in images], axis=0), np.ones((3, 3)), iterations=3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "pinhole", "light"),
    [
        (Sphere, False, SUN),
        (Sphere, True, LAMP),
        (lambda: HILLS, False, LAMP),
        (lambda: mesh_of_relief(HILLS, 500), True, SUN),
    ],
    ids=["sphere-orthographic-sun", "sphere-pinhole-lamp", "hills-orthographic-lamp", "hills-pinhole-sun"],
)
def test_suns_and_lamps_at_16_samples(make, pinhole, light):
    """Median relative difference below 0.05 %: what is left is Mitsuba's sampling of the pixel's area.

    Every two of surface, camera and light come together in one case.
    """
    surface = make()
    made = scene(surface, light, 256, pinhole=pinhole)
    here, there = ours(made), MitsubaTwin(made).render(light, samples=16).mean[..., 0]
    compared = inner(here, there)
    assert compared.mean() > 0.3
    assert np.median(np.abs(here - there)[compared] / there[compared]) < 5e-4
    # Shadows, cast and attached, are the same up to their edges.
    seen = binary_erosion((here > 0) | (there > 0), np.ones((3, 3)), iterations=2)
    assert ((here > 0) != (there > 0))[seen].mean() < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "light", "pinhole", "beams"),
    [
        (Sphere, SKYLIGHT, False, 64),
        (Sphere, SURROUNDING, True, 64),
        (lambda: HILLS, SKYLIGHT, False, 144),
        (lambda: HILLS, SURROUNDING, False, 1024),
        (lambda: mesh_of_relief(HILLS, 300), SKYLIGHT, True, 144),
    ],
    ids=["sphere-disc", "sphere-surrounding", "hills-disc", "hills-surrounding", "mesh-disc-pinhole"],
)
def test_area_lights_within_three_standard_errors(make, light, pinhole, beams):
    """At least 99.5 % of pixels, penumbrae among them; chance alone leaves 99.7 %."""
    made = scene(make(), light, 72, pinhole=pinhole, beams=beams)
    here, found = ours(made), MitsubaTwin(made).render(light, samples=256, moments=True)
    there = found.mean[..., 0]
    compared = binary_erosion((here > 0) & (there > 0), np.ones((3, 3)), iterations=2)
    off = np.abs(here - there)[compared] / found.standard_error[compared]
    assert compared.mean() > 0.3
    assert np.median(found.standard_error[compared] / there[compared]) < 0.04
    assert (off < 3).mean() >= 0.995


def test_what_has_no_counterpart_is_refused():
    made = scene(Sphere(), SUN, 16)
    with pytest.raises(UnsupportedError, match="no counterpart"):
        MitsubaTwin(made).render(Led(position=[0, 0, 3], axis=[0, 0, -1], mu=1.0, flux=1.0))
    with pytest.raises(UnsupportedError, match="matte surface of one colour"):
        MitsubaTwin(made.changed(material=Material(albedo=Checker())))
    with pytest.raises(UnsupportedError, match="pinhole"):
        MitsubaTwin(scene(HILLS, SUN, 16, pinhole=True))
