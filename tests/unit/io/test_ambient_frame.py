import cv2
import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError, MissingFileError, OptionError
from psstereo.io import Choices, read_capture, write_capture
from psstereo.io.ambient_frame import with_ambient
from psstereo.lights import Rig
from psstereo.normals import estimate_normals
from psstereo.stack import MemoryStack, Mixing, Response, UnmixedStack
from psstereo_synth import hills, ring, spiral

MATRIX = [[0.8, 0.15, 0.02], [0.1, 0.7, 0.2], [0.05, 0.1, 0.9]]


def picture(path, values):
    values = values[..., ::-1] if values.ndim == 3 else values
    cv2.imencode(path.suffix, np.ascontiguousarray(values))[1].tofile(path)


def lit(noise=0.0, channels=3):
    """16-bit images with a level that differs from pixel to pixel, and that level."""
    rng = np.random.default_rng(0)
    surface = hills(24, 24, steepness=0.6)
    shading = np.maximum(np.nan_to_num(surface.normals) @ spiral(6, max_tilt=0.6).T, 0.0)
    level = rng.uniform(0.05, 0.3, (24, 24, channels))
    images = 0.5 * np.moveaxis(shading, 2, 0)[..., None] + level + noise * rng.normal(size=(6, 24, 24, channels))
    return (np.rint(np.array(part) * 65535).astype(np.uint16) for part in (images, level)), surface


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))


def test_a_frame_is_subtracted_and_told(tmp_path):
    (images, level), surface = lit()
    picture(tmp_path / "room.png", level)
    np.save(tmp_path / "room.npy", level.astype(np.float64))
    capture = Capture(stack=MemoryStack(images), rig=Rig.distant(spiral(6, max_tilt=0.6)), mask=surface.mask)
    wrong = angle(estimate_normals(capture).normals.astype(float), surface.normals)[surface.mask]
    assert np.degrees(wrong.mean()) > 3
    for name in ("room.png", "room.npy"):
        better = with_ambient(capture, tmp_path / name)
        assert better.notes == (f"{name} is subtracted.",)
        right = angle(estimate_normals(better).normals.astype(float), surface.normals)[surface.mask]
        assert np.degrees(right.max()) < 0.02
    again = with_ambient(better, tmp_path / "room.png")
    assert "instead of the dark image" in again.notes[-1]


def test_a_photographed_frame_goes_through_the_response(tmp_path):
    (images, level), _ = lit()
    picture(tmp_path / "room.png", level)
    capture = Capture(
        stack=MemoryStack(images), rig=Rig.distant(spiral(6, max_tilt=0.6)), response=Response("gamma", 2.0)
    )
    dark = with_ambient(capture, tmp_path / "room.png").dark
    np.testing.assert_allclose(dark / 65535, (level / 65535) ** 2, rtol=1e-5)
    np.save(tmp_path / "room.npy", level.astype(np.float64))
    np.testing.assert_array_equal(with_ambient(capture, tmp_path / "room.npy").dark, level)


def test_frames_that_do_not_fit_are_refused(tmp_path):
    (images, level), _ = lit()
    capture = Capture(stack=MemoryStack(images), rig=Rig.distant(spiral(6, max_tilt=0.6)))
    picture(tmp_path / "small.png", level[:20])
    picture(tmp_path / "gray.png", level[..., 0])
    picture(tmp_path / "eight.png", (level // 257).astype(np.uint8))
    for name in ("small", "gray", "eight"):
        with pytest.raises(InputError, match=f"The dark image {name}.png has the shape"):
            with_ambient(capture, tmp_path / f"{name}.png")
    for bad in (np.nan, np.inf):
        floats = level.astype(np.float64)
        floats[3, 4, 1] = bad
        np.save(tmp_path / "bad.npy", floats)
        with pytest.raises(InputError, match=r"bad\.npy holds 1 values that are no finite numbers"):
            with_ambient(capture, tmp_path / "bad.npy")
    with pytest.raises(MissingFileError):
        with_ambient(capture, tmp_path / "none.png")


@pytest.fixture
def one_shot(tmp_path):
    """A folder with one 16-bit photograph under three coloured lights and a level, and the surface."""
    surface = hills(24, 24, steepness=0.3)
    shading = np.maximum(np.nan_to_num(surface.normals) @ ring(3).T, 0.0) * 0.8
    level = np.random.default_rng(1).uniform(0.0, 0.1, (24, 24, 3))
    picture(tmp_path / "photo.png", np.rint((shading @ np.transpose(MATRIX) + level) * 65535).astype(np.uint16))
    picture(tmp_path / "room.png", np.rint(level * 65535).astype(np.uint16))
    picture(tmp_path / "mask.png", surface.mask.astype(np.uint8) * 255)
    return tmp_path, surface


def describe(folder, *lines, lights=None):
    rows = (ring(3) if lights is None else lights).tolist()
    images = '[images]\nfiles = ["photo.png"]\n' + "".join(f"{line}\n" for line in lines)
    (folder / "capture.toml").write_text(images + f"[lights]\ndirections = {rows}\n[mask]\nfile = 'mask.png'\n")
    return read_capture(folder, choices=Choices())[0]


def test_one_shot_from_a_description(one_shot):
    folder, surface = one_shot
    capture = describe(folder, f"mixing = {MATRIX}", 'dark = "room.png"')
    assert capture.stack.shape == (3, 24, 24, 1)
    assert capture.dark is None
    assert any("one colour" in note for note in capture.notes)
    result = estimate_normals(capture)
    error = angle(result.normals.astype(float), surface.normals)[surface.mask]
    assert np.degrees(error.max()) < 0.05
    np.savetxt(folder / "mixing.txt", MATRIX)
    other = describe(folder, 'mixing = "mixing.txt"')
    assert "1.1 times" in other.notes[1]
    assert np.degrees(angle(estimate_normals(other).normals.astype(float), surface.normals)[surface.mask].mean()) > 1
    chosen = with_ambient(other, folder / "room.png")
    np.testing.assert_array_equal(estimate_normals(chosen).normals, result.normals)
    assert "instead" in with_ambient(chosen, folder / "room.png").notes[-1]


def test_one_shot_undoes_the_response(one_shot):
    folder, _ = one_shot
    capture = describe(folder, f"mixing = {MATRIX}", "response = 2.0")
    assert capture.response.is_linear
    plain = describe(folder, f"mixing = {MATRIX}").stack
    raw = plain.source.frame(0) / 65535
    expected = raw**2 @ np.linalg.inv(MATRIX).T
    np.testing.assert_allclose(
        np.concatenate([capture.stack.frame(i) for i in range(3)], axis=2), expected, rtol=0, atol=1e-5
    )


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (("mixing = [[1, 0, 1], [0, 1, 1], [1, 1, 2]]",), "singular"),
        (("mixing = [[1, 0], [0, 1]]",), "3 channels; the mixing is for 2"),
        (("mixing = [1, 2, 3]",), "shape"),
        (('mixing = [["a", 0, 0], [0, 1, 0], [0, 0, 1]]',), "images.mixing"),
    ],
)
def test_mixings_that_do_not_serve_are_refused(one_shot, lines, said):
    with pytest.raises((InputError, OptionError), match=said):
        describe(one_shot[0], *lines)


def test_as_many_lights_as_photographs_times_channels(one_shot):
    with pytest.raises(InputError, match="3 images"):
        describe(one_shot[0], f"mixing = {MATRIX}", lights=spiral(4))


def test_an_unmixed_capture_is_written_and_read_again(one_shot, tmp_path):
    capture = describe(one_shot[0], f"mixing = {MATRIX}")
    assert isinstance(capture.stack, UnmixedStack)
    write_capture(capture, tmp_path / "copy")
    again = read_capture(tmp_path / "copy")[0]
    assert len(again.stack) == 3
    for i in range(3):
        np.testing.assert_array_equal(again.stack.frame(i), capture.stack.frame(i))
    np.testing.assert_array_equal(estimate_normals(again).normals, estimate_normals(capture).normals)


def test_a_mixing_of_gray_images_is_refused():
    with pytest.raises(InputError, match="1 channel"):
        UnmixedStack(MemoryStack(np.ones((1, 4, 4), np.uint8)), Mixing(np.array(MATRIX)))
