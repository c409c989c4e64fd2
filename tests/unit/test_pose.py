"""Poses: rotations and positions of cameras."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from psstereo.camera import Pose
from psstereo.errors import InputError

TURN = Rotation.from_rotvec([0.3, -0.8, 0.2]).as_matrix()


def test_there_and_back_again():
    pose = Pose(rotation=TURN, position=np.array([1.0, -2.0, 3.0]))
    points = np.random.default_rng(0).normal(size=(4, 5, 3))
    np.testing.assert_allclose(pose.to_camera(pose.to_scene(points)), points, rtol=0, atol=1e-14)
    np.testing.assert_allclose(pose.to_scene(np.zeros(3)), pose.position)
    np.testing.assert_array_equal(Pose().to_scene(points), points)


def test_looking_at_puts_the_target_on_the_axis_and_up_in_the_image():
    position, target = np.array([3.0, 4.0, 12.0]), np.array([0.5, 1.0, 0.0])
    pose = Pose.looking_at(position, target)
    seen = pose.to_camera(target)
    np.testing.assert_allclose(seen, [0, 0, -np.linalg.norm(position - target)], atol=1e-13)
    above = pose.to_camera(target + np.array([0, 0.1, 0]))
    assert above[1] > 0
    assert abs(above[0]) < 1e-13
    np.testing.assert_allclose(Pose.looking_at(np.array([0, 0, 5.0]), np.zeros(3)).rotation, np.eye(3), atol=1e-15)


@pytest.mark.parametrize(
    ("position", "target", "up"),
    [
        (np.ones(3), np.ones(3), None),
        (np.array([0, 5.0, 0]), np.zeros(3), None),
        (np.ones(3), np.zeros(3), np.ones(3)),
        (np.full(3, np.nan), np.zeros(3), None),
    ],
)
def test_a_view_without_a_direction_is_refused(position, target, up):
    with pytest.raises(InputError, match="looks at"):
        Pose.looking_at(position, target, up)


@pytest.mark.parametrize(
    "wrong",
    [
        {"rotation": np.diag([1.0, 1.0, -1.0])},
        {"rotation": 2 * np.eye(3)},
        {"rotation": np.eye(2)},
        {"rotation": np.full((3, 3), np.nan)},
        {"position": np.zeros(2)},
        {"position": np.array([0, 0, np.inf])},
    ],
)
def test_what_is_no_pose_is_refused(wrong):
    with pytest.raises(InputError, match="rotation"):
        Pose(**wrong)


def test_a_pose_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        Pose().position[0] = 1.0
