"""What each layout of captures keeps besides, and what its files look like."""

import json

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.capture import Capture, Truth
from psstereo.errors import (
    InputError,
    MissingFileError,
)
from psstereo.io import WRITERS, Choices, read_capture, recognise, write_capture
from psstereo.io.layout_writer import LayoutWriter
from psstereo.lights import Rig
from psstereo.stack import MemoryStack, Response
from psstereo_synth import spiral
from tests.contract.written_captures import (
    COUNT,
    DISTANT,
    EPS,
    HOLDS,
    SHAPE,
    assert_same_rig,
    changed,
    distant,
    near,
    sample,
)

# Our own layout loses nothing.


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("white", [None, 1.0, 0.1])
def test_floats_come_back_to_the_last_bit(dtype, channels, white, tmp_path):
    values = np.random.default_rng(1).normal(size=(4, *SHAPE, channels)).astype(dtype)
    values[0, 0, 0] = np.nan
    values[1, 0, 0] = np.finfo(dtype).tiny
    values[2, 0, 0] = np.inf
    capture = Capture(stack=MemoryStack(values, white=white), rig=Rig.distant(spiral(4)))
    write_capture(capture, tmp_path / "x")
    got, truth = read_capture(tmp_path / "x")
    assert truth is None
    assert got.stack.dtype == dtype
    assert got.stack.read().tobytes() == values.tobytes()
    assert got.stack.white == capture.stack.white
    assert got.stack.saturates == capture.stack.saturates


def test_a_white_level_of_a_fraction(tmp_path):
    capture = Capture(stack=MemoryStack(np.ones((3, 2, 2), np.uint8), white=200 / 3), rig=Rig.distant(spiral(3)))
    write_capture(capture, tmp_path / "x")
    assert read_capture(tmp_path / "x")[0].stack.white == 200 / 3


@pytest.mark.parametrize("near_lamps", [False, True])
@pytest.mark.parametrize("response", [Response("srgb"), Response("gamma", 2.2)])
@pytest.mark.parametrize(
    "camera", [Orthographic(pixel_size=1 / 3, length_unit="µm"), Pinhole(fx=1e3 / 3, fy=333, cx=9.1, cy=6.7, skew=0.1)]
)
def test_camera_response_and_dark_image(near_lamps, response, camera, tmp_path):
    capture, truth = near() if near_lamps else distant("capture")
    dark = np.random.default_rng(2).uniform(0, 99, (*SHAPE, 3))
    for exact in (dark, dark.astype(np.float32)):
        wanted = changed(capture, camera=camera, response=response, dark=exact)
        write_capture(wanted, tmp_path / "x", truth=truth, overwrite=True)
        got, _ = read_capture(tmp_path / "x")
        assert got.camera == camera
        assert got.response == response
        assert got.dark.tobytes() == exact.tobytes()
        assert_same_rig(got.rig, wanted.rig)


def test_truth_keeps_its_precision(tmp_path):
    capture, truth = distant("capture", coloured=False)
    given = {part: getattr(truth, part).astype(np.float32) for part in ("normals", "depth", "albedo", "visibility")}
    write_capture(capture, tmp_path / "x", truth=Truth(**given))
    found = read_capture(tmp_path / "x")[1]
    assert found.normals.dtype == found.albedo.dtype == found.visibility.dtype == np.float32
    np.testing.assert_array_equal(found.depth, given["depth"])
    np.testing.assert_array_equal(found.albedo, given["albedo"])
    for part in ("normals", "depth", "albedo"):
        assert np.load(tmp_path / "x" / "truth" / f"{part}.npy").tobytes() == given[part].tobytes()
    assert read_capture(tmp_path / "x", choices=Choices(truth=False))[1] is None


@pytest.mark.parametrize("name", ["diligent", "near-ps"])
@pytest.mark.parametrize("white", [None, 4095])
def test_a_dark_image_of_whole_numbers(name, white, tmp_path):
    capture, truth = sample(name, white=white)
    dark = np.random.default_rng(3).integers(0, 99, (*SHAPE, 3)).astype(np.float32)
    write_capture(changed(capture, dark=dark), tmp_path / "x", name, truth=truth)
    got, _ = read_capture(tmp_path / "x")
    np.testing.assert_array_equal(np.rint(got.dark * (capture.stack.white / got.stack.white)), dark)
    assert len(got.stack) == COUNT


# The files are as other programs read them.


def test_a_pinhole_for_distant_lights(tmp_path):
    camera = Pinhole(fx=1e3 / 3, fy=333.0, cx=9.1, cy=6.7, skew=1 / 7)
    for name in DISTANT:
        capture, _ = distant(name)
        write_capture(changed(capture, camera=camera), tmp_path / name, name)
        assert read_capture(tmp_path / name)[0].camera == camera


def test_the_led_file_of_luces(tmp_path):
    capture, truth = near(coloured=False)
    write_capture(capture, tmp_path / "x", "luces", truth=truth)
    lines = (tmp_path / "x" / "led_params.txt").read_text().splitlines()
    assert lines[0] == "N_img nrows ncols f x0 y0 mean_distance sfull:[Lpos Ldir Phi mu 0]"
    head = [float(word) for word in lines[1].split()]
    assert head[:3] == [COUNT, *SHAPE]
    assert head[3:6] == [capture.camera.fx, capture.camera.cx, capture.camera.cy]
    assert head[6] == pytest.approx(truth.depth[capture.mask].mean(), rel=1e-14)
    led = capture.rig.lights[2]
    row = [float(word) for word in lines[4].split()]
    assert row[:3] == (led.position * [1, -1, -1]).tolist()
    assert row[3:6] == (led.axis * [1, -1, -1]).tolist()
    assert row[6:] == [led.flux[0]] * 3 + [led.mu, 0]
    assert len(lines) == 2 + COUNT


def test_the_mat_files_of_near_ps(tmp_path):
    import scipy.io

    capture, _ = near()
    write_capture(capture, tmp_path / "x", "near-ps")
    light = scipy.io.loadmat(tmp_path / "x" / "light.mat")
    led = capture.rig.lights[3]
    assert light["S"][3].tolist() == (led.position * [1, -1, -1]).tolist()
    assert light["Dir"][3].tolist() == (led.axis * [1, -1, -1]).tolist()
    assert light["mu"].shape == (COUNT, 1)
    assert light["Phi"].shape == (COUNT, 3)
    assert scipy.io.loadmat(tmp_path / "x" / "camera.mat")["K"].tolist() == capture.camera.matrix.tolist()


def test_the_list_of_rti(tmp_path):
    capture, _ = distant("lp")
    write_capture(capture, tmp_path / "x", "lp")
    lines = (tmp_path / "x" / "lights.lp").read_text().splitlines()
    assert lines[0] == str(COUNT)
    for i, line in enumerate(lines[1:]):
        name, *vector = line.split(" ")
        assert name == f"{i + 1:04d}.png"
        assert all("e" not in word for word in vector)
        np.testing.assert_allclose([float(word) for word in vector], capture.rig.directions[i], rtol=0, atol=EPS)


def test_the_lights_of_meshroom(tmp_path):
    capture, _ = distant("meshroom")
    write_capture(capture, tmp_path / "x", "meshroom")
    lights = json.loads((tmp_path / "x" / "lights.json").read_text())["lights"]
    text = np.loadtxt(tmp_path / "x" / "light_directions.txt")
    matrix = np.loadtxt(tmp_path / "x" / "convertionMatrix.txt")
    powers = np.loadtxt(tmp_path / "x" / "light_intensities.txt")
    for i, light in enumerate(lights):
        assert set(light) == {"viewId", "type", "direction", "intensity"}
        assert (light["viewId"], light["type"]) == (str(i + 1), "directional")
        assert all(isinstance(word, str) for word in (*light["direction"], *light["intensity"]))
        direction = [float(word) for word in light["direction"]]
        assert direction == (capture.rig.directions[i] * [1, -1, -1]).tolist()
        assert direction == (matrix @ text[i]).tolist()
        assert [float(word) for word in light["intensity"]] == powers[i].tolist()
    (tmp_path / "x" / "light_directions.txt").unlink()
    (tmp_path / "x" / "light_intensities.txt").unlink()
    got, _ = read_capture(tmp_path / "x")
    assert got.rig.source == "lights.json"
    assert_same_rig(got.rig, capture.rig)
    write_capture(capture, tmp_path / "y", "sdm-unips")
    choices = Choices(lights=tmp_path / "x" / "lights.json")
    assert_same_rig(read_capture(tmp_path / "y", choices=choices)[0].rig, capture.rig)


def test_three_lights_of_diligent_want_a_word(tmp_path):
    capture, _ = distant("diligent", count=3)
    lost = write_capture(capture, tmp_path / "x", "diligent")
    assert "--lights-layout rows" in lost[-1]
    with pytest.raises(InputError, match="3 × 3"):
        read_capture(tmp_path / "x")
    got, _ = read_capture(tmp_path / "x", choices=Choices(lights_layout="rows"))
    assert_same_rig(got.rig, capture.rig)


def test_an_sdm_folder_without_lights_says_so(tmp_path):
    capture, truth = distant("sdm-unips")
    folder = tmp_path / "cat.data"
    write_capture(capture, folder, "sdm-unips", truth=truth)
    (folder / "light_directions.txt").unlink()
    assert recognise(folder)[0].format == "sdm-unips"
    with pytest.raises(MissingFileError, match="--lights"):
        read_capture(folder)


def test_every_layout_says_what_it_holds():
    for name, writer in WRITERS.items():
        assert isinstance(writer, LayoutWriter)
        assert writer.holds & {"normals", "depth", "albedo", "visibility"} == HOLDS[name]
