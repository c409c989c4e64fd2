"""What every camera promises; a new one is tested by being listed in the catalogue."""

import pickle

import numpy as np
import pytest

from psstereo.camera import CAMERAS, Orthographic, Pinhole
from psstereo.errors import InputError
from psstereo.results import DepthKind

SHAPE = (6, 9)
MAKERS = {
    "orthographic": lambda: Orthographic(pixel_size=0.25, length_unit="mm"),
    "pinhole": lambda: Pinhole(fx=300.0, fy=280.0, cx=4.2, cy=1.7, skew=6.0),
}


@pytest.fixture(params=sorted(CAMERAS))
def camera(request):
    assert request.param in MAKERS, "say how to make one"
    return MAKERS[request.param]()


def test_rays_look_into_the_scene(camera):
    rays = camera.rays(SHAPE)
    assert rays.shape == (*SHAPE, 3)
    assert rays.dtype == np.float64
    assert (rays[..., 2] == -1.0).all()


def test_moving_along_the_ray_is_what_depth_measures(camera):
    near = np.random.default_rng(0).uniform(2.0, 3.0, SHAPE)
    step = camera.points(near + 0.5) - camera.points(near)
    toward = -1.0 if camera.depth_kind is DepthKind.HEIGHT else 1.0
    np.testing.assert_allclose(step, 0.5 * toward * camera.rays(SHAPE), rtol=0, atol=1e-15)


def test_x_runs_right_and_y_runs_up(camera):
    points = camera.points(np.full(SHAPE, 2.0))
    assert points.shape == (*SHAPE, 3)
    assert (np.diff(points[..., 0], axis=1) > 0).all()
    assert (np.diff(points[..., 1], axis=0) < 0).all()
    assert np.ptp(points[..., 2]) == 0.0


def test_unknown_depth_gives_unknown_points(camera):
    depth = np.full(SHAPE, 2.0)
    depth[3, 4] = np.nan
    unknown = np.isnan(camera.points(depth))
    assert unknown[3, 4, 2]
    assert np.count_nonzero(unknown.any(axis=-1)) == 1


def test_float32_depth_gives_float64_points(camera):
    assert camera.points(np.ones(SHAPE, np.float32)).dtype == np.float64


def test_cameras_are_values(camera):
    assert pickle.loads(pickle.dumps(camera)) == camera
    assert hash(camera) == hash(pickle.loads(pickle.dumps(camera)))
    assert CAMERAS[camera.name] is type(camera)
    assert camera.unit


def test_orthographic_points_in_closed_form():
    points = Orthographic(pixel_size=0.5, length_unit="mm").points(np.full((3, 4), 7.0))
    np.testing.assert_array_equal(points[0, 0], [0.0, 0.0, 7.0])
    np.testing.assert_array_equal(points[2, 3], [1.5, -1.0, 7.0])
    assert Orthographic().unit == "px"


def test_pinhole_rays_meet_their_pixels():
    """K applied to a point in computer vision's axes (y down, z forward) is the pixel again."""
    camera = Pinhole(fx=300.0, fy=280.0, cx=4.2, cy=1.7, skew=6.0)
    depth = np.random.default_rng(1).uniform(0.5, 9.0, SHAPE)
    vision = camera.points(depth) * [1.0, -1.0, -1.0]
    np.testing.assert_allclose(vision[..., 2], depth, rtol=1e-15)
    image = vision @ camera.matrix.T
    rows, columns = np.indices(SHAPE)
    np.testing.assert_allclose(image[..., 0] / image[..., 2], columns, rtol=0, atol=1e-12)
    np.testing.assert_allclose(image[..., 1] / image[..., 2], rows, rtol=0, atol=1e-12)


@pytest.mark.parametrize("scale", [1.0, -3.0, 1e-6])
def test_pinhole_from_its_matrix_of_any_scale(scale):
    camera = Pinhole(fx=300.0, fy=280.0, cx=4.2, cy=1.7, skew=6.0)
    np.testing.assert_allclose(Pinhole.from_matrix(scale * camera.matrix).matrix, camera.matrix, rtol=1e-15)


@pytest.mark.parametrize(
    "matrix",
    [
        np.eye(4),
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
        np.array([[300.0, 0, 0], [0, 300, 0], [160, 120, 1]]),
        np.diag([-300.0, 300, 1]),
        np.diag([300.0, 0, 1]),
    ],
)
def test_matrices_of_no_camera_are_refused(matrix):
    with pytest.raises(InputError):
        Pinhole.from_matrix(matrix)


@pytest.mark.parametrize("size", [0.0, -1.0, np.nan, np.inf])
def test_pixel_sizes_that_mean_nothing_are_refused(size):
    with pytest.raises(InputError, match="pixel size"):
        Orthographic(pixel_size=size)


@pytest.mark.parametrize("change", [{"fx": 0.0}, {"fy": -1.0}, {"cx": np.nan}, {"cy": np.inf}, {"skew": np.nan}])
def test_pinhole_numbers_that_mean_nothing_are_refused(change):
    with pytest.raises(InputError):
        Pinhole(**({"fx": 300.0, "fy": 300.0, "cx": 1.0, "cy": 1.0} | change))
