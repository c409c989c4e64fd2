import cv2
import numpy as np
import pytest

from psstereo.camera import Lens, Orthographic, Pinhole
from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError, PsstereoError
from psstereo.io import read_capture
from psstereo.io.reading_options import (
    binned,
    cropped,
    in_linear_light,
    with_flat,
    with_lens,
    with_moves,
    with_response,
)
from psstereo.lights import Led, Rig
from psstereo.stack import FlatField, MemoryStack, Response

SHAPE = (12, 18)
L = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8]])


def capture_of(**more):
    images = np.random.default_rng(0).integers(10, 200, (4, *SHAPE, 3), np.uint8)
    mask = np.zeros(SHAPE, np.bool_)
    mask[2:10, 3:15] = True
    return Capture(**{"stack": MemoryStack(images), "rig": Rig.distant(L), "mask": mask, **more})


def test_what_is_moved_is_linear_first():
    dark, gain = np.full((*SHAPE, 3), 5.0), np.full((*SHAPE, 3), 2.0)
    capture = capture_of(response=Response("gamma", 2.0), dark=dark, flat=FlatField(gain))
    light = in_linear_light(capture)
    np.testing.assert_allclose(light.stack.frame(2), capture.linear(2))
    assert light.response.is_linear
    assert light.dark is None
    assert light.flat is None
    assert in_linear_light(light) is light


def test_a_response_goes_for_the_dark_level_too():
    capture = with_response(capture_of(dark=np.full((*SHAPE, 3), 51.0)), Response("gamma", 2.0))
    np.testing.assert_allclose(capture.dark, 255 * 0.04)
    with pytest.raises(OptionError, match="already"):
        with_response(capture, Response("srgb"))


@pytest.mark.parametrize(
    "camera", [Pinhole(fx=30, fy=31, cx=8, cy=5, skew=0.5), Orthographic(pixel_size=0.2, length_unit="mm")]
)
def test_points_keep_their_places(camera):
    capture = capture_of(camera=camera)
    part = cropped(capture, (3, 12), (2, 17))
    assert part.shape == (9, 15)
    np.testing.assert_array_equal(part.stack.frame(1), capture.stack.frame(1)[3:12, 2:17])
    np.testing.assert_array_equal(part.mask, capture.mask[3:12, 2:17])
    whole = camera.points(np.full(SHAPE, 7.0))[3:12, 2:17]
    moved = part.camera.points(np.full((9, 15), 7.0))
    if isinstance(camera, Pinhole):
        np.testing.assert_allclose(moved, whole, atol=1e-12)
    else:  # height maps begin at their own first pixel
        np.testing.assert_allclose(moved - moved[0, 0], whole - whole[0, 0], atol=1e-12)
    coarse = binned(capture, 3)
    assert coarse.shape == (4, 6)
    middle = camera.points(np.full(SHAPE, 7.0)).reshape(4, 3, 6, 3, 3).mean(axis=(1, 3))
    found = coarse.camera.points(np.full((4, 6), 7.0))
    if isinstance(camera, Pinhole):
        np.testing.assert_allclose(found, middle, atol=1e-12)
    else:
        np.testing.assert_allclose(found - found[0, 0], middle - middle[0, 0], atol=1e-12)


def test_lamps_go_with_a_parallel_camera():
    lamp = Led(position=np.array([1.0, 2.0, 30.0]), axis=np.array([0.0, 0.0, -1.0]), mu=1.0, flux=np.ones(1))
    camera = Orthographic(pixel_size=0.2, length_unit="mm")
    capture = capture_of(camera=camera, rig=Rig((lamp,) * 4))
    for changed, old in ((cropped(capture, (3, 12), (2, 17)), (3.0, 2.0)), (binned(capture, 3), (1.0, 1.0))):
        point = np.array([old[1] * 0.2, -old[0] * 0.2, 0.0])  # where its first pixel was
        np.testing.assert_allclose(changed.rig.lights[0].position, lamp.position - point, atol=1e-12)


def test_squares_are_in_the_mask_if_all_of_them_is():
    coarse = binned(capture_of(), 3)
    assert coarse.mask.tolist() == capture_of().mask.reshape(4, 3, 6, 3).all(axis=(1, 3)).tolist()
    light = capture_of().stack.frame(0).astype(float).reshape(4, 3, 6, 3, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(coarse.stack.frame(0), light, rtol=1e-6)
    with pytest.raises(InputError, match="mask is empty"):
        binned(capture_of(), 12)


def test_a_lens_wants_a_matrix_and_moves_come_in_the_same_step():
    capture = capture_of(camera=Pinhole(fx=30, fy=31, cx=8, cy=5))
    straight = with_lens(capture, Lens((0.0, 0.0, 0.0, 0.0)))
    np.testing.assert_allclose(straight.stack.frame(0)[1:-1, 1:-1], capture.stack.frame(0)[1:-1, 1:-1], atol=1e-3)
    moved = with_moves(straight, np.repeat([[[1.0, 0, 1], [0, 1, 0]]], 4, axis=0), "moved")
    assert moved.stack.source is straight.stack.source  # interpolated once
    np.testing.assert_allclose(moved.stack.frame(0)[1:-1, 1:-2], capture.stack.frame(0)[1:-1, 2:-1], atol=1e-3)
    with pytest.raises(InputError, match="matrix"):
        with_lens(capture_of(), Lens((0.0, 0.0, 0.0, 0.0)))


def write(path, image):
    cv2.imencode(".png", image)[1].tofile(path)


@pytest.fixture
def folder(tmp_path):
    rng = np.random.default_rng(1)
    for i in range(4):
        write(tmp_path / f"img_{i}.png", rng.integers(20, 200, SHAPE, np.uint8))
    write(tmp_path / "flat.png", np.repeat(np.arange(60, 60 + 5 * SHAPE[1], 5, np.uint8)[None], SHAPE[0], axis=0))
    np.savetxt(tmp_path / "lights.txt", L)
    return tmp_path


def gains():
    card = np.arange(60.0, 60 + 5 * SHAPE[1], 5)
    return np.median(card) / card


def test_a_flat_frame_beside_the_photographs_is_used(folder):
    capture, _ = read_capture(folder)
    assert len(capture.stack) == 4
    np.testing.assert_allclose(capture.flat.gain[3, :, 0], gains(), rtol=1e-6)
    assert any("flat.png" in note for note in capture.notes)
    np.testing.assert_allclose(capture.linear(1)[0, :, 0], capture.stack.frame(1)[0, :, 0] * gains(), rtol=1e-5)


def test_floats_of_another_flat_frame(folder):
    (folder / "flat.png").unlink()
    capture, _ = read_capture(folder)
    assert capture.flat is None
    np.save(folder / "card.npy", np.full(SHAPE, 3.0))
    assert (with_flat(capture, (folder / "card.npy",)).flat.gain == 1).all()
    each = with_flat(capture, (folder / "card.npy",) * 4)
    assert each.flat.per_light
    with pytest.raises(InputError, match="3 flat frames for 4"):
        with_flat(capture, (folder / "card.npy",) * 3)
    write(folder / "white.png", np.full(SHAPE, 255, np.uint8))
    with pytest.raises(InputError, match="saturated"):
        with_flat(capture, (folder / "white.png",))
    write(folder / "small.png", np.full((3, 4), 100, np.uint8))
    with pytest.raises(InputError, match=r"small\.png has the shape"):
        with_flat(capture, (folder / "small.png",))


def described(folder, *lines, camera=()):
    text = ["[images]", *lines, "[lights]", f"directions = {L.tolist()}", "[camera]", *camera]
    (folder / "capture.toml").write_text("\n".join(text))
    return read_capture(folder / "capture.toml")[0]


def test_a_description_knows_flat_frames_curves_and_lenses(folder):
    capture = described(
        folder,
        'pattern = "*.png"',
        'flat = "flat.png"',
        "response = [[0, 0], [0.5, 0.25], [1, 1]]",
        camera=("K = [[30, 0, 8], [0, 31, 5], [0, 0, 1]]", "lens = [0.01, 0, 0, 0]"),
    )
    assert len(capture.stack) == 4
    assert capture.stack.lens.lens == Lens((0.01, 0.0, 0.0, 0.0))
    assert capture.stack.source.response.name == "curve"
    assert capture.stack.source.flat is not None
    assert np.isfinite(capture.stack.frame(0)[4:8, 6:10]).all()


def test_a_description_knows_exposures(folder):
    for i in range(4):
        for j, time in enumerate((1, 4)):
            light = cv2.imread(str(folder / f"img_{i}.png"), cv2.IMREAD_UNCHANGED).astype(float) * 0.5
            write(folder / f"x{i}_{j}.png", np.clip(np.round(light * time), 0, 255).astype(np.uint8))
    capture = described(folder, 'pattern = "x*.png"', "exposures = [0.01, 0.04]", 'flat = "flat.png"')
    assert len(capture.stack) == 4
    assert capture.flat.gain.shape == (*SHAPE, 1)
    light = cv2.imread(str(folder / "img_2.png"), cv2.IMREAD_UNCHANGED) * 0.5 / 255
    np.testing.assert_allclose(capture.stack.frame(2)[..., 0], light, atol=0.6 / 255)
    with pytest.raises(InputError, match="8 photographs and 3 exposure times"):
        described(folder, 'pattern = "x*.png"', "exposures = [0.01, 0.04, 0.16]")


@pytest.mark.parametrize(
    "lines",
    [
        ('pattern = "img*.png"', "flat = 3"),
        ('pattern = "img*.png"', 'flat = ["flat.png", "flat.png"]'),
        ('pattern = "img*.png"', "exposures = [1, 2]", 'dark = "flat.png"'),
        ('pattern = "img*.png"', "response = [[0, 0], [1, 2]]"),
        ('pattern = "img*.png"', "response = [1, 2, 3]"),
    ],
)
def test_contradictory_descriptions_are_refused(folder, lines):
    with pytest.raises(PsstereoError):
        described(folder, *lines)
