import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole, Pose
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.matching import (
    CalibratedView,
    Noise,
    PlaneSweep,
    ViewImages,
    agreeing_views,
    covisible,
    inside_box,
    nearest_views,
    rectified_views,
)
from tests.unit.matching.pairs import texture

CAMERA = Pinhole(fx=80, fy=80, cx=29.5, cy=19.5)
SIZE = (40, 60)


def standing(position, target=(0.0, 0.0, 0.0), name="view"):
    return CalibratedView(camera=CAMERA, pose=Pose.looking_at(np.array(position), np.array(target)), name=name)


def plane_image(view, seed=3):
    """Return what a view sees of a painted plane z = 0, and how far it is."""
    from scipy.ndimage import map_coordinates

    rays = CAMERA.rays(SIZE) @ view.pose.rotation.T
    distance = -view.pose.position[2] / rays[..., 2]
    points = view.pose.position + distance[..., None] * rays
    paint = texture((400, 400), seed, smooth=3)
    image = map_coordinates(paint, [200 - 40 * points[..., 1], 200 + 40 * points[..., 0]], order=1)
    return image, distance


def images(views):
    return [ViewImages.from_arrays(plane_image(view)[0], noise=Noise(read=0.004), name=view.name) for view in views]


@pytest.fixture(scope="module")
def ring():
    return [standing((x, y, 5.0), name=f"{x}") for x, y in ((0.0, 0.0), (0.7, 0.0), (-0.7, 0.2), (0.0, 0.8))]


def test_a_slanted_plane_is_found_from_several_sides(ring):
    views = [standing((0.8, 0.3, 5.0)), *ring[1:]]
    found = PlaneSweep(planes=48, window=3).depth(images(views), views, 4.0, 6.5)
    truth = plane_image(views[0])[1]
    known = np.isfinite(found.depth)
    assert known.mean() > 0.8
    # A label is a step of 1.9 % in depth at the far end.
    assert np.median(np.abs(found.depth - truth)[known] / truth[known]) < 0.005
    assert np.quantile(np.abs(found.depth - truth)[known] / truth[known], 0.95) < 0.02


def test_views_agree_where_depths_do(ring):
    depths = [plane_image(view)[1] for view in ring]
    count = agreeing_views(depths, ring, 0, tolerance=0.01)
    assert (count[12:28, 20:40] == 3).all()
    wrong = [depths[0] * 1.1, *depths[1:]]
    assert agreeing_views(wrong, ring, 0, tolerance=0.01).max() == 0


def test_near_views_come_first_and_the_same_place_never(ring):
    views = [*ring, standing((0.0, 0.0, 5.0)), standing((0.0, 0.0, -5.0))]
    assert nearest_views(views, 0, 5) == [1, 2, 3]


def test_points_project_where_they_came_from(ring):
    depth = plane_image(ring[1])[1]
    column, row, distance = ring[1].project(ring[1].points(depth))
    rows, columns = np.indices(SIZE)
    np.testing.assert_allclose(column, columns, atol=1e-9)
    np.testing.assert_allclose(row, rows, atol=1e-9)
    np.testing.assert_allclose(distance, depth, rtol=1e-12)
    flat = CalibratedView(camera=Orthographic(pixel_size=0.5), pose=Pose(position=np.array([1.0, 2.0, 0.0])))
    column, row, _ = flat.project(flat.points(np.zeros(SIZE)))
    np.testing.assert_allclose(column, columns, atol=1e-12)


def test_disparity_of_a_rectified_pair_is_focal_baseline_over_depth():
    left, right = rectified_views(CAMERA, 0.4, shift=3.0)
    depth = np.full(SIZE, 8.0)
    column, row, seen = covisible(depth, left, right, SIZE)
    rows, columns = np.indices(SIZE)
    expected = columns - 80 * 0.4 / 8 + 3
    np.testing.assert_allclose(column[seen], expected[seen], atol=1e-9)
    np.testing.assert_allclose(row[seen], rows[seen], atol=1e-9)
    assert seen.mean() > 0.9
    with pytest.raises(InputError):
        rectified_views(CAMERA, -1.0)


def test_what_stands_before_hides():
    left, right = rectified_views(CAMERA, 1.0)
    depth = np.full(SIZE, 10.0)
    depth[:, 30:40] = 5.0  # 16 against 8 pixels of disparity
    _, _, seen = covisible(depth, left, right, SIZE)
    assert not seen[:, 23:29].any()
    assert seen[:, 30:40].all()


def test_points_are_in_the_box_or_not():
    points = np.array([[0.0, 0, 0], [2, 0, 0], [np.nan, 0, 0]])
    assert inside_box(points, -np.ones(3), np.ones(3)).tolist() == [True, False, False]


def test_what_cannot_be_swept_is_refused(ring):
    one = images(ring)
    with pytest.raises(InputError, match="two views"):
        PlaneSweep().depth(one[:1], ring[:1], 1, 2)
    with pytest.raises(InputError, match="positive lengths"):
        PlaneSweep().depth(one, ring, 3, 2)
    flat = CalibratedView(camera=Orthographic(), pose=Pose())
    with pytest.raises(UnsupportedError, match="Pinholes"):
        PlaneSweep().depth(one[:2], [ring[0], flat], 1, 2)
    with pytest.raises(OptionError):
        PlaneSweep(window=4)
    with pytest.raises(OptionError):
        PlaneSweep(planes=2)
