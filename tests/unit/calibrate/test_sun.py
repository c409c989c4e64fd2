import math
import sys
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

from psstereo.calibrate.sun import (
    Place,
    ShadowedPole,
    SunPositions,
    calibrate_sun,
    check_clock,
    clear_sky_strength,
    facing_of_mask,
    judge_cone,
    parse_zone,
    place_of,
    rotation_from_heading,
    rotation_from_pole,
    sun_positions,
    time_of,
)
from psstereo.camera import Pinhole
from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError, RigError, UnsupportedError
from psstereo.forward import lambertian_images
from psstereo.io.exif import Exif
from psstereo.lights import Rig, from_azimuth, sun_path
from psstereo.normals import LeastSquares, estimate_normals
from psstereo.stack import MemoryStack

KASSEL = Place(latitude=math.radians(51.3), longitude=math.radians(9.5), height=160.0)
DOWN = rotation_from_heading(0.0, -0.5 * math.pi)


def angle(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))


def day(month, date, hours, zone=UTC):
    return [datetime(2026, month, date, tzinfo=zone) + timedelta(hours=float(hour)) for hour in hours]


def ball(size=25, radius=11.0):
    rows, columns = np.mgrid[:size, :size]
    x, y = (columns - size // 2) / radius, (size // 2 - rows) / radius
    inside = x * x + y * y < 0.95
    z = np.sqrt(np.where(inside, 1 - x * x - y * y, 0.05))
    return np.stack([x, y, z], axis=-1) / np.sqrt(x * x + y * y + z * z)[..., None], inside


def test_the_published_example_of_the_solar_position_algorithm():
    """Reda and Andreas 2004 (doi:10.1016/j.solener.2003.12.003), appendix: zenith 50.11162°, azimuth 194.34024°."""
    boulder = Place(latitude=math.radians(39.742476), longitude=math.radians(-105.1786), height=1830.14)
    moment = datetime(2003, 10, 17, 12, 30, 30, tzinfo=timezone(timedelta(hours=-7)))
    found = sun_positions([moment], boulder)
    assert np.degrees(found.azimuth[0]) == pytest.approx(194.34024, abs=0.002)
    assert 90 - np.degrees(found.elevation[0]) == pytest.approx(50.11162, abs=0.002)


def independent(moment, place):
    """Return the sun by the routines of the International Astronomical Union, (3,) east, north, up, no refraction."""
    erfa = pytest.importorskip("erfa", exc_type=ImportError)
    u1, u2 = erfa.dtf2d("UTC", moment.year, moment.month, moment.day, moment.hour, moment.minute, moment.second)
    t1, t2 = erfa.taitt(*erfa.utctai(u1, u2))
    heliocentric, _ = erfa.epv00(t1, t2)
    right, declination = erfa.c2s(-heliocentric["p"])
    azimuth, zenith, *_ = erfa.atco13(
        right, declination, 0, 0, 1.0, 0, u1, u2, 0.0, place.longitude, place.latitude, place.height, 0, 0, 0, 0, 0, 0.5
    )
    return from_azimuth(azimuth, 0.5 * np.pi - zenith)


def test_directions_against_the_routines_of_the_astronomical_union():
    rng = np.random.default_rng(5)
    worst = 0.0
    for _ in range(60):
        place = Place(
            latitude=rng.uniform(-1.2, 1.2),
            longitude=rng.uniform(-3.1, 3.1),
            height=rng.uniform(0, 3000),
            refraction=False,
        )
        moment = datetime(1980, 1, 1, tzinfo=UTC) + timedelta(minutes=int(rng.integers(0, 44 * 365 * 24 * 60)))
        worst = max(worst, float(angle(sun_positions([moment], place).directions[0], independent(moment, place))))
    assert worst < 0.02


def test_without_the_ephemeris_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ephem", None)
    with pytest.raises(UnsupportedError) as caught:
        sun_positions(day(6, 21, [12.0]), KASSEL)
    assert "ephem" in caught.value.remedy
    assert "'outdoor'" in caught.value.remedy


def test_refraction_lifts_a_low_sun_by_what_saemundsson_says():
    low = day(6, 21, np.arange(17, 19.4, 0.2))
    bare = Place(latitude=KASSEL.latitude, longitude=KASSEL.longitude, refraction=False)
    true = np.degrees(sun_positions(low, bare).elevation)
    lifted = np.degrees(sun_positions(low, Place(latitude=KASSEL.latitude, longitude=KASSEL.longitude)).elevation)
    usable = true > 2
    expected = 1.02 / np.tan(np.radians(true + 10.3 / (true + 5.11))) / 60
    assert usable.sum() > 5
    np.testing.assert_allclose((lifted - true)[usable], expected[usable], rtol=0.05)


def test_the_sun_of_the_simple_path_is_near():
    noon = sun_positions(day(6, 21, [11.37]), KASSEL).directions[0]  # 9.5° east: 38 min before Greenwich
    assert angle(noon, sun_path(KASSEL.latitude, 172, [12.0])[0]) < 1.0


def test_a_low_sun_is_weaker():
    found = clear_sky_strength(sun_positions(day(6, 21, [4.5, 8, 11.5, 23]), KASSEL))
    assert found[3] == 0
    assert found[0] < found[1] < found[2]
    assert found[2] == pytest.approx(0.7 / 1.0162**2, rel=0.05)  # air mass near one, at aphelion


@pytest.mark.parametrize(
    ("declination", "figures"),
    [
        (1.0, {1: 17273, 2: 4751, 4: 1202, 6: 501, 8: 255, 10: 145, 12: 91}),
        (5.0, {1: 3472, 2: 955, 4: 242, 6: 101, 8: 51, 10: 29, 12: 18}),
        (10.0, {1: 1763, 2: 485, 4: 123, 6: 52, 8: 26, 10: 15, 12: 9.3}),
        (23.44, {1: 827, 2: 228, 4: 58, 6: 25, 8: 13, 10: 7.6, 12: 4.8}),
    ],
)
def test_condition_numbers_of_a_day(declination, figures):
    """Those of ten-minute samples about noon on a cone, computed elsewhere."""
    c, p = math.radians(declination), 0.7
    for window, condition in figures.items():
        turn = np.radians(15 * np.linspace(-window / 2, window / 2, 6 * window + 1))
        up = math.sin(c) * math.sin(p) + math.cos(c) * math.cos(p) * np.cos(turn)
        north = math.sin(c) * math.cos(p) - math.cos(c) * math.sin(p) * np.cos(turn)
        toward = np.stack([-math.cos(c) * np.sin(turn), north, up], axis=-1)
        ones = np.full(len(turn), c)
        positions = SunPositions(directions=toward, azimuth=ones, elevation=ones, declination=ones, distance=ones)
        cone = judge_cone(positions, Place(latitude=p, longitude=0.0))
        assert cone.condition == pytest.approx(condition, rel=0.03)
        assert cone.window == pytest.approx(window)
        assert abs(cone.weak @ [0, math.cos(p), math.sin(p)]) > 0.8  # the pole, more or less


def test_an_equinox_on_a_plane_has_no_condition():
    toward = sun_path(0.7, 80.0, np.linspace(8, 16, 20))
    flat = toward - (toward @ [0, math.cos(0.7), math.sin(0.7)])[:, None] * [0, math.cos(0.7), math.sin(0.7)]
    ones = np.zeros(20)
    positions = SunPositions(directions=flat, azimuth=ones, elevation=ones, declination=ones, distance=ones)
    cone = judge_cone(positions, Place(latitude=0.7, longitude=0.0))
    assert cone.condition == math.inf
    assert "tells no normals" in cone.sentence


def solved_error(times, limit):
    found = calibrate_sun(times, KASSEL, DOWN, worst_condition=limit)
    normals, mask = ball()
    images = lambertian_images(normals, np.full(mask.shape, 0.3), found.rig)
    images += np.random.default_rng(1).normal(0, 0.003, images.shape)
    capture = Capture(stack=MemoryStack(np.maximum(images, 0)), rig=found.rig, mask=mask)
    got = estimate_normals(capture, LeastSquares()).normals[mask]
    return float(np.nanmean(angle(got, normals[mask]))), found


def test_a_solstice_works_and_an_equinox_is_refused():
    hours = np.arange(5, 18.01, 0.5)
    error, found = solved_error(day(6, 21, hours), 50)
    assert found.cone.condition < 6
    assert error < 2.0
    equinox = day(3, 20, np.arange(6.5, 17, 0.5))
    with pytest.raises(RigError, match="equinox") as caught:
        calibrate_sun(equinox, KASSEL, DOWN)
    assert "another season" in caught.value.remedy
    worse, _ = solved_error(equinox, math.inf)
    assert worse > 5 * error


def test_a_short_stretch_of_a_summer_day_is_refused_for_its_length():
    with pytest.raises(RigError, match="too short an arc"):
        calibrate_sun(day(6, 21, np.arange(10, 12.01, 0.25)), KASSEL, DOWN)


def test_the_quality_says_errors_and_advice():
    hours = np.arange(5, 18.01, 1.0)
    found = calibrate_sun(day(6, 21, hours), KASSEL, DOWN, clock_error=60.0, standing_error=math.radians(0.5))
    spread = np.degrees(found.quality.direction_error)
    assert spread.shape == (14,)
    expected = math.hypot(0.5, 0.25 * math.cos(math.radians(23.43)))
    np.testing.assert_allclose(spread, expected, rtol=0.01)
    assert "good for normals" in found.quality.verdict
    unsure = calibrate_sun(day(6, 21, hours), KASSEL, DOWN, strength="equal").quality
    assert unsure.direction_error is None
    assert any("equally strong" in line for line in unsure.advice)


def test_the_sun_of_the_night_names_the_clock():
    with pytest.raises(InputError, match="below the horizon") as caught:
        calibrate_sun(day(6, 21, np.arange(17, 30, 0.5)), KASSEL, DOWN)
    assert "12 h" in caught.value.remedy


@pytest.mark.parametrize(
    "call",
    [
        lambda: sun_positions([datetime(2026, 6, 21, 12)], KASSEL),
        lambda: sun_positions([datetime(1700, 6, 21, 12, tzinfo=UTC)], KASSEL),
        lambda: sun_positions([], KASSEL),
        lambda: Place(latitude=2.0, longitude=0.0),
        lambda: Place(latitude=0.0, longitude=math.nan),
        lambda: calibrate_sun(day(6, 21, [9, 12, 15]), KASSEL, np.zeros((3, 3))),
        lambda: calibrate_sun(day(6, 21, [9, 12, 15]), KASSEL, DOWN, strength="bright"),
        lambda: calibrate_sun(day(6, 21, [9, 12, 15]), KASSEL, DOWN, clock_error=-1.0),
        lambda: calibrate_sun(day(6, 21, [9, 12, 15]), KASSEL, DOWN, worst_condition=math.nan),
        lambda: rotation_from_heading(math.nan, 0.0),
        lambda: rotation_from_heading(0.0, 2.0),
        lambda: facing_of_mask(np.zeros((4, 4), bool)),
        lambda: check_clock(np.ones((3, 2)), day(6, 21, [9, 12, 15]), KASSEL, DOWN, np.ones((3, 3))),
    ],
)
def test_hostile_values_are_refused(call):
    with pytest.raises((InputError, OptionError)):
        call()


def test_heading_pitch_and_roll():
    west = rotation_from_heading(-0.5 * np.pi, 0.0)
    np.testing.assert_allclose(west.T @ [0, 0, 1], [0, 1, 0], atol=1e-15)  # up is up in the image
    np.testing.assert_allclose(west.T @ [-1, 0, 0], [0, 0, -1], atol=1e-15)  # west is where it looks
    np.testing.assert_allclose(west.T @ [0, 1, 0], [1, 0, 0], atol=1e-15)  # north at the right
    raised = rotation_from_heading(0.0, 0.3)
    assert (raised.T @ [0, 1, 0])[1] < 0  # the horizon sinks
    rolled = rotation_from_heading(0.0, 0.0, 0.3)
    assert (rolled.T @ [0, 0, 1])[0] < 0  # the right side goes down, so that up leans to the left


def seen(rotation, point, camera):
    x, y, z = rotation.T @ point
    return np.array([camera.cx - camera.fx * x / z + camera.skew * y / z, camera.cy + camera.fy * y / z])


def test_one_vertical_and_its_shadow_tell_how_the_camera_stands():
    camera = Pinhole(fx=1000.0, fy=1010.0, cx=600.0, cy=400.0, skew=2.0)
    for heading, pitch, roll, azimuth in (
        (0.4, -0.2, 0.05, 2.2),
        (0.3, -0.5, -0.1, 0.8),
        (0.4, -0.3, 0.02, 1.6),
        (5.0, 0.05, 0.0, 3.4),
    ):
        truth = rotation_from_heading(heading, pitch, roll)
        sun = from_azimuth(azimuth, 0.7)
        base = np.array([6 * math.sin(heading), 6 * math.cos(heading), -1.6])
        top = base + np.array([0.0, 0.0, 1.8])
        tip = top - sun * 1.8 / sun[2]
        pole = ShadowedPole(
            **{name: seen(truth, point, camera) for name, point in (("base", base), ("top", top), ("tip", tip))}
        )
        np.testing.assert_allclose(rotation_from_pole(pole, camera, sun, pitch=pitch - 0.02), truth, atol=1e-9)
        if azimuth in (1.6, 3.4):
            with pytest.raises(InputError, match="equally well"):
                rotation_from_pole(pole, camera, sun)
        else:
            np.testing.assert_allclose(rotation_from_pole(pole, camera, sun), truth, atol=1e-9)


def test_a_vertical_that_cannot_be_is_refused():
    camera = Pinhole(fx=1000.0, fy=1000.0, cx=500.0, cy=500.0)
    with pytest.raises(InputError, match="No standing"):  # a shadow above the horizon of any ground
        rotation_from_pole(
            ShadowedPole(base=[500, 500], top=[500, 900], tip=[500, -4000]), camera, from_azimuth(1, 1.4)
        )
    with pytest.raises(InputError, match="Three different places"):
        ShadowedPole(base=[1, 1], top=[1, 1], tip=[5, 5])
    with pytest.raises(InputError, match="stands"):
        rotation_from_pole(ShadowedPole(base=[1, 1], top=[1, 9], tip=[5, 5]), camera, np.array([0, 0, 1.0]))


def test_twelve_hours_off_is_seen_by_the_side_of_the_light():
    """In a summer north of the polar circle the sun is up at any hour, so that the horizon tells nothing."""
    north = Place(latitude=math.radians(70.0), longitude=0.3)
    rotation = rotation_from_heading(0.0, -0.5 * np.pi)
    times = day(6, 21, np.arange(4, 18, 1.0))
    normals, mask = ball()
    rig = Rig.distant(sun_positions(times, north).directions @ rotation)
    values = lambertian_images(normals, np.full(mask.shape, 0.3), rig)[:, mask, 0]
    facing = facing_of_mask(mask)[mask]
    right = check_clock(values, times, north, rotation, facing)
    assert not right.wrong
    assert "side that the clock says" in right.sentence
    right.require_right()
    off = check_clock(values, [time + timedelta(hours=12) for time in times], north, rotation, facing)
    assert off.wrong
    assert abs(off.shift) >= 11
    with pytest.raises(InputError, match="opposite side"):
        off.require_right()
    # An even sky on top, and a camera that was thought to look the other way.
    turned = check_clock(values + 0.1, times, north, rotation @ np.diag([-1.0, -1.0, 1.0]), facing)
    assert turned.wrong
    assert not check_clock(values + 0.1, times, north, rotation, facing).wrong


def test_a_mask_over_the_whole_image_faces_the_camera():
    np.testing.assert_array_equal(facing_of_mask(np.ones((3, 4), bool))[..., 2], 1.0)
    bulge = facing_of_mask(ball()[1])
    assert bulge[12, 20, 0] > 0.5
    assert bulge[4, 12, 1] > 0.5


def test_zones_and_tags():
    assert parse_zone("+02:00").utcoffset(None) == timedelta(hours=2)
    assert parse_zone(" -5 ").utcoffset(None) == timedelta(hours=-5)
    assert parse_zone("+0530").utcoffset(None) == timedelta(hours=5, minutes=30)
    assert parse_zone("z") is UTC
    summer = time_of(Exif(taken=datetime(2026, 7, 1, 12)), "a.jpg", parse_zone("Europe/Berlin"))
    winter = time_of(Exif(taken=datetime(2026, 1, 1, 12)), "a.jpg", parse_zone("Europe/Berlin"))
    assert (summer.utcoffset(), winter.utcoffset()) == (timedelta(hours=2), timedelta(hours=1))
    own = datetime(2026, 7, 1, 12, tzinfo=timezone(timedelta(hours=9)))
    assert time_of(Exif(taken=own), "a.jpg", UTC) == own  # the file's own offset comes first
    for text in ("+25:00", "Mars/Olympus", "", "2", "../etc/passwd"):
        with pytest.raises(OptionError):
            parse_zone(text)
    with pytest.raises(InputError, match="unknown time zone"):
        time_of(Exif(taken=datetime(2026, 7, 1, 12)), "a.jpg")
    with pytest.raises(InputError, match="when it was taken"):
        time_of(Exif(), "a.jpg", UTC)
    with pytest.raises(InputError, match="where it was taken"):
        place_of(Exif(latitude=0.5), "a.jpg")
    assert place_of(Exif(latitude=0.5, longitude=-1.0, altitude=300.0), "a.jpg").height == 300.0
