import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from psstereo_synth.lecture import LECTURE
from psstereo_synth.lecture.room import shares

CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)


@pytest.fixture(scope="module")
def rows():
    return {row[:2]: row[2:] for row in LECTURE["room"]().rows}


def patch(origin, u, v, eye):
    # Solid angle of a parallelogram by a Gauss rule over its area.
    x, w = np.polynomial.legendre.leggauss(60)
    x, w = 0.5 + 0.5 * x, 0.5 * w
    arm = origin + x[:, None, None] * u + x[None, :, None] * v - eye
    normal = np.cross(u, v)
    return (np.outer(w, w) * np.abs(arm @ normal) / np.linalg.norm(arm, axis=-1) ** 3).sum()


def test_every_room_adds_up_from_inside_and_to_nothing_from_outside(rows):
    assert {room for room, _ in rows} == {"box", "skewed", "attic"}
    for (_, place), row in rows.items():
        assert sum(row[:3]) == pytest.approx(0.0 if place == "outside" else 4 * np.pi, abs=1e-13)


def test_the_floor_of_the_box_from_its_middle(rows):
    # The rectangle 5 × 4 seen from 1.25 over its middle.
    quarter = np.arctan2(2.5 * 2.0, 1.25 * np.sqrt(2.5**2 + 2.0**2 + 1.25**2))
    assert rows["box", "middle"][:2] == pytest.approx((4 * quarter, 4 * quarter), rel=1e-14)


def test_floors_of_the_skewed_room_and_the_attic_by_quadrature(rows):
    u, v = np.array([5.0, 0, 0]), np.array([0.3 * 4, 4.0, 0])
    top = np.array([0.5 * 2.5, -0.4 * 2.5, 2.5])
    middle = (u + v + top) / 2
    assert rows["skewed", "middle"][0] == pytest.approx(patch(np.zeros(3), u, v, middle), rel=1e-10)
    assert rows["skewed", "middle"][1] == pytest.approx(patch(top, u, v, middle), rel=1e-10)
    ceiling = patch(
        np.array([1.25, 1.0, 2.5]), np.array([2.5, 0, 0]), np.array([0, 2.0, 0]), np.array([2.5, 2.0, 1.25])
    )
    assert rows["attic", "middle"][1] == pytest.approx(ceiling, rel=1e-12)


def test_three_faces_fill_seven_eighths_near_a_right_corner():
    near = shares(CUBE, np.array([1e-9, 2e-9, 3e-9]))
    assert near["floor"] + near["west"] + near["south"] == pytest.approx(7 / 8 * 4 * np.pi, rel=1e-8)


def test_random_directions_meet_one_face_each():
    rng = np.random.default_rng(3)
    corners, eye = CUBE * [5.0, 4.0, 2.5], np.array([1.0, 3.0, 0.7])
    ways = rng.normal(size=(200_000, 3))
    with np.errstate(divide="ignore"):
        far = np.where(ways > 0, [5.0, 4.0, 2.5] - eye, -eye) / ways
    face = np.argmin(far, axis=1) * 2 + (ways[np.arange(len(ways)), np.argmin(far, axis=1)] > 0)
    counted = np.bincount(face, minlength=6) / len(ways) * 4 * np.pi
    found = shares(corners, eye)
    names = ["west", "east", "south", "north", "floor", "ceiling"]
    assert counted == pytest.approx([found[name] for name in names], abs=0.07)  # five standard deviations


@given(
    st.lists(st.floats(0.01, 1.0), min_size=8, max_size=8),
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3),
    st.lists(st.floats(0.1, 100.0), min_size=3, max_size=3),
)
def test_any_sheared_box_adds_up_from_any_point_inside(weights, shear, size):
    turn = np.array([[1.0, shear[0], shear[1]], [0.0, 1.0, shear[2]], [0.0, 0.0, 1.0]])
    corners = CUBE * size @ turn.T
    share = np.array(weights) / np.sum(weights)
    # Rounding grows with the length of a wall over its height and over the cosine at which it is seen.
    slender = np.linalg.cond(turn * size)
    bound = 4 * np.pi * 1e-15 * (100 + slender**2)
    assert sum(shares(corners, share @ corners).values()) == pytest.approx(4 * np.pi, abs=bound)
