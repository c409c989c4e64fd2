"""Scene files: every key and every part by its name."""

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
)
from psstereo.lights import Ambient, Environment, Led
from psstereo_synth.faults import FAULTS, DeadPixels, Motion
from psstereo_synth.meshes import TriangleMesh
from psstereo_synth.patterns import PATTERNS, Checker, Constant, ImagePattern
from psstereo_synth.scenes.file import Changes
from psstereo_synth.shapes import RELIEFS, GaussianHills, HeightGrid, Sphere
from tests.synth.scenes.scene_texts import HILLS, parse


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


def test_a_measured_reflectance_has_its_own_albedo(files):
    with pytest.raises(OptionError, match="has its albedo in it") as caught:
        parse(f"{HILLS}[material]\nbrdf = 'merl'\nfile = 'gray.binary'\n[albedo]\npattern = 'constant'", folder=files)
    assert "Take the table" in caught.value.remedy


def test_constant_is_what_is_meant_by_default():
    assert isinstance(parse(HILLS).material.albedo, Constant)
