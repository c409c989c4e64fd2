import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.lights.motion import rigid_motion


def test_a_rotation_passes_as_it_is():
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    r, t = rigid_motion(turn.tolist(), [1, 2, 3])
    np.testing.assert_array_equal(r, turn)
    assert t.tolist() == [1.0, 2.0, 3.0]
    assert r.dtype == t.dtype == np.float64
    rigid_motion(turn.astype(np.float32), np.zeros(3))


@pytest.mark.parametrize(
    ("rotation", "translation"),
    [
        (-np.eye(3), np.zeros(3)),
        (np.diag([1.0, 1.0, -1.0]), np.zeros(3)),
        (2 * np.eye(3), np.zeros(3)),
        (np.eye(3) + 1e-5, np.zeros(3)),
        (np.eye(4), np.zeros(3)),
        (np.full((3, 3), np.nan), np.zeros(3)),
        (np.eye(3), np.zeros(2)),
        (np.eye(3), np.array([0.0, np.inf, 0.0])),
    ],
)
def test_what_is_no_rigid_motion_is_refused(rotation, translation):
    with pytest.raises(InputError, match="rotation"):
        rigid_motion(rotation, translation)
