import cv2
import numpy as np
import pytest

from psstereo.errors import ExistingResultError, InputError, MissingFileError, UnreadableFileError
from psstereo.io import read_capture, write_diligent
from psstereo.io.light_file import read_directions
from psstereo.io.text import read_table

RNG = np.random.default_rng(7)
IMAGES = RNG.integers(0, 65536, (4, 6, 7, 3)).astype(np.uint16)
L = RNG.normal(size=(4, 3)) * 0.3 + [0, 0, 1]
L /= np.linalg.norm(L, axis=1)[:, None]
POWER = RNG.uniform(0.5, 2, (4, 3))
MASK = np.pad(np.ones((4, 5), bool), 1)


@pytest.fixture
def folder(tmp_path):
    write_diligent(tmp_path / "Chat é", images=IMAGES, directions=L, intensities=POWER, mask=MASK)
    return tmp_path / "Chat é"


def test_comes_back_to_the_last_bit(tmp_path):
    normals = RNG.normal(size=(6, 7, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    normals[~MASK] = np.nan
    depth = np.where(MASK, RNG.random((6, 7)), np.nan)
    target = tmp_path / "x"
    write_diligent(
        target,
        images=iter(IMAGES),
        directions=L,
        intensities=POWER,
        mask=MASK,
        normals=normals,
        depth=depth,
        compression=0,
    )
    capture, truth = read_capture(target)
    assert (capture.stack.read() == IMAGES).all()
    assert (read_directions(target / "light_directions.txt").vectors == L).all()
    np.testing.assert_allclose(capture.rig.directions, L, rtol=1e-15)
    assert (capture.rig.strengths(3) == POWER).all()
    assert (capture.mask == MASK).all()
    np.testing.assert_allclose(truth.normals, normals, atol=1e-15)
    np.testing.assert_array_equal(truth.depth, depth)
    for name in ("filenames.txt", "light_directions.txt", "light_intensities.txt"):
        data = (target / name).read_bytes()
        assert data.endswith(b"\n")
        assert data.count(b"\n") == 4
        assert not data.endswith(b"\n\n")
    assert not list(tmp_path.glob(".*"))


def test_eight_bits_and_gray_are_stretched(tmp_path):
    eight = (IMAGES[..., 0] >> 8).astype(np.uint8)
    write_diligent(tmp_path / "x", images=eight, directions=L, intensities=np.ones(4), mask=MASK)
    capture, _ = read_capture(tmp_path / "x")
    assert capture.stack.shape == (4, 6, 7, 3)
    assert (capture.stack.read() == eight[..., None].astype(np.uint16) * 257).all()


def test_compression_changes_sizes_only(tmp_path):
    flat = np.full((3, 50, 60, 3), 500, np.uint16)
    sizes = []
    for level in (0, 9):
        write_diligent(
            tmp_path / str(level),
            images=flat,
            directions=L[:3],
            intensities=np.ones(3),
            mask=np.ones((50, 60), bool),
            compression=level,
        )
        sizes.append((tmp_path / str(level) / "001.png").stat().st_size)
    assert sizes[0] > 10 * sizes[1]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"images": IMAGES[:3]}, "3 images and 4 lights"),
        ({"images": IMAGES.astype(np.float32)}, "Image 1 .*float32"),
        ({"images": IMAGES[:, :3]}, "Image 1 has the shape"),
        ({"directions": L[:3]}, r"\(3, 3\)"),
        ({"intensities": np.ones((4, 2))}, r"\(4, 2\)"),
        ({"directions": L * np.nan}, "finite"),
        ({"mask": MASK.astype(np.uint8)}, "uint8"),
        ({"normals": np.zeros((2, 2, 3))}, r"\(2, 2, 3\)"),
        ({"depth": np.zeros((2, 2))}, r"\(2, 2\)"),
        ({"compression": 12}, "12"),
    ],
)
def test_nothing_is_left_behind_when_it_fails(tmp_path, change, said):
    arguments = {"images": IMAGES, "directions": L, "intensities": POWER, "mask": MASK, **change}
    with pytest.raises(InputError, match=said):
        write_diligent(tmp_path / "x", **arguments)
    assert list(tmp_path.iterdir()) == []


def test_never_overwrites(folder):
    with pytest.raises(ExistingResultError):
        write_diligent(folder, images=IMAGES, directions=L, intensities=POWER, mask=MASK)
    with pytest.raises(MissingFileError):
        write_diligent(folder / "a" / "b", images=IMAGES, directions=L, intensities=POWER, mask=MASK)


def test_channels_belong_to_their_intensities(folder):
    """OpenCV reads B, G, R and the text file is R, G, B."""
    capture, _ = read_capture(folder)
    assert (capture.stack.frame(2) == IMAGES[2]).all()
    assert (capture.rig.lights[2].strength == POWER[2]).all()


def test_without_lists_and_strengths(folder):
    (folder / "filenames.txt").unlink()
    (folder / "light_intensities.txt").unlink()
    cv2.imencode(".png", np.zeros((6, 7, 3), np.uint8))[1].tofile(folder / "Normal_gt_view.png")
    capture, _ = read_capture(folder)
    assert len(capture.stack) == 4
    assert any("equally strong" in note for note in capture.notes)


def test_an_image_without_lights_is_subtracted(folder):
    """As Meshroom has it; and the list may be called names.txt, as SDPS-Net has it."""
    cv2.imencode(".png", np.full((6, 7, 3), 40, np.uint16))[1].tofile(folder / "Ambient.png")
    capture, _ = read_capture(folder)
    assert (capture.dark == 40).all()
    assert any("Ambient.png is subtracted" in note for note in capture.notes)
    (folder / "filenames.txt").write_text("002.png\n001.png\n003.png\n004.png\n")
    (folder / "filenames.txt").rename(folder / "names.txt")
    capture, _ = read_capture(folder)
    assert capture.stack.names[0] == "002.png"
    (folder / "names.txt").unlink()
    assert len(read_capture(folder)[0].stack) == 4
    cv2.imencode(".png", np.full((6, 7, 3), 40, np.uint16))[1].tofile(folder / "dark.png")
    with pytest.raises(InputError, match="several dark images"):
        read_capture(folder)


def test_transposed_lights(folder):
    np.savetxt(folder / "light_directions.txt", L.T)
    capture, _ = read_capture(folder)
    np.testing.assert_allclose(capture.rig.directions, L)
    assert any("transposed" in note for note in capture.notes)


def test_windows_line_ends_blank_lines_and_other_case(folder):
    (folder / "filenames.txt").write_bytes(b"001.PNG\r\n002.png\r\n003.png \r\n004.png\r\n\r\n")
    capture, _ = read_capture(folder)
    assert capture.stack.names == ("001.png", "002.png", "003.png", "004.png")


def test_counts_that_disagree(folder):
    text = (folder / "light_directions.txt").read_text()
    (folder / "light_directions.txt").write_text(text + "0 0 1\n")
    with pytest.raises(InputError, match=r"light_directions\.txt holds 5 rows of 3 numbers; there are 4 images"):
        read_capture(folder)
    (folder / "light_directions.txt").write_text(text)
    np.savetxt(folder / "light_intensities.txt", POWER[:3])
    with pytest.raises(InputError, match=r"light_intensities\.txt holds 3 rows of 3 numbers; there are 4 images"):
        read_capture(folder)


def test_bad_lights_are_named(folder):
    bad = L.copy()
    bad[1] = 0
    np.savetxt(folder / "light_directions.txt", bad)
    with pytest.raises(InputError, match=r"light_directions\.txt: Light 2"):
        read_capture(folder)
    np.savetxt(folder / "light_directions.txt", L)
    dark = POWER.copy()
    dark[3, 1] = 0
    np.savetxt(folder / "light_intensities.txt", dark)
    with pytest.raises(InputError, match=r"light_intensities\.txt: Light 4"):
        read_capture(folder)


def test_gray_images_take_the_mean_intensity(folder):
    for i in range(4):
        cv2.imencode(".png", IMAGES[i, ..., 0])[1].tofile(folder / f"{i + 1:03d}.png")
    capture, _ = read_capture(folder)
    np.testing.assert_allclose(capture.rig.strengths(1)[:, 0], POWER.mean(axis=1))
    assert any("gray" in note for note in capture.notes)


def test_truth_that_is_damaged_or_of_another_size(folder):
    np.savez(folder / "depth_gt.npz", depth_gt=np.zeros((3, 3)))
    with pytest.raises(UnreadableFileError, match=r"\(3, 3\)"):
        read_capture(folder)
    data = (folder / "depth_gt.npz").read_bytes()
    (folder / "depth_gt.npz").write_bytes(data[:100])
    with pytest.raises(UnreadableFileError, match=r"depth_gt\.npz"):
        read_capture(folder)
    (folder / "depth_gt.npz").unlink()
    np.save(folder / "Normal_gt.npy", np.tile([0, 0.6, 0.8], (3, 3, 1)))
    with pytest.raises(InputError, match=r"Normal_gt\.npy are 3 × 3"):
        read_capture(folder)


def test_intensities_keep_their_digits(folder):
    assert (read_table(folder / "light_intensities.txt").values == POWER).all()
