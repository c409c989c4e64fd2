"""Views and meshes of surfaces that are refused."""

import numpy as np
import pytest

from psstereo.camera import Pinhole, Pose
from psstereo.errors import InputError, UnsupportedError
from psstereo_synth.shapes import (
    Elevation,
    Plane,
    Relief,
    Sphere,
)
from psstereo_synth.view import View, centred_orthographic, centred_pinhole, relief_mesh, view_relief
from tests.synth.viewed_surfaces import above, oblique


@pytest.mark.parametrize("shape", [(0, 5), (5, 0), (-1, 5), (5,)])
def test_pictures_without_pixels_are_refused(shape):
    camera, pose = centred_orthographic((5, 5))
    for call in (
        lambda: view_relief(Sphere(), camera, pose, shape),
        lambda: centred_orthographic(shape),
        lambda: centred_pinhole(shape, focal=1.0, distance=1.0),
    ):
        with pytest.raises(InputError, match="at least one of each"):
            call()


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_lengths_that_mean_nothing_are_refused(value):
    with pytest.raises(InputError):
        centred_orthographic((5, 5), width=value)
    with pytest.raises(InputError):
        centred_pinhole((5, 5), focal=1.0, distance=value)
    with pytest.raises(InputError):
        centred_pinhole((5, 5), focal=value, distance=1.0)
    with pytest.raises(InputError):
        view_relief(Sphere(), *centred_orthographic((5, 5)), (5, 5), scale=value)


@pytest.mark.parametrize("samples", [0, -3, 2.5])
def test_numbers_of_samples_that_mean_nothing_are_refused(samples):
    with pytest.raises(InputError, match="samples"):
        view_relief(Sphere(), *above(), samples=samples)


@pytest.mark.parametrize("tilt", [np.pi / 2, 2.0, np.pi])
def test_a_parallel_projection_from_below_is_refused(tilt):
    with pytest.raises(InputError, match="below the sphere"):
        view_relief(Sphere(), *oblique(tilt=tilt))


@pytest.mark.parametrize("position", [(0, 0, 0.5), (0.2, 0.1, -3.0), (2.0, 0.0, -0.1), (0.0, 0.0, 0.9)])
def test_a_pinhole_below_the_surface_is_refused(position):
    with pytest.raises(InputError, match="below the sphere"):
        view_relief(
            Sphere(radius=0.9), Pinhole(fx=9.0, fy=9.0, cx=2.0, cy=2.0), Pose(position=np.array(position)), (5, 5)
        )


def test_a_picture_that_sees_nothing_is_refused():
    camera, pose = centred_orthographic((5, 5))
    away = Pose(position=pose.position + np.array([10.0, 0, 0]))
    with pytest.raises(InputError, match="None of the 25 pixels sees the sphere"):
        view_relief(Sphere(), camera, away, (5, 5))
    up = Pose(rotation=np.diag([1.0, -1, -1]), position=np.array([0, 0, 5.0]))
    with pytest.raises(InputError, match="sees the sphere"):
        view_relief(Sphere(), Pinhole(fx=5.0, fy=5.0, cx=2.0, cy=2.0), up, (5, 5))


class Endless(Relief):
    """A surface that does not say how far it reaches."""

    name = "endless"
    summary = "z = 0."

    @property
    def bounds(self):
        return 0.0, 0.0

    def evaluate(self, x, y):
        return Elevation(height=0.0 * x, slope_x=0.0 * x, slope_y=0.0 * y)


def test_surfaces_that_do_not_say_how_far_they_reach_are_seen_from_above_only():
    assert view_relief(Endless(), *centred_orthographic((5, 5)), (5, 5)).geometry.mask.all()
    with pytest.raises(UnsupportedError, match="how far it reaches"):
        view_relief(Endless(), *above())
    with pytest.raises(UnsupportedError):
        relief_mesh(Endless(), 5)


def test_views_of_other_sizes_are_refused():
    view = view_relief(Sphere(), *centred_orthographic((5, 5)), (5, 5))
    with pytest.raises(InputError, match="same image"):
        View(camera=view.camera, pose=view.pose, geometry=view.geometry, depth=view.depth[:4])


@pytest.mark.parametrize("n", [1, 0, -4, 2.5])
def test_meshes_of_no_cell_are_refused(n):
    with pytest.raises(InputError):
        relief_mesh(Plane(), n)


def test_meshes_that_miss_the_surface_are_refused():
    with pytest.raises(InputError, match="wholly on the sphere"):
        relief_mesh(Sphere(), 3)
