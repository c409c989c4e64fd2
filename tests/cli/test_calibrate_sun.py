"""``psstereo calibrate sun``: photographs in, a rig file out, or a refusal with its reason."""

import math
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from PIL import Image

from psstereo.calibrate.sun import Place, rotation_from_heading, sun_positions
from psstereo.forward import lambertian_images
from psstereo.io.rig_file import read_rig
from psstereo.lights import Rig

PLACE = "51.31,9.48,160"
EXIF, ORIGINAL, OFFSET = 0x8769, 0x9003, 0x9011


def refused(done, reason):
    """Require that a command refused, with exit code 3 and words."""
    assert done.code == 3, done.err
    assert reason in done.text, done.text


def ball(size=22, radius=9.0):
    rows, columns = np.mgrid[:size, :size]
    x, y = (columns - size / 2) / radius, (size / 2 - rows) / radius
    inside = x * x + y * y < 0.95
    z = np.sqrt(np.where(inside, 1 - x * x - y * y, 0.05))
    return np.stack([x, y, z], axis=-1) / np.sqrt(x * x + y * y + z * z)[..., None], inside


def photographs(folder, *, latitude, wrong=0, offset="+00:00"):
    """Write a ball under the sun of a June day, hour by hour, with EXIF; `wrong` hours are added to the clock."""
    place = Place(latitude=math.radians(latitude), longitude=math.radians(9.48))
    rotation = rotation_from_heading(0.0, math.radians(-90.0))
    normals, inside = ball()
    paths = []
    for hour in range(6, 17, 2):
        moment = datetime(2026, 6, 21, hour, tzinfo=UTC)
        rig = Rig.distant(sun_positions([moment], place).directions @ rotation)
        shade = lambertian_images(normals, np.where(inside, 0.9, 0.0), rig)[0, ..., 0]
        image = Image.fromarray(np.rint(255 * shade).astype(np.uint8))
        tags = Image.Exif()
        written = (moment + timedelta(hours=wrong)).strftime("%Y:%m:%d %H:%M:%S")
        tags[EXIF] = {ORIGINAL: written, **({OFFSET: offset} if offset else {})}
        paths.append(folder / f"{hour:02d}.png")
        image.save(paths[-1], exif=tags)
    Image.fromarray((255 * inside).astype(np.uint8)).save(folder / "mask.png")
    return paths


def test_photographs_become_a_rig(run, tmp_path):
    paths = photographs(tmp_path, latitude=51.31)
    out = tmp_path / "rig.toml"
    words = (*paths, "-o", out, "--place", PLACE, "--heading", 0, "--pitch", -90, "--mask", tmp_path / "mask.png")
    told = run("calibrate", "sun", *words, "--standing-error", 0.5, "--sky", "--json")
    record = told.record
    assert record["sky"]["even"] < 0.02  # there is none in these pictures
    assert record["sky"]["zenith"] == "0.00000,0.00000,1.00000"
    assert "good for normals" in record["verdict"]
    assert "side that the clock says" in record["clock"]
    assert record["times"][0] == "2026-06-21T06:00:00+00:00"
    rig = read_rig(out)
    assert rig.names == tuple(path.name for path in paths)
    place = Place(latitude=math.radians(51.31), longitude=math.radians(9.48), height=160.0)
    expected = sun_positions([datetime(2026, 6, 21, h, tzinfo=UTC) for h in range(6, 17, 2)], place).directions
    np.testing.assert_allclose(rig.rig.directions, expected, atol=1e-6)
    np.testing.assert_allclose(np.degrees(rig.quality.direction_error), 0.5, atol=0.01)
    refused(run("calibrate", "sun", *words), "is there already")
    again = run("calibrate", "sun", *words, "--overwrite")
    assert again.out == ""
    assert "condition" in again.err


def test_a_clock_without_zone_is_refused_and_a_zone_helps(run, tmp_path):
    paths = photographs(tmp_path, latitude=51.31, offset="", wrong=2)
    words = (*paths, "-o", tmp_path / "rig.toml", "--place", PLACE, "--heading", 0, "--pitch", -90)
    refused(run("calibrate", "sun", *words), "unknown time zone")
    record = run("calibrate", "sun", *words, "--zone", "Europe/Berlin", "--json").record
    assert record["times"][0].endswith("+02:00")
    assert record["elevation_deg"][0] == pytest.approx(23.9, abs=0.5)  # by the hour angle, without the equation of time


def test_twelve_hours_off_is_named(run, tmp_path):
    """At night by the clock where nights are dark; by the side of the light where they are not."""
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    common = ("-o", tmp_path / "rig.toml", "--heading", 0, "--pitch", -90)
    south = photographs(tmp_path / "a", latitude=51.31, wrong=12)
    refused(run("calibrate", "sun", *south, *common, "--place", PLACE), "12 h off turns day into night")
    north = photographs(tmp_path / "b", latitude=72.0, wrong=12)
    refused(
        run("calibrate", "sun", *north, *common, "--place", "72,9.48", "--mask", tmp_path / "b" / "mask.png"),
        "opposite side",
    )
    assert not (tmp_path / "rig.toml").exists()


def test_an_equinox_is_refused_without_photographs(run, tmp_path):
    times = [word for hour in range(6, 17) for word in ("--time", f"2026-03-20T{hour:02d}:00Z")]
    words = ("-o", tmp_path / "rig.toml", "--place", PLACE, "--heading", 0, "--pitch", -90)
    refused(run("calibrate", "sun", *times, *words), "equinox")
    run("calibrate", "sun", *times, *words, "--worst-condition", 1e9)
    assert "flat cone" in read_rig(tmp_path / "rig.toml").quality.verdict


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--time", "noon", "--place", PLACE, "--heading", "0", "--pitch", "0"), "time is"),
        (("--time", "2026-06-21T12:00", "--place", PLACE, "--heading", "0", "--pitch", "0"), "no time zone"),
        (("--place", PLACE, "--heading", "0", "--pitch", "0"), "Neither photographs nor times"),
        (("--time", "2026-06-21T12:00Z", "--heading", "0", "--pitch", "0"), "No place"),
        (("--time", "2026-06-21T12:00Z", "--place", "51", "--heading", "0", "--pitch", "0"), "place is"),
        (("--time", "2026-06-21T12:00Z", "--place", "100,9", "--heading", "0", "--pitch", "0"), "degrees"),
        (("--time", "2026-06-21T12:00Z", "--place", PLACE, "--heading", "nan", "--pitch", "0"), "degrees"),
        (("--time", "2026-06-21T12:00Z", "--place", PLACE, "--heading", "0", "--pitch", "99"), "99.0 and 0.0 degrees"),
        (("--time", "9999-12-31T23:59-05:00", "--place", PLACE, "--heading", "0", "--pitch", "0"), "1900 to 2100"),
        (("--time", "2026-06-21T12:00Z", "--place", PLACE, "--heading", "0"), "in part"),
        (("--time", "2026-06-21T12:00Z", "--place", PLACE, "--heading", "0", "--pole", "1,2,3,4,5,6"), "twice"),
        (("--time", "2026-06-21T12:00Z", "--place", PLACE, "--pole", "1,2,3,4,5,6"), "no camera matrix"),
        (("--zone", "Moon/Tycho", "--time", "2026-06-21T12:00", "--place", PLACE), "zone is"),
        (
            ("--time", "2026-06-21T12:00Z", "--place", PLACE, "--heading", "0", "--pitch", "0", "--strength", "x"),
            "sun is",
        ),
    ],
)
def test_words_that_do_not_do(run, tmp_path, words, reason):
    refused(run("calibrate", "sun", *words, "-o", tmp_path / "rig.toml"), reason)


def test_a_roll_beside_a_vertical_is_refused(run, tmp_path):
    words = ("--time", "2026-06-21T12:00Z", "--place", PLACE, "--pole", "610,820,605,300,920,860", "--roll", 5)
    refused(run("calibrate", "sun", *words, "--K", "900,900,640,480", "-o", tmp_path / "rig.toml"), "roll is 5")


def test_a_mask_that_nothing_looks_through_is_refused(run, tmp_path):
    paths = photographs(tmp_path, latitude=51.31)
    words = (*paths, "-o", tmp_path / "rig.toml", "--place", PLACE, "--heading", 0, "--pitch", -90, "--no-check")
    refused(run("calibrate", "sun", *words, "--mask", tmp_path / "mask.png"), "no photograph is looked at")
    assert not (tmp_path / "rig.toml").exists()
