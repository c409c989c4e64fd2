"""What every image stack promises: the same pixels from memory and from any kind of file, each decoded once."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import OpenEXR
import pytest
from PIL import Image

from psstereo.capture import Capture
from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.lights import Rig
from psstereo.normals import estimate_normals
from psstereo.stack import FileStack, MemoryStack
from psstereo.stack import files as files_module
from psstereo_synth import checker, hills, lambertian_capture, spiral

SHAPE = (9, 13)


def write_opencv(path, image):
    ok, data = cv2.imencode(path.suffix, image[..., ::-1] if image.shape[2] == 3 else image)
    assert ok
    data.tofile(path)


def write_pillow(path, image):
    Image.fromarray(image if image.shape[2] == 3 else image[..., 0]).save(path)


def write_exr(path, image):
    channels = {"RGB": image} if image.shape[2] == 3 else {"Y": image[..., 0].copy()}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(str(path))


def write_npy(path, image):
    np.save(path, image if image.shape[2] == 3 else image[..., 0])


KINDS = {
    "png 8": (".png", np.uint8, write_opencv),
    "png 16": (".png", np.uint16, write_opencv),
    "tiff 8": (".tif", np.uint8, write_opencv),
    "tiff 16": (".tiff", np.uint16, write_opencv),
    "tiff float32": (".tif", np.float32, write_opencv),
    "bmp": (".bmp", np.uint8, write_opencv),
    "pnm 8": (".pgm", np.uint8, write_opencv),
    "pnm 16": (".pgm", np.uint16, write_opencv),
    "tga": (".tga", np.uint8, write_pillow),
    "exr": (".exr", np.float32, write_exr),
    "npy 16": (".npy", np.uint16, write_npy),
    "npy float32": (".npy", np.float32, write_npy),
    "npy float64": (".npy", np.float64, write_npy),
}


def pixels(dtype, channels, count=4, shape=SHAPE, seed=0):
    rng = np.random.default_rng(seed)
    if np.dtype(dtype).kind == "f":
        return rng.uniform(-0.5, 2.0, (count, *shape, channels)).astype(dtype)
    return rng.integers(0, np.iinfo(dtype).max, (count, *shape, channels), dtype, endpoint=True)


def save(folder, kind, images):
    suffix, _, write = KINDS[kind]
    if suffix == ".pgm" and images.shape[3] == 3:
        suffix = ".ppm"
    paths = tuple(folder / f"{i:02d}{suffix}" for i in range(len(images)))
    for path, image in zip(paths, images, strict=True):
        write(path, image)
    return paths


@pytest.fixture(params=[(kind, c) for kind in KINDS for c in (1, 3)], ids=lambda p: f"{p[0]}, {p[1]} channels")
def stacks(request, tmp_path):
    kind, channels = request.param
    images = pixels(KINDS[kind][1], channels)
    return MemoryStack(images), FileStack(save(tmp_path, kind, images)), images


def test_the_same_bytes_from_memory_and_from_files(stacks):
    memory, files, images = stacks
    assert files.shape == memory.shape == images.shape
    assert files.dtype == memory.dtype == images.dtype
    assert files.white == memory.white
    assert files.saturates == memory.saturates
    assert len(files) == len(files.names) == len(memory.names) == 4
    for _ in range(2):  # the first frame is kept from construction for the first look only
        for i in range(4):
            np.testing.assert_array_equal(files.frame(i), images[i])
            np.testing.assert_array_equal(memory.frame(i), images[i])
    rows, columns = slice(2, 5), slice(3, 11)
    np.testing.assert_array_equal(files.read(rows, columns), images[:, rows, columns])
    np.testing.assert_array_equal(memory.read(rows, columns), images[:, rows, columns])


def test_full_scale(stacks):
    memory, _, images = stacks
    expected = {"uint8": 255.0, "uint16": 65535.0, "float32": 1.0, "float64": 1.0}[images.dtype.name]
    assert memory.white == expected
    assert memory.saturates == (images.dtype.kind == "u")
    assert MemoryStack(images, white=4095).white == 4095.0
    assert MemoryStack(images, white=4095).saturates


def test_frames_from_many_threads(tmp_path):
    images = pixels(np.uint16, 3, count=12)
    stack = FileStack(save(tmp_path, "png 16", images))
    with ThreadPoolExecutor(8) as pool:
        for _ in range(3):
            got = list(pool.map(lambda i: (i, stack.frame(i).copy()), list(range(12)) * 4))
            for i, frame in got:
                np.testing.assert_array_equal(frame, images[i])


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_red_green_blue(tmp_path, kind):
    """A red, a green and a blue image say which channel is which."""
    dtype = KINDS[kind][1]
    top = 1.0 if np.dtype(dtype).kind == "f" else np.iinfo(dtype).max
    images = np.zeros((3, *SHAPE, 3), dtype)
    for c in range(3):
        images[c, ..., c] = top
    stack = FileStack(save(tmp_path, kind, images))
    for c in range(3):
        np.testing.assert_array_equal(stack.frame(c)[0, 0], np.eye(3)[c] * top)


@pytest.mark.parametrize("kind", ["png 16", "tiff 16", "tga", "exr", "npy float64"])
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("gray", ["mean", "bt601", "per-channel", (0.7, 0.0, 0.3)])
def test_coloured_lights_and_paint_come_back_from_files(tmp_path, kind, dark, gray):
    """Intensities that differ by channel undo themselves only if R meets R."""
    dtype = KINDS[kind][1]
    strengths = np.random.default_rng(1).uniform(0.3, 1.0, (8, 3)) * [1.0, 0.6, 0.3]
    capture, truth = lambertian_capture(
        hills(32, 24, steepness=0.6), checker((24, 32), tint=True), spiral(8, max_tilt=0.5), strengths, bits=None
    )
    level = np.array([0.02, 0.04, 0.08])
    images = capture.stack.read() * 0.9 + (level if dark else 0.0)
    top = 1.0 if np.dtype(dtype).kind == "f" else np.iinfo(dtype).max
    images = np.rint(images * top).astype(dtype) if top > 1 else images.astype(dtype)
    level = np.broadcast_to(level * top, (24, 32, 3)) if dark else None
    answers = [
        estimate_normals(Capture(stack=stack, rig=capture.rig, mask=capture.mask, dark=level), gray=gray)
        for stack in (FileStack(save(tmp_path, kind, images)), MemoryStack(images))
    ]
    np.testing.assert_allclose(answers[0].normals, answers[1].normals, rtol=0, atol=2e-6)
    mask = capture.mask
    gap = np.linalg.norm(answers[0].normals - truth.normals, axis=2)[mask].max()
    # 8 bit: half a step over the dimmest channel's brightness; a swap of channels costs more than 0.3
    assert gap < (0.15 if dtype is np.uint8 else 1e-3 if dtype is np.uint16 else 1e-5)
    if gray == "per-channel" and dtype is not np.uint8:
        ratio = answers[0].albedo[mask] / truth.albedo[mask]
        np.testing.assert_allclose(ratio, ratio.mean(), rtol=2e-3)


def count_decodes(monkeypatch):
    counts = Counter()
    decode = files_module.decode_image

    def counting(path):
        counts[path.name] += 1
        return decode(path)

    monkeypatch.setattr(files_module, "decode_image", counting)
    return counts


@pytest.mark.parametrize("workers", [0, 3])
@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("gray", ["mean", "per-channel"])
def test_each_image_is_decoded_once(tmp_path, monkeypatch, workers, limited, gray):
    capture, _ = lambertian_capture(hills(100, 100), checker((100, 100), tint=True), spiral(24), bits=16)
    paths = save(tmp_path, "png 16", capture.stack.read())
    counts = count_decodes(monkeypatch)
    with ThreadPoolExecutor(max(workers, 1)) as pool:
        result = estimate_normals(
            Capture(stack=FileStack(paths), rig=capture.rig, mask=capture.mask),
            gray=gray,
            over=pool.map if workers else map,
            max_memory=4_200_000 if limited and gray == "per-channel" else 3_400_000 if limited else None,
        )
    assert counts == {path.name: 1 for path in paths}
    assert result.facts["samples_in"] == ("temporary file" if limited else "memory")


def test_a_bad_rig_is_told_before_the_second_image_is_decoded(tmp_path, monkeypatch):
    paths = save(tmp_path, "png 8", pixels(np.uint8, 1))
    counts = count_decodes(monkeypatch)
    capture = Capture(stack=FileStack(paths), rig=Rig.distant(np.ones((4, 3))))
    with pytest.raises(InputError, match="one plane"):
        estimate_normals(capture)
    assert sum(counts.values()) == 1


@pytest.mark.parametrize(
    ("odd", "says"),
    [
        (pixels(np.uint16, 3, 1, (10, 13))[0], "13 × 10 pixels"),
        (pixels(np.uint8, 3, 1)[0], "8 bit"),
        (pixels(np.uint16, 1, 1)[0], "1 channel"),
    ],
    ids=["size", "depth", "colour"],
)
@pytest.mark.parametrize("place", [0, 2])
def test_an_image_unlike_the_others_is_named(tmp_path, odd, says, place):
    images = pixels(np.uint16, 3)
    paths = save(tmp_path, "png 16", images)
    write_opencv(paths[place], odd)
    stack = FileStack(paths)
    # the first image is the measure: if it is the odd one, the second does not fit it
    with pytest.raises(InputError) as caught:
        estimate_normals(Capture(stack=stack, rig=Rig.distant(spiral(4))))
    assert paths[place or 1].name in caught.value.given
    assert paths[0].name in caught.value.given
    assert says in caught.value.given
    assert caught.value.needed
    assert caught.value.remedy


@pytest.mark.parametrize("place", [0, 3])
def test_a_missing_file_is_named(tmp_path, place):
    paths = save(tmp_path, "png 8", pixels(np.uint8, 1))
    paths[place].unlink()
    with pytest.raises(MissingFileError, match=paths[place].name):
        FileStack(paths).read()


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("share", [0.9, 0.5, 0.02])
def test_a_truncated_file_is_named_and_never_read_in_part(tmp_path, kind, share):
    paths = save(tmp_path, kind, pixels(KINDS[kind][1], 3, shape=(64, 60)))
    data = paths[2].read_bytes()
    paths[2].write_bytes(data[: int(len(data) * share)])
    stack = FileStack(paths)
    with pytest.raises(UnreadableFileError, match=paths[2].name):
        stack.frame(2)


@pytest.mark.parametrize("name", ["with blank.png", "Überäßé.png", "日本.png", "a'b\"c$d;e.png", "%20.PNG", "...png"])
@pytest.mark.parametrize("folder", ["plain", "ordner mit blank é"])
def test_any_file_name(tmp_path, name, folder):
    image = pixels(np.uint16, 3)[0]
    place = tmp_path / folder
    place.mkdir()
    path = place / name
    plain = tmp_path / "x.png"
    write_opencv(plain, image)
    plain.rename(path)
    np.testing.assert_array_equal(FileStack((path,)).frame(0), image)


@pytest.mark.parametrize("kind", ["tga", "exr", "npy float64", "tiff 16"])
def test_file_names_with_accents_in_every_decoder(tmp_path, kind):
    folder = tmp_path / "mit blank é 日本"
    folder.mkdir()
    images = pixels(KINDS[kind][1], 3)
    np.testing.assert_array_equal(FileStack(save(folder, kind, images)).read(), images)


def test_no_files_are_refused():
    with pytest.raises(InputError, match="no image files"):
        FileStack(())
