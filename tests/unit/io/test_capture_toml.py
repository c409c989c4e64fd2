import json
import re
import tomllib

import cv2
import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import InputError, MissingFileError, OptionError, PsstereoError, UnreadableFileError
from psstereo.io import TEMPLATE, Choices, read_capture, write_normal_map
from psstereo.lights import StrengthUnit
from psstereo.normals import estimate_normals

L = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.48, -0.36, 0.8]])
IMAGES = '[images]\npattern = "img_*.png"\n'
ROWS = f"[lights]\ndirections = {L.tolist()}\n"


def picture(path, values, dtype=np.uint8):
    cv2.imencode(path.suffix, np.asarray(values, dtype))[1].tofile(path)


@pytest.fixture
def folder(tmp_path):
    """Four images img_8 … img_11 of a plane that faces the camera."""
    home = tmp_path / "Été 1"
    home.mkdir()
    for i in range(4):
        picture(home / f"img_{i + 8}.png", np.full((3, 5), round(200 * L[i, 2])))
    return home


def read(folder, text, **choices):
    (folder / "capture.toml").write_text(text, encoding="utf-8")
    return read_capture(folder, choices=Choices(**choices))


def test_the_template_is_valid_and_reads(folder):
    values = tomllib.loads(TEMPLATE)
    assert set(values) == {"name", "images", "lights"}
    (folder / "img_11.png").unlink()
    capture, truth = read(folder, TEMPLATE)
    assert capture.name == "my object"
    assert truth is None
    np.testing.assert_allclose(capture.rig.directions[0], [0.5, 0, 0.866], atol=1e-4)


def test_every_line_of_the_template_is_known():
    """Each commented line, uncommented, is TOML, and its key is one that the reader knows."""
    from psstereo.io.capture_toml import _KEYS

    section, seen = "", set()
    for line in TEMPLATE.splitlines():
        bare = line.lstrip("# ")
        if re.fullmatch(r"\[[a-z]+\]", bare.split("#")[0].strip()):
            section = bare.split("#")[0].strip(" []")
            continue
        key, equals, _ = bare.partition(" = ")
        if equals and key.isidentifier():
            assert key in _KEYS[section], line
            if not bare.endswith("["):
                tomllib.loads(bare)
            seen.add((section, key))
    wanted = {(section, key) for section, keys in _KEYS.items() if section for key in keys}
    assert wanted <= seen


def test_a_pattern_is_in_natural_order(folder):
    capture, _ = read(folder, IMAGES + ROWS)
    assert capture.stack.names == ("img_8.png", "img_9.png", "img_10.png", "img_11.png")
    assert isinstance(capture.camera, Orthographic)
    assert capture.name == "Été 1"
    normals = estimate_normals(capture).normals
    np.testing.assert_allclose(normals[1, 1], [0, 0, 1], atol=0.01)


def test_the_file_itself_may_be_named(folder):
    (folder / "other.toml").write_text(IMAGES + ROWS)
    assert len(read_capture(folder / "other.toml")[0].stack) == 4


def test_a_pattern_leaves_out_mask_dark_and_truth(folder):
    picture(folder / "img_mask.png", np.full((3, 5), 255))
    picture(folder / "img_dark.png", np.full((3, 5), 10))
    text = '[images]\npattern = "img_*.png"\ndark = "img_dark.png"\n' + ROWS + '[mask]\nfile = "img_mask.png"\n'
    capture, _ = read(folder, text)
    assert len(capture.stack) == 4
    assert capture.dark.shape == (3, 5, 1)
    assert (capture.dark == 10).all()
    assert any("left out (2)" in note for note in capture.notes)


def test_angles_frames_layouts_and_files_agree(folder):
    azimuth, elevation = np.degrees(np.arctan2(L[:, 1], L[:, 0])), np.degrees(np.arcsin(L[:, 2]))
    angles = np.stack([azimuth, elevation], axis=1).tolist()
    np.savetxt(folder / "l.txt", L.T)
    np.save(folder / "l.npy", L)
    turned = (L * [1, -1, -1]).tolist()
    for lights in (
        f"angles = {angles}",
        'directions = "l.txt"',
        'directions = "l.txt"\nlayout = "columns"',
        'directions = "l.npy"\nframe = "opengl"',
        f'directions = {turned}\nframe = "opencv"',
        f'directions = {L[:, [1, 0, 2]].tolist()}\nframe = "bini"'.replace("1.0]", "-1.0]").replace("0.8]", "-0.8]"),
    ):
        capture, _ = read(folder, f"{IMAGES}[lights]\n{lights}\n")
        np.testing.assert_allclose(capture.rig.directions, L, atol=1e-12)


def test_three_lights_written_here_are_rows_and_in_a_file_must_be_said(folder):
    (folder / "img_11.png").unlink()
    np.savetxt(folder / "l.txt", L[1:])
    rows = L[1:].tolist()
    np.testing.assert_allclose(read(folder, f"{IMAGES}[lights]\ndirections={rows}\n")[0].rig.directions, rows)
    with pytest.raises(InputError, match="3 × 3"):
        read(folder, IMAGES + '[lights]\ndirections = "l.txt"\n')
    text = IMAGES + '[lights]\ndirections = "l.txt"\nlayout = "rows"\n'
    np.testing.assert_allclose(read(folder, text)[0].rig.directions, rows)
    np.testing.assert_allclose(
        read(folder, text, lights_layout="columns")[0].rig.directions,
        L[1:].T / np.linalg.norm(L[1:].T, axis=1)[:, None],
    )


def test_strengths_units_and_levels(folder):
    text = '[images]\npattern = "img_*.png"\nwhite_level = 200\nresponse = 2.2\nradiance_at_white = 12.5\n'
    capture, _ = read(folder, text + ROWS + 'strengths = [1, 2, 3, 4]\nunit = "W/m2"\n')
    assert capture.rig.strengths(1).ravel().tolist() == [1, 2, 3, 4]
    assert capture.rig.strength_unit is StrengthUnit.IRRADIANCE
    assert (capture.stack.white, capture.radiance_at_white) == (200, 12.5)
    assert (capture.response.name, capture.response.exponent) == ("gamma", 2.2)
    np.savetxt(folder / "s.txt", np.array([[1.0, 2, 3]] * 4))
    capture, _ = read(folder, IMAGES + ROWS + 'strengths = "s.txt"\n')
    assert capture.rig.strengths(1).ravel().tolist() == [2, 2, 2, 2]
    assert any("gray" in note for note in capture.notes)


def test_the_dark_image_goes_through_the_response_too(folder):
    picture(folder / "dark.png", np.full((3, 5), 100))
    capture, _ = read(folder, IMAGES + 'response = "srgb"\ndark = "dark.png"\n' + ROWS)
    assert np.allclose(capture.dark, 255 * ((100 / 255 + 0.055) / 1.055) ** 2.4)
    picture(folder / "dark.png", np.full((3, 5), 100), np.uint16)
    with pytest.raises(InputError, match=r"dark image dark\.png .* uint16"):
        read(folder, IMAGES + 'dark = "dark.png"\n' + ROWS)


def test_lamps(folder):
    positions = (L * 200 * [1, -1, -1]).tolist()
    axes = (-L * [1, -1, -1]).tolist()
    text = f'{IMAGES}[lights]\npositions={positions}\naxes={axes}\nmu=[1,1,1,1]\nflux=[1,2,3,4]\nframe="opencv"\n'
    capture, _ = read(folder, text)
    led = capture.rig.lights[3]
    np.testing.assert_allclose(led.position, L[3] * 200)
    np.testing.assert_allclose(led.axis, -L[3])
    assert (led.mu, led.flux.tolist()) == (1, [4])
    camera = "[camera]\nK = [[100,0,2],[0,100,1],[0,0,1]]\nposition = [0, 0, 50]\n"
    capture, _ = read(folder, f"{IMAGES}[lights]\npositions={(L * 200).tolist()}\n" + camera)
    np.testing.assert_allclose(capture.rig.lights[1].position, L[1] * 200 - [0, 0, 50])
    assert capture.rig.lights[1].mu == 0
    assert isinstance(capture.camera, Pinhole)
    np.savetxt(folder / "far.txt", L)
    assert read(folder, text, lights=folder / "far.txt")[0].rig.all_distant


def test_cameras_and_truth(folder):
    np.savetxt(folder / "K.txt", [[100, 0, 2], [0, 100, 1], [0, 0, 1]])
    normals = np.tile([0.0, 0.6, 0.8], (3, 5, 1))
    write_normal_map(normals, folder / "n.png", convention="directx")
    np.save(folder / "z.npy", np.ones((3, 5)))
    text = IMAGES + ROWS + '[camera]\ntype = "pinhole"\nK = "K.txt"\n'
    capture, truth = read(folder, text + '[truth]\nnormals = "n.png"\nconvention = "directx"\ndepth = "z.npy"\n')
    assert (capture.camera.fx, capture.camera.cx) == (100, 2)
    np.testing.assert_allclose(truth.normals, normals, atol=1e-4)
    assert (truth.depth == 1).all()
    capture, _ = read(folder, IMAGES + ROWS + '[camera]\ntype = "orthographic"\npixel_size = 0.05\nunit = "mm"\n')
    assert (capture.camera.pixel_size, capture.camera.unit) == (0.05, "mm")


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        ("[image]\npattern='*'\n", OptionError, r"has image, which is unknown.*Did you mean images\?"),
        (IMAGES + "[lights]\ndirection=[[0,0,1]]\n", OptionError, r"lights\.direction.*Did you mean directions\?"),
        (IMAGES + ROWS + "[foo]\n", OptionError, "has foo, which is unknown"),
        (IMAGES + ROWS + "frame='opngl'\n", OptionError, r"Did you mean opengl\?"),
        (IMAGES + ROWS + "unit='lux'\n", OptionError, "relative, W/m2"),
        (IMAGES + ROWS + "angles=[[0,60]]\n", OptionError, "directions and angles"),
        (IMAGES + ROWS + "mu=[1]\n", OptionError, "mu with directions"),
        (IMAGES, OptionError, "no lights"),
        (IMAGES + "[lights]\nangles=[[0,60]]\nframe='opencv'\n", OptionError, "with a frame"),
        (IMAGES + "[lights]\nangles=[[0,60]]\n", InputError, "there are 4 images"),
        (IMAGES + "[lights]\nangles=[[0,60,1]]\n", InputError, "rows of 2 numbers"),
        (IMAGES + "[lights]\ndirections=[[0,0,1],[0,1]]\n", InputError, "lights.directions"),
        (IMAGES + "[lights]\ndirections=[[0,0,1],[0,1,1],[0,0,0],[1,0,1]]\n", InputError, "Light 3"),
        (IMAGES + "[lights]\ndirections=[[0,0,1],[0,1,1],[nan,0,1],[1,0,1]]\n", InputError, "Light 3"),
        (IMAGES + "[lights]\npositions=[[0,0,1]]\nmu=[1]\n", InputError, "there are 4 images"),
        (IMAGES + f"[lights]\npositions={L.tolist()}\nmu=[1,1,1,1]\n", InputError, "mu but no axes"),
        (IMAGES + f"[lights]\npositions={L.tolist()}\nstrengths=[1,1,1,1]\n", OptionError, "positions together"),
        (IMAGES + ROWS + "strengths=[1,2]\n", InputError, "2 rows; there are 4 images"),
        (IMAGES + ROWS + "strengths=[1,2,0,1]\n", InputError, r"lights\.strengths in capture\.toml: Light 3"),
        (IMAGES + ROWS + "[mask]\nfile='m.png'\n", MissingFileError, r"m\.png"),
        (IMAGES + ROWS + "[camera]\ntype='pinhole'\n", OptionError, "no K"),
        (IMAGES + ROWS + "[camera]\ntype='orthographic'\nK=[[1,0,0],[0,1,0],[0,0,1]]\n", OptionError, "orthographic"),
        (IMAGES + ROWS + "[camera]\nunit='mm'\n", InputError, "pixel_size"),
        (IMAGES + ROWS + "[camera]\npixel_size=-1\n", InputError, "positive number"),
        ("images=3\n" + ROWS, InputError, "must be a table"),
        ("[images]\n" + ROWS, InputError, "neither files nor pattern"),
        ("[images]\nfiles=['a']\npattern='b'\n" + ROWS, InputError, "has both"),
        ("[images]\nfiles='img_8.png'\n" + ROWS, InputError, "a list of file names"),
        ("[images]\nfiles=['img_8.png','x.png','y.png']\n" + ROWS, MissingFileError, r"x\.png, y\.png"),
        ("[images]\npattern='*.jpg'\n" + ROWS, MissingFileError, r"\*\.jpg"),
        ("[images]\npattern='/abs/*.jpg'\n" + ROWS, InputError, "relative"),
        (IMAGES + "response='log'\n" + ROWS, InputError, "exponent of a gamma"),
        (IMAGES + "white_level='x'\n" + ROWS, InputError, "positive number"),
        ("[images\n", UnreadableFileError, "line 1"),
        ('[images]\npattern = "C:\\Users"\n', UnreadableFileError, "Windows paths"),
    ],
)
def test_says_what_is_wrong(folder, text, kind, said):
    with pytest.raises(kind, match=said) as caught:
        read(folder, text)
    assert isinstance(caught.value, PsstereoError)


def test_a_byte_order_mark_is_fine_and_other_encodings_are_told(folder):
    (folder / "capture.toml").write_bytes(b"\xef\xbb\xbf" + (IMAGES + ROWS).encode())
    assert len(read_capture(folder)[0].stack) == 4
    (folder / "capture.toml").write_bytes('name = "é"\n'.encode("latin-1"))
    with pytest.raises(UnreadableFileError, match="UTF-8"):
        read_capture(folder)


def test_true_albedo_and_visibility(folder):
    rng = np.random.default_rng(0)
    albedo, shares = rng.uniform(size=(3, 5, 3)), rng.uniform(size=(4, 3, 5)).astype(np.float32)
    np.save(folder / "img_albedo.npy", albedo)
    np.savez_compressed(folder / "v.npz", visibility=shares, other=1)
    text = '[images]\npattern = "img_*"\n' + ROWS + '[truth]\nalbedo = "img_albedo.npy"\nvisibility = "v.npz"\n'
    capture, truth = read(folder, text)
    assert len(capture.stack) == 4
    assert any("left out (1)" in note for note in capture.notes)
    np.testing.assert_array_equal(truth.albedo, albedo)
    np.testing.assert_array_equal(truth.visibility, shares)
    assert truth.normals is truth.depth is None
    for bad, said in ((albedo[:2], r"\(2, 5, 3\)"), ((albedo * 9).astype(np.uint8), "uint8")):
        np.save(folder / "img_albedo.npy", bad)
        with pytest.raises(InputError, match=said):
            read(folder, text)
    np.save(folder / "img_albedo.npy", albedo)
    np.savez(folder / "v.npz", visibility=shares[:3])
    with pytest.raises(UnreadableFileError, match=r"\(3, 3, 5\)"):
        read(folder, text)
    np.savez(folder / "v.npz", shares=shares)
    with pytest.raises(UnreadableFileError, match="visibility"):
        read(folder, text)
    (folder / "v.npz").write_bytes(b"PK\3\4 broken")
    with pytest.raises(UnreadableFileError, match=r"v\.npz"):
        read(folder, text)
    assert read(folder, text, truth=False)[1] is None


def test_a_linear_dark_image_goes_through_no_response(folder):
    dark = np.random.default_rng(1).uniform(0, 50, (3, 5))
    np.save(folder / "dark.npy", dark)
    text = IMAGES + 'response = "srgb"\ndark_linear = "dark.npy"\n' + ROWS
    np.testing.assert_array_equal(read(folder, text)[0].dark[..., 0], dark)
    with pytest.raises(OptionError, match="dark and dark_linear"):
        read(folder, IMAGES + 'dark = "dark.npy"\ndark_linear = "dark.npy"\n' + ROWS)
    for bad in (dark[:2], dark.astype(np.uint8)):
        np.save(folder / "dark.npy", bad)
        with pytest.raises(InputError, match=r"dark\.npy"):
            read(folder, text)


def test_lights_of_meshroom_bring_their_strengths(folder):
    lights = [
        {"type": "directional", "direction": [str(v) for v in row * [1, -1, -1]], "intensity": [str(i + 1)] * 3}
        for i, row in enumerate(L)
    ]
    (folder / "l.json").write_text(json.dumps({"lights": lights}))
    capture, _ = read(folder, IMAGES + '[lights]\ndirections = "l.json"\n')
    np.testing.assert_allclose(capture.rig.directions, L, atol=1e-15)
    assert capture.rig.strengths(1).ravel().tolist() == [1, 2, 3, 4]
    capture, _ = read(folder, IMAGES + '[lights]\ndirections = "l.json"\nstrengths = [4, 3, 2, 1]\n')
    assert capture.rig.strengths(1).ravel().tolist() == [4, 3, 2, 1]
