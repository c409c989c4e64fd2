"""The sections [lights] and [ambient]: where lights stand and how bright they are at the origin."""

from pathlib import Path

import numpy as np
import pytest

from psstereo.errors import InputError, MissingFileError, OptionError, PsstereoError
from psstereo.io.toml_section import Section
from psstereo.lights import Ambient, Directional, Disc, Environment, Harmonics, Led, Polygon, Sun, sun_path
from psstereo_synth.rigs import arc, ring, spiral
from psstereo_synth.scenes.light_section import read_ambient, read_lights

ORIGIN = np.zeros((1, 3))


def lights(wanted=None, /, folder=Path(), **values):
    return read_lights(Section(values, "lights", folder / "scene.toml"), wanted)


def ambient(folder=Path(), **values):
    return read_ambient(Section(values, "ambient", folder / "scene.toml"))


def directions(found):
    return np.concatenate([light.directions(ORIGIN) for light in found])


def facing(light):
    """Irradiance at the origin of a surface that faces the light."""
    return light.irradiance(ORIGIN, light.directions(ORIGIN))[0]


def test_nothing_said_is_a_spiral_of_24_suns():
    found = lights()
    assert all(isinstance(light, Directional) for light in found)
    assert directions(found) == pytest.approx(spiral(24))
    assert np.array([light.strength for light in found]) == pytest.approx(np.full((24, 1), 1000.0))


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"arrangement": "spiral", "count": 7, "tilt_deg": 30}, spiral(7, max_tilt=np.pi / 6)),
        ({"arrangement": "ring", "count": 7}, ring(7)),
        ({"arrangement": "ring", "count": 1, "tilt_deg": 20}, ring(1, tilt=np.radians(20))),
        ({"arrangement": "arc", "count": 5, "azimuth_deg": 90}, arc(5, azimuth=np.pi / 2)),
        ({"arrangement": "arc", "count": 1}, [[0, 0, 1]]),
        (
            {"arrangement": "day", "count": 5, "latitude_deg": 40, "day": 80, "hours": [8, 16]},
            sun_path(np.radians(40), 80.0, np.linspace(8, 16, 5)),
        ),
        ({"arrangement": "list", "directions": [[0, 0, 2], [3, 0, 4]]}, [[0, 0, 1], [0.6, 0, 0.8]]),
        ({"directions": [[0, 0, 2]]}, [[0, 0, 1]]),
    ],
)
def test_arrangements(values, expected):
    assert directions(lights(**values)) == pytest.approx(np.array(expected), abs=1e-12)


def test_an_arc_lies_in_a_plane_and_ends_where_it_says():
    found = directions(lights(arrangement="arc", count=9, tilt_deg=50, azimuth_deg=30))
    assert np.linalg.matrix_rank(found, tol=1e-12) == 2
    assert found[-1] == pytest.approx(
        [np.sin(np.radians(50)) * np.cos(np.pi / 6), np.sin(np.radians(50)) * 0.5, np.cos(np.radians(50))]
    )
    assert found[4] == pytest.approx([0, 0, 1], abs=1e-15)


def test_directions_from_a_file(tmp_path):
    (tmp_path / "lights.txt").write_text("0 0 2\n3 0 4\n", encoding="utf-8")
    assert directions(lights(folder=tmp_path, directions="lights.txt")) == pytest.approx(
        np.array([[0, 0, 1], [0.6, 0, 0.8]])
    )
    with pytest.raises(MissingFileError, match=r"none\.txt"):
        lights(folder=tmp_path, directions="none.txt")


def test_the_number_may_come_from_elsewhere():
    assert len(lights(5, arrangement="ring", count=9)) == 5
    with pytest.raises(OptionError, match="lists its lights one by one"):
        lights(5, directions=[[0, 0, 1]])
    for count in (0, -1, 10**9):
        with pytest.raises(OptionError, match=f"{count} lights are asked for"):
            lights(count)


KINDS = {"directional": Directional, "sun": Sun, "led": Led, "disc": Disc, "window": Polygon}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("irradiance", [250.0, [1.0, 2.0, 3.0]])
def test_every_kind_gives_the_irradiance_that_it_says_at_the_origin(kind, irradiance):
    found = lights(kind=kind, count=6, irradiance=irradiance)
    assert all(type(light) is KINDS[kind] for light in found)
    assert directions(found) == pytest.approx(spiral(6))
    for light in found:
        assert facing(light) == pytest.approx(np.atleast_1d(irradiance), rel=1e-9)


def test_a_row_of_irradiances_for_each_light():
    found = lights(arrangement="ring", count=3, irradiance=[[1, 2, 3], [4, 5, 6], [7, 8, 9]])
    assert np.array([light.strength for light in found]).tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    found = lights(arrangement="ring", count=3, irradiance=[[1], [4], [7]])
    assert np.array([light.strength for light in found]).tolist() == [[1], [4], [7]]


def test_near_lights_stand_where_they_should_and_shine_at_the_origin():
    (led,) = lights(kind="led", directions=[[3, 0, 4]], distance=5.0, mu=2.0)
    assert led.position == pytest.approx([3, 0, 4])
    assert led.axis == pytest.approx([-0.6, 0, -0.8])
    assert led.mu == 2.0
    (disc,) = lights(kind="disc", directions=[[0, 0, 1]], distance=2.0, radius=0.25)
    assert (disc.radius, disc.centre.tolist(), disc.axis.tolist()) == (0.25, [0, 0, 2], [0, 0, -1])
    for direction in ([0, 0, 1], [0, 1, 0], [0.6, 0.1, 0.9]):
        (window,) = lights(kind="window", directions=[direction], distance=2.0, width=0.5)
        assert window.area == pytest.approx(0.25)
        assert window.centroid == pytest.approx(2 * np.array(direction) / np.linalg.norm(direction))
        sides = np.linalg.norm(np.roll(window.vertices, -1, axis=0) - window.vertices, axis=1)
        assert sides == pytest.approx(np.full(4, 0.5))
    (sun,) = lights(kind="sun", directions=[[0, 0, 1]], angular_radius_deg=5)
    assert sun.angular_radius == pytest.approx(np.radians(5))


def test_the_sun_of_a_day_rises_in_the_east_and_sets_in_the_west():
    found = directions(lights(arrangement="day", latitude_deg=40, hours=[6, 18], count=13))
    assert found[0, 0] > 0.8
    assert found[-1, 0] < -0.8
    assert found[6] == pytest.approx([0, -np.sin(np.radians(40 - 23.45)), np.cos(np.radians(40 - 23.45))], abs=1e-3)
    with pytest.raises(InputError, match="At 4 of 13 hours"):
        lights(arrangement="day", latitude_deg=40, day=355, hours=[6, 18], count=13)


WRONG = [
    {"arrangement": "spirall"}, {"arrangement": 3}, {"kind": "lde"}, {"kind": ""}, {"tilt": 60}, {"radius": 1.0},
    {"kind": "led", "radius": 1.0}, {"kind": "sun", "distance": 1.0}, {"arrangement": "ring", "hours": [6, 18]},
    {"arrangement": "list"}, {"count": 0}, {"count": -3}, {"count": 2.0}, {"count": True}, {"count": "5"},
    {"count": 10**9}, {"tilt_deg": 0}, {"tilt_deg": 90}, {"tilt_deg": -5}, {"tilt_deg": float("nan")},
    {"tilt_deg": "60"}, {"tilt_deg": True}, {"arrangement": "arc", "azimuth_deg": float("inf")}, {"irradiance": 0},
    {"irradiance": -1.0}, {"irradiance": float("nan")}, {"irradiance": float("inf")}, {"irradiance": "1"},
    {"irradiance": True}, {"irradiance": []}, {"irradiance": [1, 2]}, {"irradiance": [[1, 2, 3]]},
    {"irradiance": [1, "2", 3]}, {"irradiance": [[1], [2, 3]]}, {"irradiance": [[[1.0]]]}, {"irradiance": [1, -1, 1]},
    {"irradiance": [[]]},
    {"directions": []}, {"directions": [[]]}, {"directions": [0, 0, 1]}, {"directions": [[0, 0]]},
    {"directions": [[0, 0, 0]]}, {"directions": [[0, 0, float("nan")]]}, {"directions": [["0", "0", "1"]]},
    {"directions": ""}, {"directions": 5}, {"directions": [[0, 0, 1], [0, 0, 1, 1]]},
    {"kind": "led", "distance": 0}, {"kind": "led", "distance": float("inf")}, {"kind": "led", "mu": -1},
    {"kind": "led", "mu": float("inf")}, {"kind": "led", "mu": 1e9}, {"kind": "disc", "radius": -1},
    {"kind": "window", "width": 0}, {"kind": "window", "width": "1"}, {"kind": "sun", "angular_radius_deg": 0},
    {"kind": "sun", "angular_radius_deg": 91}, {"kind": "sun", "angular_radius_deg": float("nan")},
    {"arrangement": "day", "hours": [6]}, {"arrangement": "day", "hours": [18, 6]}, {"arrangement": "day", "hours": 6},
    {"arrangement": "day", "hours": [6, 25]}, {"arrangement": "day", "hours": ["6", "18"]},
    {"arrangement": "day", "hours": [float("nan"), 18]}, {"arrangement": "day", "latitude_deg": 91},
    {"arrangement": "day", "day": 0}, {"arrangement": "day", "day": 400}, {"arrangement": "day", "hours": [0, 12]},
]  # fmt: skip


@pytest.mark.parametrize("values", WRONG, ids=map(str, WRONG))
def test_what_means_nothing_is_refused(values):
    with pytest.raises(PsstereoError) as caught:
        lights(**values)
    assert isinstance(caught.value, InputError | OptionError)
    known = str(caught.value)
    assert "lights" in known or "arrangement" in known or "kind" in known


@pytest.mark.parametrize(
    ("values", "near"),
    [
        ({"arrangement": "spirl"}, "spiral"),
        ({"kind": "direktional"}, "directional"),
        ({"tilt_degr": 3}, "tilt_deg"),
        ({"kind": "led", "distnce": 3}, "distance"),
    ],
)
def test_the_nearest_word_is_offered(values, near):
    with pytest.raises(OptionError, match=f"Did you mean {near}"):
        lights(**values)


def test_ambient_light():
    assert ambient() == (None, False)
    assert ambient(dark_frame=True) == (None, True)
    light, dark = ambient(radiance=3, dark_frame=True)
    assert isinstance(light, Ambient)
    assert dark
    assert light.radiance.tolist() == [3.0]
    assert ambient(radiance=[1, 2, 3])[0].radiance.tolist() == [1, 2, 3]
    smooth = ambient(harmonics=[1, 0, 0.5, 0, 0, 0, 0, 0, 0])[0]
    assert isinstance(smooth, Harmonics)
    assert smooth.channels == 1
    assert ambient(harmonics=[[1, 1, 1], *[[0, 0, 0]] * 8])[0].channels == 3


def test_an_environment_from_a_file_beside_the_scene(tmp_path):
    from psstereo.io.environment_file import write_environment

    write_environment(tmp_path / "sky.exr", np.ones((4, 8, 3)))
    light, _ = ambient(tmp_path, environment="sky.exr")
    assert isinstance(light, Environment)
    assert light.irradiance(ORIGIN, np.array([[0.0, 0.0, 1.0]])) == pytest.approx(np.full((1, 3), np.pi), rel=1e-3)
    with pytest.raises(MissingFileError, match=r"no\.exr"):
        ambient(tmp_path, environment="no.exr")


@pytest.mark.parametrize(
    "values",
    [
        {"radiance": 0}, {"radiance": -1}, {"radiance": "5"}, {"radiance": True}, {"radiance": float("nan")},
        {"radiance": float("inf")}, {"radiance": [1, 2]}, {"radiance": []}, {"radiance": [[1, 2, 3]]},
        {"harmonics": [1, 0]}, {"harmonics": []}, {"harmonics": "1"}, {"harmonics": [0] * 9},
        {"harmonics": [float("nan"), *[0] * 8]}, {"environment": 5}, {"environment": ""},
        {"radiance": 1, "harmonics": [1, *[0] * 8]}, {"dark_frame": 1}, {"dark_frame": "yes"}, {"radience": 1},
    ],
    ids=str,
)  # fmt: skip
def test_ambient_light_that_means_nothing_is_refused(values):
    with pytest.raises((InputError, OptionError)):
        ambient(**values)
