"""The bridge between files of lights: every pair of formats leads there and back, and what is lost is said."""

import json
from dataclasses import replace

import numpy as np
import pytest
import scipy.io

from psstereo.camera import Pinhole
from psstereo.errors import ExistingResultError, InputError, MissingFileError, PsstereoError, UnsupportedError
from psstereo.io.light_bridge import LIGHT_FORMATS, LightTable, read_lights, write_lights
from psstereo.io.rig_file import RigFile, RigQuality
from psstereo.lights import Led, Rig, StrengthUnit
from psstereo.stack import Response

DISTANT = ("rig", "lp", "dome", "diligent", "psbox", "meshroom")
LAMPS = ("rig", "luces", "near-ps")
NAMES = {"rig": "a.toml", "lp": "a.lp", "dome": "a.dome", "meshroom": "a.json", "luces": "led_params.txt"}
CAMERA = Pinhole(fx=2100.25, fy=2100.25, cx=61.5, cy=39.25)


def distant(count=4, *, strengths=True):
    random = np.random.default_rng(count)
    directions = np.abs(random.standard_normal((count, 3))) * [1, -1, 1]  # no two axes can be swapped unseen
    powers = np.repeat(random.uniform(0.2, 3, (count, 1)), 3, axis=1) if strengths else None
    return LightTable(
        rig=Rig.distant(directions, powers),
        names=tuple(f"view {i} é.png" for i in range(count)),
        balls=np.array([[100.0, 200.5, 33.0], [400.0, 120.0, 31.25]]),
    )


def lamps(count=4):
    random = np.random.default_rng(count)
    leds = tuple(
        Led(
            position=random.uniform([10, -90, 5], [90, -10, 40]),
            axis=random.uniform([-1, 0, -3], [-0.1, 1, -1]),
            mu=float(random.uniform(0, 3)),
            flux=random.uniform(1, 9, 3),
        )
        for _ in range(count)
    )
    return LightTable(rig=Rig(leds), camera=CAMERA, size=(80, 120), distance=412.5)


def place(folder, kind):
    return folder / NAMES.get(kind, "folder")


def there(folder, table, kind):
    folder.mkdir(parents=True)
    said = write_lights(place(folder, kind), table, kind)
    return read_lights(place(folder, kind), kind=kind), said


def assert_same(found, wanted, holds):
    """Compare all parts that a format holds."""
    assert len(found.rig) == len(wanted.rig)
    for one, other in zip(found.rig.lights, wanted.rig.lights, strict=True):
        assert type(one) is type(other)
        if isinstance(one, Led):
            np.testing.assert_array_equal(one.position, other.position)
            np.testing.assert_allclose(one.axis, other.axis, rtol=0, atol=3e-16)
            assert one.mu == other.mu
            np.testing.assert_array_equal(one.flux, np.broadcast_to(other.flux, 3))
        else:
            np.testing.assert_allclose(one.direction, other.direction, rtol=0, atol=1e-15)
            power = np.broadcast_to(other.strength, 3) if "strengths" in holds else np.ones(3)
            np.testing.assert_array_equal(np.broadcast_to(one.strength, 3), power)
    assert found.names == (wanted.names if "names" in holds else ())
    assert found.camera == (wanted.camera if "pinhole" in holds else None)
    assert found.size == (wanted.size if "size" in holds else None)
    assert found.distance == (wanted.distance if "distance" in holds else None)
    if "balls" in holds and wanted.balls is not None:
        np.testing.assert_array_equal(found.balls, wanted.balls)
    else:
        assert found.balls is None


@pytest.mark.parametrize("first", [*DISTANT, *(f"{one}/lamps" for one in LAMPS)])
def test_every_pair_of_formats_leads_there_and_back(first, tmp_path):
    kinds, table = (LAMPS, lamps()) if first.endswith("/lamps") else (DISTANT, distant())
    first = first.split("/")[0]
    once, _ = there(tmp_path / "once", table, first)
    assert_same(once, table, LIGHT_FORMATS[first].holds)
    for second in kinds:
        # what the first file does not say has to be given again
        asked = replace(once, size=table.size, distance=table.distance)
        twice, said = there(tmp_path / second / "there", asked, second)
        common = LIGHT_FORMATS[first].holds & LIGHT_FORMATS[second].holds
        given = {"size", "distance"} & LIGHT_FORMATS[second].holds
        wanted = replace(twice, names=once.names) if second == "lp" and not once.names else twice
        assert_same(wanted, table, common | given)
        if second != "rig":
            assert ("strengths" in " ".join(said)) == (
                "strengths" in LIGHT_FORMATS[first].holds - LIGHT_FORMATS[second].holds
            )
        back, _ = there(tmp_path / second / "back", replace(twice, size=table.size, distance=table.distance), first)
        more = {"size", "distance"} & LIGHT_FORMATS[first].holds
        if first == "lp" and "names" not in common:
            back = replace(back, names=())
        assert_same(back, table, common | more)


def test_files_are_what_other_programs_expect(tmp_path):
    table = distant()
    directions, powers = table.rig.directions, table.rig.strengths(3)
    write_lights(tmp_path / "a.json", table, "meshroom")
    for light, d, s in zip(json.loads((tmp_path / "a.json").read_text())["lights"], directions, powers, strict=True):
        assert [float(x) for x in light["direction"]] == pytest.approx([d[0], -d[1], -d[2]], abs=1e-15)
        assert [float(x) for x in light["intensity"]] == list(s)
    write_lights(tmp_path / "psbox", table, "psbox")
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "psbox" / "light_directions.txt"), directions.T)
    assert (tmp_path / "psbox" / "LightProbe-2" / "circle_data.txt").read_text().split() == ["400", "120", "31.25"]
    write_lights(tmp_path / "diligent", table, "diligent")
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "diligent" / "light_directions.txt"), directions)
    assert (tmp_path / "diligent" / "light_intensities.txt").read_bytes().endswith(b"\n")  # Meshroom drops a last line
    write_lights(tmp_path / "a.dome", table, "dome")
    dome = json.loads((tmp_path / "a.dome").read_text())
    assert dome["lightConfiguration"] == "directional"
    np.testing.assert_allclose([[one[k] for k in "xyz"] for one in dome["directions"]], directions, atol=1e-15)
    near = lamps()
    write_lights(tmp_path / "led_params.txt", near, "luces")
    lines = (tmp_path / "led_params.txt").read_text().splitlines()
    assert lines[0].startswith("N_img nrows ncols f x0 y0 mean_distance")
    assert [float(x) for x in lines[1].split()] == [4, 80, 120, 2100.25, 61.5, 39.25, 412.5]
    first = near.rig.lights[0]
    wanted = [*first.position * [1, -1, -1], *first.axis * [1, -1, -1], *first.flux, first.mu, 0]
    assert [float(x) for x in lines[2].split()] == pytest.approx(wanted, abs=1e-14)
    write_lights(tmp_path / "near", near, "near-ps")
    light = scipy.io.loadmat(tmp_path / "near" / "light.mat")
    np.testing.assert_array_equal(light["S"][0], first.position * [1, -1, -1])
    assert light["mu"].shape == (4, 1)
    np.testing.assert_array_equal(scipy.io.loadmat(tmp_path / "near" / "camera.mat")["K"], CAMERA.matrix)


def test_bare_lamps_of_a_dome_come_back_and_need_the_pictures_width(tmp_path):
    positions = np.array([[100.0, 0, 200], [-80, 60, 150], [0, -120, 90.5]])
    squares = (positions**2).sum(axis=1)
    leds = tuple(Led(position=p, axis=-p, mu=0.0, flux=np.array([s])) for p, s in zip(positions, squares, strict=True))
    table = LightTable(rig=Rig(leds))
    with pytest.raises(UnsupportedError, match="--image-width"):
        write_lights(tmp_path / "a.dome", table, "dome")
    assert write_lights(tmp_path / "a.dome", replace(table, width=120.0), "dome") == ()
    found = read_lights(tmp_path / "a.dome")
    assert found.width == 120
    write_lights(tmp_path / "a.toml", found, "rig")
    again = read_lights(tmp_path / "a.toml")
    for one, two, three in zip(leds, found.rig.lights, again.rig.lights, strict=True):
        for other in (two, three):
            np.testing.assert_array_equal(other.position, one.position)
            np.testing.assert_allclose(other.flux, one.flux)
    dome = json.loads((tmp_path / "a.dome").read_text())
    assert dome["lightConfiguration"] == "lights3d"
    assert dome["domeDiameter"] == pytest.approx(2 * np.median(np.sqrt(squares)))
    dome["ledAdjust"] = [{"r": 1, "g": 1.2, "b": 1}] * 3
    dome["label"] = "big one"
    (tmp_path / "a.dome").write_text(json.dumps(dome))
    label, adjust = read_lights(tmp_path / "a.dome").notes
    assert "big one" in label
    assert "ledAdjust" in adjust


def test_what_a_format_cannot_hold_is_refused_or_said(tmp_path):
    for kind in ("lp", "diligent", "psbox", "meshroom"):
        with pytest.raises(UnsupportedError, match="lamp at a position"):
            write_lights(tmp_path / "x", lamps(), kind)
    for kind in ("luces", "near-ps"):
        with pytest.raises(UnsupportedError, match="distant"):
            write_lights(tmp_path / "x", distant(), kind)
        with pytest.raises(UnsupportedError, match="pinhole"):
            write_lights(tmp_path / "x", replace(lamps(), camera=None), kind)
    with pytest.raises(UnsupportedError, match="--distance"):
        write_lights(tmp_path / "x.txt", replace(lamps(), distance=None), "luces")
    with pytest.raises(UnsupportedError, match="frame of a pinhole"):
        write_lights(tmp_path / "x.dome", lamps(), "dome")
    coloured = LightTable(rig=Rig.distant([[0, 0, 1.0]] * 2, [[1, 2, 3.0]] * 2))
    with pytest.raises(UnsupportedError, match="colours"):
        write_lights(tmp_path / "x", coloured, "psbox")
    behind = LightTable(rig=Rig.distant([[0, 0.6, -0.8]]))
    with pytest.raises(UnsupportedError, match="behind"):
        write_lights(tmp_path / "x.lp", behind, "lp")
    assert list(tmp_path.iterdir()) == []
    full = RigFile(rig=distant().rig, response=Response("gamma", 2.2), quality=RigQuality(verdict="Good."))
    table = replace(distant(), file=full, rig=Rig(full.rig.lights, StrengthUnit.IRRADIANCE))
    said = " ".join(write_lights(tmp_path / "a.lp", replace(table, names=()), "lp"))
    for words in ("strengths", "unit", "response", "how good", "mirror balls", "made up"):
        assert words in said
    assert "mirror balls" in " ".join(write_lights(tmp_path / "a.toml", table, "rig"))
    kept = read_lights(tmp_path / "a.toml")
    assert kept.file.response == full.response
    assert kept.file.quality.verdict == "Good."
    assert kept.rig.strength_unit is StrengthUnit.IRRADIANCE


def test_three_lights_in_a_folder_need_to_be_told_apart(tmp_path):
    table = distant(3)
    for kind in ("diligent", "psbox"):
        write_lights(tmp_path / kind, table, kind)
        with pytest.raises(InputError, match="--from"):
            read_lights(tmp_path / kind)
        np.testing.assert_allclose(read_lights(tmp_path / kind, kind=kind).rig.directions, table.rig.directions)


def test_rows_and_columns_of_luces_are_told_by_the_camera(tmp_path):
    write_lights(tmp_path / "led_params.txt", lamps(), "luces")
    text = (tmp_path / "led_params.txt").read_text()
    (tmp_path / "led_params.txt").write_text(text.replace("4 80 120 ", "4 120 80 "))
    found = read_lights(tmp_path)
    assert found.size == (80, 120)
    assert "columns before rows" in found.notes[0]


def test_refined_lights_of_psbox_have_their_strengths_as_lengths(tmp_path):
    table = distant(5)
    scaled = table.rig.directions * table.rig.strengths(3)[:, :1]
    np.savetxt(tmp_path / "refined_light.txt", scaled.T, fmt="%.17g")
    found = read_lights(tmp_path)
    np.testing.assert_allclose(found.rig.strengths(1), table.rig.strengths(3)[:, :1])


def test_places_that_are_taken_stay(tmp_path):
    table = distant()
    for kind in DISTANT:
        path = place(tmp_path / kind, kind)
        path.parent.mkdir()
        write_lights(path, table, kind)
        with pytest.raises(ExistingResultError, match="--overwrite"):
            write_lights(path, table, kind)
        write_lights(path, table, kind, overwrite=True)
        if path.is_file():
            path.with_suffix(".md").write_text("mine")
            with pytest.raises(ExistingResultError, match="no file of the format"):
                write_lights(path.with_suffix(".md"), table, kind, overwrite=True)
            with pytest.raises(MissingFileError):
                write_lights(tmp_path / "none" / path.name, table, kind)
    with pytest.raises(MissingFileError):
        read_lights(tmp_path / "nothing")
    with pytest.raises(InputError, match="no format"):
        read_lights(tmp_path)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.dome", "{"),
        ("a.dome", "[]"),
        ("a.dome", "{}"),
        ("a.dome", '{"directions": [{"x": 0, "y": 0}]}'),
        ("a.dome", '{"directions": [{"x": 0, "y": 0, "z": 0}]}'),
        ("a.dome", '{"directions": [{"x": 0, "y": NaN, "z": 1}]}'),
        ("a.dome", '{"directions": 3}'),
        ("a.dome", '{"directions": [{"x": 0, "y": 0, "z": 1}], "lightConfiguration": "ring"}'),
        ("a.dome", '{"directions": [{"x": 0, "y": 0, "z": 1}], "lightConfiguration": "lights3d"}'),
        ("a.dome", '{"directions": [{"x": 0, "y": 0, "z": 1}], "imageWidth": "wide"}'),
        ("led_params.txt", "N_img\n1 2 3\n"),
        ("a.json", "{}"),
        ("a.lp", "2\na 0 0 1\n"),
        ("a.toml", "rig = 1\n[lights]\n"),
    ],
)
def test_damaged_files_are_refused(name, text, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(PsstereoError):
        read_lights(tmp_path / name)
