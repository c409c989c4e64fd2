import pickle

import numpy as np
import pytest

from psstereo.errors import RigError, UnsupportedError
from psstereo.lights import Ambient, Directional, Harmonics, Led, Total

SUN = Directional(direction=[0.3, -0.5, 0.9], strength=[2.0, 1.0, 0.5])
LAMP = Led(position=[0, 1, 4.0], axis=[0, 0, -1], mu=1.0, flux=7.0)
ROOM = Ambient(radiance=0.2)


def scene(count=60, seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    return rng.uniform(-1, 1, (count, 3)), normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_irradiance_is_the_sum_in_all_channels():
    points, normals = scene()
    total = Total(lights=(LAMP, SUN, ROOM))
    parts = [part.irradiance(points, normals) for part in (LAMP, SUN, ROOM)]
    assert total.channels == 3
    np.testing.assert_allclose(total.irradiance(points, normals), parts[0] + parts[1] + parts[2], rtol=1e-15)


def test_it_leaves_the_parts_irradiance_alone():
    points, normals = scene()
    before = SUN.irradiance(points, normals)
    Total(lights=(SUN, SUN)).irradiance(points, normals)
    np.testing.assert_array_equal(SUN.irradiance(points, normals), before)


def test_it_knows_what_its_parts_are():
    assert (Total(lights=(SUN,)).positional, Total(lights=(SUN,)).extended) == (False, False)
    assert (Total(lights=(LAMP,)).positional, Total(lights=(LAMP,)).extended) == (True, False)
    assert (Total(lights=(SUN, SUN)).positional, Total(lights=(SUN, SUN)).extended) == (False, True)
    assert (Total(lights=(ROOM,)).positional, Total(lights=(ROOM,)).extended) == (False, True)
    again = pickle.loads(pickle.dumps(Total(lights=(SUN,))))
    assert (again.positional, again.extended, again.distant) == (False, False, False)


def test_sums_of_sums_are_taken_apart():
    assert Total(lights=(Total(lights=(SUN, LAMP)), ROOM)).lights == (SUN, LAMP, ROOM)


def test_directions_are_those_of_one_light_or_of_none():
    points, _ = scene()
    np.testing.assert_array_equal(Total(lights=(LAMP,)).directions(points), LAMP.directions(points))
    assert np.isnan(Total(lights=(SUN, LAMP)).directions(points)).all()


def test_beams_share_out_the_count():
    points, normals = scene()
    smooth = Harmonics(coefficients=[1.0, 0.1, 0.2, 0.1, 0, 0, 0.1, 0, 0])
    total = Total(lights=(SUN, ROOM, LAMP, smooth))
    beams = list(total.beams(points, 258))
    # 256 for two extended lights, each of which gives twice its share since half is below any surface.
    assert len(beams) == 2 + 2 * 128 + 2 * 128
    assert all(beam.irradiance.shape[-1] == 3 for beam in beams)
    assert sum(np.ndim(beam.distances) > 0 for beam in beams) == 1
    whole = sum(
        np.maximum((np.broadcast_to(b.directions, normals.shape) * normals).sum(axis=1), 0.0)[:, None] * b.irradiance
        for b in beams
    )
    np.testing.assert_allclose(whole, total.irradiance(points, normals), rtol=4e-3)


def test_each_part_keeps_a_beam_however_few_are_asked_for():
    assert len(list(Total(lights=(SUN, LAMP)).beams(np.zeros((2, 3)), 1))) == 2
    assert len(list(Total(lights=(SUN, ROOM)).beams(np.zeros((2, 3)), 1))) > 1


def test_moved_moves_every_part():
    points, normals = scene()
    turn, shift = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]), np.array([3.0, -1.0, 0.5])
    total = Total(lights=(SUN, LAMP, ROOM))
    moved = total.moved(turn, shift).irradiance(points @ turn.T + shift, normals @ turn.T)
    np.testing.assert_allclose(moved, total.irradiance(points, normals), rtol=1e-13)


def test_what_cannot_be_added_is_refused():
    two = Ambient(radiance=[1.0, 2.0])
    with pytest.raises(RigError, match="2 and 3 channels"):
        Total(lights=(SUN, two, ROOM))
    with pytest.raises(RigError, match="nothing"):
        Total(lights=())
    with pytest.raises(RigError, match="float"):
        Total(lights=(SUN, 1.0))
    with pytest.raises(UnsupportedError, match="sum"):
        Total(lights=(SUN, ROOM)).idealised()
