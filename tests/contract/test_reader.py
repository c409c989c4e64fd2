"""What every reader of captures promises, on a small folder of its own layout that the test writes."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
import scipy.io

from psstereo.errors import InputError, MissingFileError, OptionError, PsstereoError, UnreadableFileError
from psstereo.io import READERS, Choices, read_capture, recognise, write_diligent, write_lp

LIGHTS = np.array([[0.0, 0.0, 1.0], [0.5, 0.1, 0.8], [-0.5, 0.2, 0.8], [0.1, 0.6, 0.75], [0.05, -0.6, 0.75]])
LIGHTS /= np.sqrt((LIGHTS**2).sum(axis=1, keepdims=True))
SHAPE = (18, 24)
DISTANT = sorted(set(READERS) - {"near-led"})
WHOLE_FILE = {"npz", "mat-stack"}
LISTED = {"capture", "diligent", "lp"}


@dataclass(frozen=True)
class Sample:
    """A capture on disk: what to read, its lights in the canonical frame, and an image file that is not the first."""

    path: Path
    lights: np.ndarray
    image: Path | None


def sphere() -> tuple[np.ndarray, np.ndarray]:
    """Return the normals of a sphere's front, (h, w, 3), and its mask."""
    rows, columns = np.indices(SHAPE, dtype=float)
    x, y = (columns - 11.5) / 8.0, (8.5 - rows) / 8.0
    mask = x * x + y * y < 0.98
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    return np.where(mask[..., None], np.stack([x, y, z], axis=-1), 0.0), mask


def shaded(lights: np.ndarray) -> np.ndarray:
    """Return brightness under each light, (m, h, w), 0 to 1."""
    return np.maximum(np.einsum("hwk,mk->mhw", sphere()[0], lights), 0) * 0.9 + 0.05 * sphere()[1]


def save(path: Path, image: np.ndarray) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imencode(path.suffix, image)[1].tofile(path)
    return path


def eight(values: np.ndarray) -> np.ndarray:
    return np.round(values * 255).astype(np.uint8)


def save_mask(path: Path) -> None:
    save(path, sphere()[1].astype(np.uint8) * 255)


def save_numbers(path: Path, values: np.ndarray, head: str = "") -> None:
    path.write_text(head + "".join(" ".join(f"{v:.12f}" for v in row) + "\n" for row in values))


def build_capture(folder: Path) -> Sample:
    names = [save(folder / f"img {i}.png", eight(v)).name for i, v in enumerate(shaded(LIGHTS))]
    save_mask(folder / "mask.png")
    rows = ", ".join(str((LIGHTS * [1, -1, -1])[i].tolist()) for i in range(len(LIGHTS)))
    (folder / "capture.toml").write_text(
        f'[images]\nfiles = {names}\n[lights]\ndirections = [{rows}]\nframe = "opencv"\n[mask]\nfile = "mask.png"\n'
    )
    return Sample(folder, LIGHTS, folder / names[2])


def build_diligent(folder: Path) -> Sample:
    images = np.repeat(np.round(shaded(LIGHTS) * 65535).astype(np.uint16)[..., None], 3, axis=-1)
    normals, mask = sphere()
    write_diligent(folder, images=images, directions=LIGHTS, intensities=np.ones(5), mask=mask, normals=normals)
    return Sample(folder, LIGHTS, folder / "003.png")


def build_psbox(folder: Path) -> Sample:
    files = [save(folder / "Objects" / f"Image_{i + 1:02d}.png", eight(v)) for i, v in enumerate(shaded(LIGHTS))]
    save_numbers(folder / "light_directions.txt", LIGHTS.T)
    return Sample(folder, LIGHTS, files[2])


def build_near_led(folder: Path) -> Sample:
    files = [save(folder / f"led_{i + 1}.png", eight(v)) for i, v in enumerate(shaded(LIGHTS))]
    turned = LIGHTS * [1, -1, -1]
    save_numbers(folder / "led_positions_mm.txt", turned * 300 + [0, 0, 700])
    save_numbers(folder / "led_axes.txt", -turned)
    save_numbers(folder / "led_mu.txt", np.ones((5, 1)))
    save_numbers(folder / "led_intensity_rgb.txt", np.full((5, 3), 4e4))
    save_numbers(folder / "K.txt", np.array([[900, 0, 11.5], [0, 900, 8.5], [0, 0, 1]]))
    save_mask(folder / "mask.png")
    save(folder / "ambient.png", np.full(SHAPE, 3, np.uint8))
    return Sample(folder, LIGHTS, files[2])


def build_yale(folder: Path) -> Sample:
    angles = [(0, 0), (35, 15), (-35, 15), (0, 45), (10, -35), (120, 0)]
    a, e = np.deg2rad(np.array(angles, float)).T
    lights = np.stack([-np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)], axis=1)
    images = dict(zip([f"yaleB07_P00A{x:+04d}E{y:+03d}.pgm" for x, y in angles], shaded(lights), strict=True))
    for name, values in images.items():
        save(folder / name, eight(values))
    save(folder / "yaleB07_P00_Ambient.pgm", np.full(SHAPE, 2, np.uint8))
    order = sorted(range(len(angles)), key=lambda i: list(images)[i])
    return Sample(folder, lights[order], folder / sorted(images)[2])


def build_face16(folder: Path) -> Sample:
    for i, values in enumerate(shaded(LIGHTS)):
        save(folder / f"input_{i + 1}.tif", np.round(values * 65535).astype(np.uint16))
    np.save(folder / "sources.npy", LIGHTS * [1, -1, -1] * 0.9)
    return Sample(folder, LIGHTS, folder / "input_3.tif")


def build_psm(folder: Path) -> Sample:
    for i, values in enumerate(shaded(LIGHTS)):
        save(folder / "cat" / f"cat.{i + 7}.png", eight(values))
    save_mask(folder / "cat" / "cat.mask.png")
    save_numbers(folder / "lights.txt", LIGHTS, "5\n")
    return Sample(folder / "cat", LIGHTS, folder / "cat" / "cat.9.png")


def build_lp(folder: Path) -> Sample:
    names = [save(folder / f"img {i}.png", eight(v)).name for i, v in enumerate(shaded(LIGHTS))]
    save_mask(folder / "mask.png")
    write_lp(folder / "coin.lp", names, LIGHTS)
    return Sample(folder, LIGHTS, folder / names[2])


def build_npz(folder: Path) -> Sample:
    folder.mkdir(parents=True)
    np.savez(folder / "bunny.npz", images=shaded(LIGHTS).astype(np.float32))
    np.save(folder / "lights.npy", LIGHTS)
    np.save(folder / "gt_normal.npy", sphere()[0])
    save_mask(folder / "mask.png")
    return Sample(folder, LIGHTS, None)


def build_mat_stack(folder: Path) -> Sample:
    folder.mkdir(parents=True)
    stacked = np.moveaxis(eight(shaded(LIGHTS)), 0, -1)
    down_right = np.stack([-LIGHTS[:, 1], LIGHTS[:, 0], LIGHTS[:, 2]], axis=1)
    scipy.io.savemat(folder / "bust.mat", {"I": stacked, "S": down_right, "mask": sphere()[1].astype(np.uint8)})
    return Sample(folder, LIGHTS, None)


def build_images(folder: Path) -> Sample:
    files = [save(folder / f"photo {i}.png", eight(v)) for i, v in enumerate(shaded(LIGHTS))]
    save_numbers(folder / "lights.txt", LIGHTS)
    save_mask(folder / "mask.png")
    return Sample(folder, LIGHTS, files[2])


def build_meshroom(folder: Path) -> Sample:
    files = [save(folder / "PS_Pictures" / f"{i + 1:02d}.png", eight(v)) for i, v in enumerate(shaded(LIGHTS))]
    save_numbers(folder / "light_directions.txt", LIGHTS[:, [1, 0, 2]])
    save_numbers(folder / "light_intensities.txt", np.full((5, 3), 1.5))
    save_numbers(folder / "convertionMatrix.txt", np.array([[0, 1, 0], [-1, 0, 0], [0, 0, -1]]))
    save_mask(folder / "mask.png")
    return Sample(folder, LIGHTS, files[2])


def build_sdm_unips(folder: Path) -> Sample:
    home = folder.with_name(folder.name + ".data")
    files = [save(home / f"L_{i + 1}.png", eight(v)) for i, v in enumerate(shaded(LIGHTS))]
    save_numbers(home / "light_directions.txt", LIGHTS)
    save_mask(home / "mask.png")
    return Sample(home, LIGHTS, files[2])


BUILDERS: dict[str, Callable[[Path], Sample]] = {
    "capture": build_capture,
    "meshroom": build_meshroom,
    "sdm-unips": build_sdm_unips,
    "diligent": build_diligent,
    "psbox": build_psbox,
    "near-led": build_near_led,
    "yale": build_yale,
    "face16": build_face16,
    "psm": build_psm,
    "lp": build_lp,
    "npz": build_npz,
    "mat-stack": build_mat_stack,
    "images": build_images,
}
every_reader = pytest.mark.parametrize("name", READERS)
every_distant = pytest.mark.parametrize("name", DISTANT)


@pytest.fixture
def sample(name: str, tmp_path: Path) -> Sample:
    return BUILDERS[name](tmp_path / "Données d'été 1")


@every_reader
def test_has_a_name_and_a_summary(name):
    assert READERS[name].name == name
    assert READERS[name].summary


@every_reader
def test_recognises_its_own_layout_before_all_others(name, sample):
    found = recognise(sample.path)
    assert found[0].format == name
    reason = found[0].reason
    assert not reason.endswith(".")
    assert not reason[0].isupper() or "." in reason.split()[0]


@every_reader
def test_recognises_nothing_else(name, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    other = tmp_path / "other"
    other.mkdir()
    for file in ("README.md", "notes.txt", "data.csv", "broken.mat", "broken.npz", "archive.lpx", "pyproject.toml.bak"):
        (other / file).write_text("3 words here\n1 2 3\n")
    save(other / "holiday.jpg", np.zeros((4, 4), np.uint8))
    for path in (empty, other, other / "notes.txt", other / "broken.mat", other / "holiday.jpg", tmp_path / "absent"):
        assert READERS[name].recognise(path) is None, path


@every_reader
def test_counts_shapes_and_mask_agree(name, sample):
    capture, truth = read_capture(sample.path)
    count = len(sample.lights)
    assert len(capture.stack) == len(capture.rig) == len(capture.stack.names) == count
    assert capture.shape == SHAPE
    assert capture.mask is None or (capture.mask == sphere()[1]).all()
    assert all(note.endswith((".", ")")) for note in capture.notes)
    if truth is not None:
        ok = capture.effective_mask
        np.testing.assert_allclose(truth.normals[ok], sphere()[0][ok], atol=1e-6)
    np.testing.assert_allclose(
        capture.stack.frame(1).mean(axis=2) / capture.stack.white, shaded(sample.lights)[1], atol=0.003
    )


@every_distant
def test_lights_are_unit_vectors_in_the_canonical_frame(name, sample):
    capture, _ = read_capture(sample.path)
    directions = capture.rig.directions
    np.testing.assert_allclose(np.sqrt((directions**2).sum(axis=1)), 1, atol=1e-12)
    np.testing.assert_allclose(directions, sample.lights, atol=1e-9)


@every_reader
def test_decodes_only_the_first_image(name, sample, monkeypatch):
    if name in WHOLE_FILE:
        pytest.skip("one file holds all images")
    from psstereo.stack import files

    decoded = []
    original = files.decode_image
    monkeypatch.setattr(files, "decode_image", lambda path: decoded.append(path.name) or original(path))
    capture, _ = read_capture(sample.path)
    assert decoded == [capture.stack.names[0]]
    capture.stack.frame(0)
    assert len(decoded) == 1


@every_reader
def test_names_a_missing_image(name, sample):
    if sample.image is None or name == "yale":
        pytest.skip("no list says that an image is missing")
    sample.image.unlink()
    with pytest.raises(PsstereoError) as caught:
        read_capture(sample.path)
    if name in LISTED:
        assert isinstance(caught.value, MissingFileError)
        assert sample.image.name in str(caught.value)
    else:
        assert isinstance(caught.value, InputError)
        assert "4 images" in str(caught.value)


@every_reader
def test_refuses_a_truncated_image_by_name(name, sample):
    if sample.image is None:
        pytest.skip("one file holds all images")
    data = sample.image.read_bytes()
    sample.image.write_bytes(data[: len(data) // 2])
    capture, _ = read_capture(sample.path)
    with pytest.raises(UnreadableFileError, match=sample.image.name.replace("+", r"\+")):
        capture.stack.read()


@every_reader
def test_refuses_an_image_of_another_size_or_depth(name, sample):
    if sample.image is None:
        pytest.skip("one file holds all images")
    depth = np.uint16 if READERS[name].name not in ("diligent", "face16") else np.uint8
    for odd in (np.zeros((5, 5), np.uint8), np.zeros(SHAPE, depth)):
        save(sample.image, odd)
        capture, _ = read_capture(sample.path)
        with pytest.raises(InputError, match=r"must have one size, one bit depth"):
            capture.stack.read()


@every_reader
def test_takes_the_lights_that_are_chosen(name, sample, tmp_path):
    chosen = tmp_path / "autres lumières é.txt"
    save_numbers(chosen, sample.lights[::-1] * 3)
    capture, _ = read_capture(sample.path, choices=Choices(lights=chosen))
    np.testing.assert_allclose(capture.rig.directions, sample.lights[::-1], atol=1e-9)
    assert capture.rig.source == chosen.name


@every_reader
def test_refuses_chosen_lights_of_another_count(name, sample, tmp_path):
    chosen = tmp_path / "others.txt"
    save_numbers(chosen, sample.lights[:-1])
    with pytest.raises(InputError, match=r"others\.txt"):
        read_capture(sample.path, choices=Choices(lights=chosen))
    with pytest.raises(MissingFileError, match=r"gone\.txt"):
        read_capture(sample.path, choices=Choices(lights=tmp_path / "gone.txt"))


@every_reader
def test_names_a_chosen_light_that_is_no_number(name, sample, tmp_path):
    chosen = tmp_path / "others.txt"
    bad = sample.lights.copy()
    bad[2, 1] = np.nan
    save_numbers(chosen, bad)
    with pytest.raises(InputError, match=r"others\.txt: Light 3"):
        read_capture(sample.path, choices=Choices(lights=chosen))


@every_reader
def test_takes_the_layout_that_is_chosen(name, sample, tmp_path):
    chosen = tmp_path / "columns.txt"
    save_numbers(chosen, sample.lights.T)
    choices = Choices(lights=chosen, lights_layout="columns")
    capture, _ = read_capture(sample.path, choices=choices)
    np.testing.assert_allclose(capture.rig.directions, sample.lights, atol=1e-9)
    with pytest.raises(OptionError, match="rows"):
        read_capture(sample.path, choices=Choices(lights=chosen, lights_layout="diagonal"))


@every_reader
def test_takes_or_leaves_out_the_mask(name, sample, tmp_path):
    chosen = np.zeros(SHAPE, np.uint8)
    chosen[3:6, 4:9] = 200
    save(tmp_path / "masque.png", chosen)
    capture, _ = read_capture(sample.path, choices=Choices(mask=tmp_path / "masque.png"))
    assert (capture.mask == (chosen > 0)).all()
    capture, _ = read_capture(sample.path, choices=Choices(ignore_mask=True))
    assert capture.mask is None
    save(tmp_path / "small.png", chosen[:5])
    with pytest.raises(InputError, match=r"small\.png"):
        read_capture(sample.path, choices=Choices(mask=tmp_path / "small.png"))


def test_every_reader_has_a_sample():
    assert set(BUILDERS) == set(READERS)


def test_a_description_wins_over_every_other_layout(tmp_path):
    sample = build_diligent(tmp_path / "both")
    (sample.path / "capture.toml").write_text(
        '[images]\npattern="0*.png"\n[lights]\ndirections="light_directions.txt"\n'
    )
    assert [r.format for r in recognise(sample.path)][:2] == ["capture", "diligent"]
    assert read_capture(sample.path, layout="diligent")[0].mask is not None


def test_an_unknown_folder_is_told_what_it_lacks(tmp_path):
    save(tmp_path / "a.png", np.zeros((3, 3), np.uint8))
    with pytest.raises(InputError, match=r"1 images and no file of lights"):
        read_capture(tmp_path)
    with pytest.raises(InputError, match="no description"):
        read_capture(tmp_path / "a.png")
    with pytest.raises(MissingFileError, match="does not exist"):
        read_capture(tmp_path / "b")
    with pytest.raises(OptionError, match="diligent"):
        read_capture(tmp_path, layout="diligant")


def test_a_folder_of_captures_names_them(tmp_path):
    build_psm(tmp_path / "psm")
    with pytest.raises(InputError, match=r"sub-folders cat are\. .* such as .*cat\."):
        read_capture(tmp_path / "psm")


def test_photographs_and_chosen_lights_are_enough(tmp_path):
    for i in (1, 2, 10):
        save(tmp_path / f"DSC{i}.png", np.full((3, 4), i, np.uint8))
    save_numbers(tmp_path / "l.dat", LIGHTS[:3], "3\n")
    capture, _ = read_capture(tmp_path, choices=Choices(lights=tmp_path / "l.dat"))
    assert capture.stack.names == ("DSC1.png", "DSC2.png", "DSC10.png")
