"""Scene files: every key, every slip, the template and all that is commented out in it."""

import re
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from psstereo.brdf import BRDFS, Ggx, Lambert, Merl, OrenNayar
from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import (
    InputError,
    MissingFileError,
    OptionError,
    PsstereoError,
    UnreadableFileError,
    UnsupportedError,
)
from psstereo.io.environment_file import write_environment
from psstereo.lights import Ambient, Environment, Led
from psstereo_synth.faults import FAULTS, DeadPixels, Motion
from psstereo_synth.meshes import TriangleMesh
from psstereo_synth.patterns import PATTERNS, Checker, Constant, ImagePattern
from psstereo_synth.scenes.file import Changes, parse_scene, read_scene
from psstereo_synth.scenes.template import TEMPLATE
from psstereo_synth.shapes import RELIEFS, GaussianHills, HeightGrid, Sphere

HILLS = '[surface]\nshape = "hills"\n'


def parse(text, changes=None, folder=Path()):
    return parse_scene(text.encode(), folder / "my.toml", changes)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """One of each kind of file that a scene can name."""
    tmp_path = tmp_path_factory.mktemp("files")
    np.save(tmp_path / "dem.npy", np.outer(np.hanning(5), np.hanning(7)))
    trimesh.creation.icosphere(subdivisions=2).export(tmp_path / "ball.ply")
    cv2.imwrite(str(tmp_path / "paint.png"), np.full((4, 4, 3), 128, np.uint8))
    write_environment(tmp_path / "sky.exr", np.ones((4, 8, 3)))
    # A MERL file: three sizes, then red, green and blue in turn, with the scales that the format takes out.
    table = np.full(3 * 90 * 90 * 180, 1.0)
    (tmp_path / "gray.binary").write_bytes(np.array([90, 90, 180], "<i4").tobytes() + table.astype("<f8").tobytes())
    return tmp_path


def test_the_least_scene():
    made = parse(HILLS)
    assert made.name == "my"
    assert made.summary == ""
    assert made.size == (256, 256)
    assert isinstance(made.surface, GaussianHills)
    assert made.material.model is Lambert
    assert made.material.albedo.evaluate(np.zeros((1, 3))).tolist() == [[0.7]]
    assert len(made.lights) == 24
    assert (made.ambient, made.dark_frame, made.faults, made.unit, made.seed) == (None, False, (), "mm", 0)
    assert (made.cast_shadows, made.beams, made.bounce, made.extinction) == (True, 64, 0, 0.0)
    assert (made.sensor.bits, made.sensor.white, made.sensor.seed) == (16, None, 0)
    (view,) = made.viewpoints
    assert isinstance(view.camera, Orthographic)
    assert view.camera.pixel_size == 2 / 256
    assert view.camera.length_unit == "mm"


def test_every_key_arrives():
    made = parse("""
        name = "n"
        summary = "s."
        size = [8, 6]
        seed = 5
        unit = "m"
        [camera]
        type = "pinhole"
        focal = 2
        distance = 10
        [surface]
        shape = "sphere"
        radius = 0.5
        [material]
        brdf = "ggx"
        roughness = 0.4
        f0 = [0.1, 0.2, 0.3]
        [albedo]
        pattern = "checker"
        cells = 3
        low = [0.1, 0.2, 0.3]
        [lights]
        kind = "led"
        count = 2
        [ambient]
        radiance = 4.0
        dark_frame = true
        [render]
        cast_shadows = false
        beams = 5
        bounce = 3
        [sensor]
        bits = 12
        white = 300.0
        full_well = 20000
        read_noise = 5
        dark_level = 0.02
        vignetting = 0.2
        gain = 2
        prnu = 0.01
        response = 2.2
        [[faults]]
        fault = "motion"
        rms = 0.3
        [[faults]]
        fault = "dead-pixels"
        dead = 0.1
    """)
    assert (made.name, made.summary, made.size, made.seed, made.unit) == ("n", "s.", (6, 8), 5, "m")
    (view,) = made.viewpoints
    assert isinstance(view.camera, Pinhole)
    assert view.camera.fx == 16.0
    assert view.pose.position.tolist() == [0, 0, 10]
    assert made.surface == Sphere(radius=0.5)
    brdf = made.material.brdf(np.zeros((4, 3)))
    assert isinstance(brdf, Ggx)
    assert brdf.channels == 3
    assert isinstance(made.material.albedo, Checker)
    assert all(isinstance(light, Led) for light in made.lights)
    assert isinstance(made.ambient, Ambient)
    assert made.dark_frame
    assert (made.cast_shadows, made.beams, made.bounce) == (False, 5, 3)
    sensor = made.sensor
    assert (sensor.bits, sensor.white, sensor.full_well, sensor.read_noise, sensor.gain) == (12, 300, 20000, 5, 2)
    assert (sensor.dark_level, sensor.vignetting, sensor.prnu, sensor.seed) == (0.02, 0.2, 0.01, 5)
    assert (sensor.response.name, sensor.response.exponent) == ("gamma", 2.2)
    assert [type(fault) for fault in made.faults] == [Motion, DeadPixels]
    assert made.faults[0].rms == 0.3


@pytest.mark.parametrize("name", sorted(set(RELIEFS) - {"grid"}))
def test_every_shape_by_name(name):
    assert type(parse(f'[surface]\nshape = "{name}"').surface) is RELIEFS[name]


def test_heights_in_the_file_itself():
    made = parse('[surface]\nshape = "grid"\nheights = [[0,0,0,0],[0,nan,1,0],[0,1,0,0],[0,0,0,0]]\nspacing = [1, 2]')
    assert isinstance(made.surface, HeightGrid)
    assert made.surface.spacing == (1, 2)
    assert made.viewpoints[0].camera.pixel_size == pytest.approx(6 / 256)  # all of it is seen


EXTRA = {"phong": "specular = 0.2\nexponent = 10", "ggx": "f0 = 0.04\nroughness = 0.5", "minnaert": "k = 0.8"}
EXTRA |= {"blinn-phong": EXTRA["phong"], "oren-nayar": "roughness_deg = 20"}


@pytest.mark.parametrize("name", sorted(set(BRDFS) - {"merl"}))
def test_every_reflectance_by_name(name):
    made = parse(f'{HILLS}[material]\nbrdf = "{name}"\n{EXTRA.get(name, "")}')
    assert made.material.name == name
    assert made.material.brdf(np.zeros((2, 3))).channels == 1
    if name == "oren-nayar":
        assert made.material.parameters["roughness"] == pytest.approx(np.radians(20))
        assert made.material.model is OrenNayar


def test_a_missing_parameter_of_a_reflectance_is_told_at_once():
    with pytest.raises(InputError, match=r"\[material\] in my.toml has no specular and no exponent"):
        parse(f'{HILLS}[material]\nbrdf = "phong"')
    with pytest.raises(InputError, match="roughness"):
        parse(f'{HILLS}[material]\nbrdf = "ggx"\nf0 = 0.5\nroughness = 2.0')
    with pytest.raises(InputError, match="add up to"):
        parse(f'{HILLS}[material]\nbrdf = "phong"\nspecular = 0.5\nexponent = 3')


@pytest.mark.parametrize("name", sorted(set(PATTERNS) - {"image"}))
def test_every_pattern_by_name(name):
    assert type(parse(f'{HILLS}[albedo]\npattern = "{name}"').material.albedo) is PATTERNS[name]


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_by_name(name):
    extra = {"ambient-leak": "level = 0.1"}.get(name, "")
    assert type(parse(f'{HILLS}[[faults]]\nfault = "{name}"\n{extra}').faults[0]) is FAULTS[name]


def test_files_are_relative_to_the_scene(files, monkeypatch):
    monkeypatch.chdir("/")
    made = parse('[surface]\nelevation = "dem.npy"', folder=files)
    assert isinstance(made.surface, HeightGrid)
    assert made.viewpoints[0].camera.pixel_size == pytest.approx(6 / 256)  # seven heights one apart
    made = parse('[surface]\nmesh = "ball.ply"\nscale = 0.45\nsmooth = true', folder=files)
    assert isinstance(made.surface, TriangleMesh)
    assert made.surface.smooth
    assert np.abs(made.surface.vertices).max() == pytest.approx(0.45)
    assert made.viewpoints[0].camera.pixel_size == pytest.approx(1 / 256)
    made = parse(f'{HILLS}[albedo]\npattern = "image"\npath = "paint.png"', folder=files)
    assert isinstance(made.material.albedo, ImagePattern)
    made = parse(f'{HILLS}[ambient]\nenvironment = "sky.exr"', folder=files)
    assert isinstance(made.ambient, Environment)
    made = parse(f'{HILLS}[material]\nbrdf = "merl"\nfile = "gray.binary"', folder=files)
    assert isinstance(made.material.model, Merl)


@pytest.mark.parametrize(
    "text",
    [
        '[surface]\nelevation = "none.npy"',
        '[surface]\nmesh = "none.ply"',
        f'{HILLS}[albedo]\npattern = "image"\npath = "none.png"',
        f'{HILLS}[ambient]\nenvironment = "none.exr"',
        f'{HILLS}[material]\nbrdf = "merl"\nfile = "none.binary"',
        f'{HILLS}[lights]\ndirections = "none.txt"',
    ],
)
def test_files_that_are_not_there(tmp_path, text):
    with pytest.raises(MissingFileError, match=r"none\."):
        parse(text, folder=tmp_path)


def test_meshes_that_are_none(tmp_path):
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "points.ply")
    (tmp_path / "broken.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex many\n")
    with pytest.raises(InputError, match="no triangles"):
        parse('[surface]\nmesh = "points.ply"', folder=tmp_path)
    with pytest.raises(UnreadableFileError, match="broken"):
        parse('[surface]\nmesh = "broken.ply"', folder=tmp_path)
    with pytest.raises(OptionError, match="suffix"):
        parse('[surface]\nmesh = "body.blend"', folder=tmp_path)


def test_changes_take_the_place_of_what_the_file_says():
    text = f"size = [8, 6]\nseed = 1\n{HILLS}[lights]\ncount = 4\n[sensor]\nseed = 9"
    assert parse(text).sensor.seed == 9  # its own, since the file says so
    made = parse(text, Changes(size=(3, 5), lights=7, seed=2))
    assert (made.size, len(made.lights), made.seed, made.sensor.seed) == ((3, 5), 7, 2, 2)
    assert made.viewpoints[0].camera.pixel_size == pytest.approx(2 / 5)
    assert parse(text, Changes(size=(3, 5))).seed == 1
    assert parse(f"seed = 4\n{HILLS}").sensor.seed == 4  # noise follows the one seed that is given


def test_views_of_parallel_cameras_look_at_the_middle_of_the_image():
    made = parse(f"{HILLS}[[views]]\nposition = [3, 0, 4]\n[[views]]\nposition = [0, 0, 5]\ntarget = [0.25, 0, 0]")
    assert len(made.viewpoints) == 2
    view = made.viewpoints[0]
    middle = 0.5 * 255 * view.camera.pixel_size * np.array([1.0, -1.0, 0.0])
    assert view.pose.to_scene(middle) == pytest.approx([3, 0, 4], abs=1e-12)
    assert view.pose.rotation[:, 2] == pytest.approx([0.6, 0, 0.8])


def test_views_of_a_pinhole():
    made = parse(f'{HILLS}[camera]\ntype = "pinhole"\n[[views]]\nposition = [3, 0, 4]\nup = [1, 0, 0]')
    view = made.viewpoints[0]
    assert view.pose.position.tolist() == [3, 0, 4]
    assert view.pose.rotation[:, 1] == pytest.approx([0.8, 0, -0.6])


WRONG = {
    "no surface": "",
    "empty surface": "[surface]",
    "surface is text": 'surface = "hills"',
    "two surfaces": '[surface]\nshape = "hills"\nmesh = "a.ply"',
    "no such shape": '[surface]\nshape = "hils"',
    "shape is a number": "[surface]\nshape = 3",
    "key of another shape": "[surface]\nshape = 'sphere'\nsteepness = 3",
    "radius zero": "[surface]\nshape = 'sphere'\nradius = 0",
    "radius nan": "[surface]\nshape = 'sphere'\nradius = nan",
    "radius inf": "[surface]\nshape = 'sphere'\nradius = inf",
    "steepness text": "[surface]\nshape = 'hills'\nsteepness = '2'",
    "count real": "[surface]\nshape = 'hills'\ncount = 2.5",
    "mesh empty": "[surface]\nmesh = ''",
    "mesh number": "[surface]\nmesh = 3",
    "mesh scale": "[surface]\nmesh = 'a.ply'\nscale = 0",
    "mesh smooth": "[surface]\nmesh = 'a.ply'\nsmooth = 1",
    "mesh key": "[surface]\nmesh = 'a.ply'\nsteepness = 1",
    "elevation key": "[surface]\nelevation = 'a.npy'\nscale = 1",
    "elevation number": "[surface]\nelevation = 1",
    "unknown key": f"sise = [3, 3]\n{HILLS}",
    "unknown table": f"{HILLS}[camra]\nwidth = 1",
    "size zero": f"size = [0, 5]\n{HILLS}",
    "size negative": f"size = [5, -5]\n{HILLS}",
    "size one": f"size = 256\n{HILLS}",
    "size three": f"size = [1, 2, 3]\n{HILLS}",
    "size real": f"size = [8.0, 8.0]\n{HILLS}",
    "size true": f"size = [true, true]\n{HILLS}",
    "size text": f'size = "8x8"\n{HILLS}',
    "size huge": f"size = [100000, 100000]\n{HILLS}",
    "seed negative": f"seed = -1\n{HILLS}",
    "seed real": f"seed = 1.5\n{HILLS}",
    "seed true": f"seed = true\n{HILLS}",
    "name empty": f'name = ""\n{HILLS}',
    "name number": f"name = 3\n{HILLS}",
    "unit number": f"unit = 3\n{HILLS}",
    "summary list": f"summary = ['a']\n{HILLS}",
    "camera type": f"{HILLS}[camera]\ntype = 'fisheye'",
    "camera key": f"{HILLS}[camera]\nfocal = 3",
    "camera width": f"{HILLS}[camera]\nwidth = -1",
    "camera width nan": f"{HILLS}[camera]\nwidth = nan",
    "camera focal": f"{HILLS}[camera]\ntype = 'pinhole'\nfocal = 0",
    "camera distance": f"{HILLS}[camera]\ntype = 'pinhole'\ndistance = inf",
    "camera distance text": f"{HILLS}[camera]\ntype = 'pinhole'\ndistance = '8'",
    "views table": f"{HILLS}[views]\nposition = [0, 0, 3]",
    "views empty": f"views = []\n{HILLS}",
    "views numbers": f"views = [1, 2]\n{HILLS}",
    "view without position": f"{HILLS}[[views]]\ntarget = [0, 0, 0]",
    "view key": f"{HILLS}[[views]]\nposition = [0, 0, 3]\nroll = 3",
    "view position": f"{HILLS}[[views]]\nposition = [0, 0]",
    "view position text": f"{HILLS}[[views]]\nposition = ['0', '0', '3']",
    "view position nan": f"{HILLS}[[views]]\nposition = [0, 0, nan]",
    "view at its target": f"{HILLS}[[views]]\nposition = [0, 0, 0]",
    "view up": f"{HILLS}[[views]]\nposition = [0, 0, 3]\nup = [0, 0, 1]",
    "brdf unknown": f"{HILLS}[material]\nbrdf = 'lambertian'",
    "brdf key": f"{HILLS}[material]\nroughness = 0.3",
    "brdf albedo": f"{HILLS}[material]\nalbedo = 0.3",
    "brdf diffuse": f"{HILLS}[material]\nbrdf = 'phong'\ndiffuse = 0.3\nspecular = 0.1\nexponent = 3",
    "brdf text": f"{HILLS}[material]\nbrdf = 'ggx'\nf0 = '0.3'\nroughness = 0.3",
    "brdf nan": f"{HILLS}[material]\nbrdf = 'ggx'\nf0 = nan\nroughness = 0.3",
    "brdf map": f"{HILLS}[material]\nbrdf = 'ggx'\nf0 = [[0.3, 0.2], [0.1, 0.1]]\nroughness = 0.3",
    "brdf channels": f"{HILLS}[material]\nbrdf = 'ggx'\nf0 = [0.3, 0.2]\nroughness = [0.1, 0.2, 0.3]",
    "merl file": f"{HILLS}[material]\nbrdf = 'merl'",
    "pattern missing": f"{HILLS}[albedo]\nalbedo = 0.3",
    "pattern unknown": f"{HILLS}[albedo]\npattern = 'chequer'",
    "pattern key": f"{HILLS}[albedo]\npattern = 'constant'\ncells = 3",
    "albedo negative": f"{HILLS}[albedo]\npattern = 'constant'\nalbedo = -0.1",
    "albedo above one": f"{HILLS}[albedo]\npattern = 'constant'\nalbedo = 1.1",
    "albedo nan": f"{HILLS}[albedo]\npattern = 'constant'\nalbedo = nan",
    "albedo text": f"{HILLS}[albedo]\npattern = 'constant'\nalbedo = '0.3'",
    "albedo true": f"{HILLS}[albedo]\npattern = 'constant'\nalbedo = true",
    "image without path": f"{HILLS}[albedo]\npattern = 'image'",
    "shadows": f"{HILLS}[render]\ncast_shadows = 'no'",
    "beams zero": f"{HILLS}[render]\nbeams = 0",
    "beams real": f"{HILLS}[render]\nbeams = 3.5",
    "beams true": f"{HILLS}[render]\nbeams = true",
    "beams huge": f"{HILLS}[render]\nbeams = 1000000000",
    "bounce negative": f"{HILLS}[render]\nbounce = -1",
    "bounce huge": f"{HILLS}[render]\nbounce = 1000000000",
    "extinction negative": f"{HILLS}[render]\nextinction = -0.1",
    "extinction nan": f"{HILLS}[render]\nextinction = nan",
    "extinction text": f"{HILLS}[render]\nextinction = '0'",
    "bounce in fog": f"{HILLS}[render]\nbounce = 4\nextinction = 0.1",
    "render key": f"{HILLS}[render]\nshadows = true",
    "bits": f"{HILLS}[sensor]\nbits = 9",
    "bits text": f"{HILLS}[sensor]\nbits = '8'",
    "bits true": f"{HILLS}[sensor]\nbits = true",
    "bits real": f"{HILLS}[sensor]\nbits = 8.0",
    "white zero": f"{HILLS}[sensor]\nwhite = 0",
    "white nan": f"{HILLS}[sensor]\nwhite = nan",
    "white text": f"{HILLS}[sensor]\nwhite = '3'",
    "read noise alone": f"{HILLS}[sensor]\nread_noise = 3",
    "dark level": f"{HILLS}[sensor]\ndark_level = 1",
    "vignetting": f"{HILLS}[sensor]\nvignetting = -0.1",
    "response word": f"{HILLS}[sensor]\nresponse = 'gamma'",
    "response true": f"{HILLS}[sensor]\nresponse = true",
    "response list": f"{HILLS}[sensor]\nresponse = [2.2]",
    "response nan": f"{HILLS}[sensor]\nresponse = nan",
    "response huge": f"{HILLS}[sensor]\nresponse = 100",
    "sensor key": f"{HILLS}[sensor]\niso = 100",
    "sensor seed": f"{HILLS}[sensor]\nseed = -1",
    "dark frame of nothing": f"{HILLS}[ambient]\ndark_frame = true",
    "faults table": f"{HILLS}[faults]\nfault = 'motion'",
    "faults list": f"faults = ['motion']\n{HILLS}",
    "fault without name": f"{HILLS}[[faults]]\nrms = 0.3",
    "fault unknown": f"{HILLS}[[faults]]\nfault = 'mution'",
    "fault key": f"{HILLS}[[faults]]\nfault = 'motion'\nsigma = 0.3",
    "fault value": f"{HILLS}[[faults]]\nfault = 'motion'\nrms = -0.3",
    "fault word": f"{HILLS}[[faults]]\nfault = 'motion'\nkind = 'drunk'",
    "fault without its value": f"{HILLS}[[faults]]\nfault = 'ambient-leak'",
    "more than 64 bits": f"seed = 123456789012345678901234567890\n{HILLS}",
    "more digits than are read": f"seed = {'9' * 5000}\n{HILLS}",
    "hexadecimal without end": f"size = [8, 0x{'f' * 5000}]\n{HILLS}",
    "nested without end": f"size = {'[' * 5000}{']' * 5000}\n{HILLS}",
    "date": f"size = [2020-01-01, 5]\n{HILLS}",
    "twice": f"size = [3, 3]\nsize = [4, 4]\n{HILLS}",
    "no TOML": "this is = = no TOML",
}


@pytest.mark.parametrize("what", WRONG)
def test_every_slip_is_one_clear_error(what):
    kinds = (InputError, OptionError, UnreadableFileError, UnsupportedError)
    with pytest.raises(PsstereoError) as caught:
        parse(WRONG[what])
    error = caught.value
    assert isinstance(error, kinds)
    assert all(part and part[0].isupper() | (part[0] in "[/") | part[0].isalnum() for part in (error.given,))
    assert error.needed.endswith((".", "]"))
    assert error.remedy
    assert len(str(error)) < 700


@pytest.mark.parametrize(
    ("text", "near"),
    [
        (f"sise = [3, 3]\n{HILLS}", "size"),
        (f"{HILLS}[camra]\nwidth = 1", "camera"),
        (f"{HILLS}[camera]\nwith = 1", "width"),
        (f"{HILLS}[camera]\ntype = 'pinole'", "pinhole"),
        ("[surface]\nshape = 'terain'", "terrain"),
        ("[surface]\nshape = 'hills'\nstepness = 1", "steepness"),
        (f"{HILLS}[material]\nbrdf = 'lamberd'", "lambert"),
        (f"{HILLS}[albedo]\npattern = 'cheker'", "checker"),
        (f"{HILLS}[[faults]]\nfault = 'deadpixels'", "dead-pixels"),
        (f"{HILLS}[render]\nbounces = 3", "bounce"),
        (f"{HILLS}[sensor]\nfullwell = 3", "full_well"),
        (f"{HILLS}[ambient]\nradience = 3", "radiance"),
    ],
)
def test_the_nearest_name_is_offered(text, near):
    with pytest.raises(OptionError) as caught:
        parse(text)
    assert caught.value.remedy == f"Did you mean {near}?"


def test_a_dark_frame_of_the_dark_level_alone():
    made = parse(f"{HILLS}[ambient]\ndark_frame = true\n[sensor]\ndark_level = 0.1")
    assert made.dark_frame
    assert made.ambient is None


def test_changes_are_checked_too():
    for size in ((0, 5), (5, 0), (30_000, 5)):
        with pytest.raises(InputError, match="pixels are asked for"):
            parse(HILLS, Changes(size=size))
    with pytest.raises(OptionError, match="0 lights"):
        parse(HILLS, Changes(lights=0))
    with pytest.raises(PsstereoError):
        parse(HILLS, Changes(seed=-1))


def test_files_of_all_sorts(tmp_path):
    folder = tmp_path / "Größe 尺寸"
    folder.mkdir()
    path = folder / "Hügel.toml"
    path.write_bytes(b"\xef\xbb\xbf" + f'summary = "Für Äpfel."\r\n{HILLS}'.encode())
    made = read_scene(path)
    assert made.name == "Hügel"
    assert made.summary == "Für Äpfel."
    for content, error in ((b"", InputError), (b"\xff\xfe\x00", UnreadableFileError), (b"\0", UnreadableFileError)):
        path.write_bytes(content)
        with pytest.raises(error, match="Hügel"):
            read_scene(path)
    with pytest.raises(MissingFileError, match="none"):
        read_scene(folder / "none.toml")
    with pytest.raises(UnreadableFileError):
        read_scene(folder)


def test_the_template_is_a_scene():
    made = parse(TEMPLATE)
    assert made.name == "my-scene"
    assert made.summary.endswith(".")
    assert all(len(line) <= 120 for line in TEMPLATE.splitlines())


def test_the_template_names_all_there_is():
    words = set(re.findall(r"[\w-]+", TEMPLATE))
    for catalogue in (set(RELIEFS) - {"grid"}, PATTERNS, FAULTS, BRDFS):
        assert set(catalogue) <= words
    assert {"spiral", "ring", "arc", "day", "directional", "sun", "led", "disc", "window"} <= words


def commented():
    """Lines of the template that are switched off, by the table they stand in."""
    table, found = "", []
    for line in TEMPLATE.splitlines():
        heading = re.match(r"(?:# )?\[+(\w+)\]+", line)
        if heading:
            table = heading[1]
        elif re.match(r"# \w+ = ", line):
            found.append((table, line[2:]))
    return found


# What has to be said beside a line that is switched on, and which lines it takes the place of.
BESIDE = {
    "type": ({}, ("width",)),
    "focal": ({"type": '"pinhole"'}, ("width",)),
    "distance": ({"type": '"pinhole"'}, ("width",)),
    "target": ({"position": "[1, 0, 8]"}, ()),
    "up": ({"position": "[1, 0, 8]"}, ()),
    "elevation": ({"elevation": '"dem.npy"'}, ("shape", "steepness")),
    "mesh": ({"mesh": '"ball.ply"'}, ("shape", "steepness")),
    "scale": ({"mesh": '"ball.ply"'}, ("shape", "steepness")),
    "smooth": ({"mesh": '"ball.ply"'}, ("shape", "steepness")),
    "roughness_deg": ({"brdf": '"oren-nayar"'}, ()),
    "file": ({"brdf": '"merl"', "file": '"gray.binary"'}, ()),
    "albedo": ({"pattern": '"constant"'}, ()),
    "azimuth_deg": ({"arrangement": '"arc"'}, ()),
    "directions": ({}, ("arrangement", "count", "tilt_deg")),
    "angular_radius_deg": ({"kind": '"sun"'}, ()),
    "mu": ({"kind": '"led"'}, ()),
    "radius": ({"kind": '"disc"'}, ()),
    "lights.width": ({"kind": '"window"'}, ()),
    "lights.distance": ({"kind": '"led"'}, ()),
    "latitude_deg": ({"arrangement": '"day"'}, ("tilt_deg",)),
    "day": ({"arrangement": '"day"'}, ("tilt_deg",)),
    "hours": ({"arrangement": '"day"', "latitude_deg": "40"}, ("tilt_deg",)),
    "environment": ({"environment": '"sky.exr"'}, ()),
    "dark_frame": ({"radiance": "1.0"}, ()),
    "read_noise": ({"full_well": "20000"}, ()),
    "gain": ({"full_well": "20000"}, ()),
    "rms": ({"fault": '"motion"'}, ()),
}


def switched_on(table, line):
    """The template with one line, and what belongs to it, in force."""
    key = line.split(" = ", maxsplit=1)[0]
    beside, instead = BESIDE.get(f"{table}.{key}", BESIDE.get(key, ({}, ())))
    lines = {key: line} | {other: f"{other} = {value}" for other, value in beside.items()}
    result, seen, at = [], False, ""
    for old in TEMPLATE.splitlines():
        heading = re.match(r"(?:# )?(\[+(\w+)\]+)", old)
        if heading:
            at = heading[2]
            seen = seen or at == table
            result.append(heading[1] if at == table or not old.startswith("#") else old)
            if at == table:
                result += lines.values()
        elif at != table or old.split(" = ", maxsplit=1)[0] not in (*lines, *instead):
            result.append(old)
    assert seen
    return "\n".join(result)


@pytest.mark.parametrize(("table", "line"), commented(), ids=lambda value: value[:20])
def test_every_line_of_the_template_that_is_switched_off_is_valid_too(files, table, line):
    text = switched_on(table, line)
    if table == "material" and line.startswith("file"):  # a measured reflectance has its albedo in it
        text = text.replace('[albedo]\npattern = "checker"', "")
    off, on = tomllib.loads(TEMPLATE), tomllib.loads(text)
    assert on != off
    made = parse(text, Changes(size=(8, 8)), folder=files)
    assert made.name == "my-scene"


def test_there_are_lines_that_are_switched_off():
    assert len(commented()) > 30


def test_a_measured_reflectance_has_its_own_albedo(files):
    with pytest.raises(OptionError, match="has its albedo in it") as caught:
        parse(f"{HILLS}[material]\nbrdf = 'merl'\nfile = 'gray.binary'\n[albedo]\npattern = 'constant'", folder=files)
    assert "Take the table" in caught.value.remedy


def test_constant_is_what_is_meant_by_default():
    assert isinstance(parse(HILLS).material.albedo, Constant)
