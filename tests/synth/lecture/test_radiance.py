import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo_synth.lecture import LECTURE
from psstereo_synth.lecture.radiometer import APERTURE, LENGTH, STOP, reading

L = 500.0


@pytest.fixture(scope="module")
def found():
    return LECTURE["radiance"]()


def test_a_wall_reads_the_same_at_any_distance(found):
    assert np.array(found.column("wall [")) == pytest.approx(L, rel=1e-13)
    assert reading(L, 1e6, 1e5) == pytest.approx(L, rel=1e-13)
    assert reading(L, 1.0, 0.0) == pytest.approx(L, rel=1e-13)


def test_fog_takes_the_same_share_of_every_metre(found):
    way, fog = np.array(found.column("distance")), np.array(found.column("wall in fog"))
    slope = np.diff(np.log(fog)) / np.diff(way)
    assert slope == pytest.approx(-0.02, rel=1e-5)
    assert fog[0] == pytest.approx(L * np.exp(-0.04), rel=1e-6)


def test_a_lamp_dims_with_the_square_once_it_is_smaller_than_the_field(found):
    way, lamp = np.array(found.column("distance")), np.array(found.column("lamp"))
    near = way < 9
    assert near.sum() >= 3
    assert lamp[near] == pytest.approx(L, rel=1e-13)
    assert (~near).sum() >= 3
    # Field of view π b²/t² = π 1e-6 sr.
    assert lamp[~near] == pytest.approx(L * np.pi * 0.01**2 / way[~near] ** 2 / (np.pi * 1e-6), rel=3e-6)


def test_random_rays_read_the_same():
    rng = np.random.default_rng(7)
    count, distance, radius = 400_000, 20.0, 0.01
    share, turn = rng.uniform(size=(2, count)), rng.uniform(0, 2 * np.pi, (2, count))
    size = np.array([[APERTURE], [STOP]]) * np.sqrt(share)
    start, end = np.stack([size * np.cos(turn), size * np.sin(turn)], axis=-1)
    at_source = start + (end - start) * (LENGTH + distance) / LENGTH
    hits = np.hypot(at_source[:, 0], at_source[:, 1]) < radius
    assert reading(L, radius, distance) == pytest.approx(L * hits.mean(), rel=0.015)  # five standard deviations


def test_a_source_cut_by_the_fields_edge_is_not_read():
    edge = STOP + (APERTURE + STOP) * 9.0 / LENGTH
    inner = STOP * 10.0 - APERTURE * 9.0
    assert reading(L, edge * 1.0001, 9.0) == pytest.approx(L, rel=1e-13)
    assert np.isnan(reading(L, edge * 0.9999, 9.0))
    assert np.isnan(reading(L, inner * 1.0001, 9.0))
    assert reading(L, inner * 0.9999, 9.0) < L


@pytest.mark.parametrize("bad", [-1.0, np.nan])
def test_hostile_numbers_are_refused(bad):
    for arguments in ((bad, 1.0, 1.0), (L, bad, 1.0), (L, 1.0, bad)):
        with pytest.raises(InputError):
            reading(*arguments)
    with pytest.raises(InputError):
        reading(L, 1.0, 1.0, extinction=bad)
