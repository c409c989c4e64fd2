"""Verdicts as files: there and back, painted in, and damaged."""

import cv2
import numpy as np
import pytest

from psstereo.errors import ExistingResultError, InputError, MissingFileError, UnreadableFileError
from psstereo.io.result_folder import write_result
from psstereo.io.verdict_files import PALETTE, edited_pictures, read_observation_mask, write_verdicts
from psstereo.normals import LeastSquares, estimate_normals
from psstereo.verdict import OUTSIDE, Verdict
from psstereo_synth import demo_capture

SHAPE = (11, 9, 13)


@pytest.fixture
def verdicts():
    codes = [*Verdict, OUTSIDE]
    return np.random.default_rng(0).choice(codes, SHAPE).astype(np.uint8)


@pytest.fixture
def folder(tmp_path, verdicts):
    write_verdicts(tmp_path, verdicts)
    return tmp_path / "verdicts"


def load(path):
    return cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)[..., ::-1]


def save(path, image):
    rows = image[..., [2, 1, 0, *range(3, image.shape[2])]] if image.ndim == 3 else image
    cv2.imencode(path.suffix, rows)[1].tofile(path)


def test_every_verdict_has_a_colour_of_its_own():
    assert set(PALETTE) == {*map(int, Verdict), OUTSIDE}
    assert len(set(PALETTE.values())) == len(PALETTE)


def test_there_and_back(tmp_path, folder, verdicts):
    np.save(tmp_path / "plain.npy", verdicts)
    np.save(tmp_path / "mask.npy", verdicts == Verdict.USED)
    for path in (folder, tmp_path / "verdicts.npz", tmp_path / "plain.npy"):
        found = read_observation_mask(path, SHAPE)
        assert found.dtype == np.uint8
        np.testing.assert_array_equal(found, verdicts)
    np.testing.assert_array_equal(read_observation_mask(tmp_path / "mask.npy", SHAPE), verdicts == Verdict.USED)
    assert sorted(p.name for p in folder.iterdir()) == [*(f"{i:04d}.png" for i in range(1, 12)), "written.txt"]
    image = load(folder / "0002.png")
    for code, colour in PALETTE.items():
        assert (image[verdicts[1] == code] == colour).all()
    assert edited_pictures(folder) == []


def test_the_same_verdicts_are_the_same_bytes(tmp_path, verdicts):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_verdicts(tmp_path / name, verdicts)
    first, second = (
        {str(p.relative_to(tmp_path / name)): p.read_bytes() for p in (tmp_path / name).rglob("*") if p.is_file()}
        for name in ("a", "b")
    )
    assert first == second


def test_what_was_painted_is_read_and_known(folder, verdicts):
    image = load(folder / "0003.png").copy()
    image[2:5, 3:8] = (255, 0, 0)
    save(folder / "0003.png", image)
    expected = verdicts.copy()
    expected[2, 2:5, 3:8] = Verdict.UNUSABLE
    np.testing.assert_array_equal(read_observation_mask(folder, SHAPE), expected)
    assert edited_pictures(folder) == ["verdicts/0003.png"]


@pytest.mark.parametrize("form", ["gray", "16 bit", "opaque alpha", "other names"])
def test_what_editors_make_of_a_picture(folder, verdicts, form):
    plain = np.where(verdicts[0] == Verdict.USED, 255, 0).astype(np.uint8)
    colour = np.repeat(plain[..., None], 3, axis=2)
    made = {
        "gray": plain,
        "16 bit": colour.astype(np.uint16) * 257,
        "opaque alpha": np.concatenate([colour, np.full((*plain.shape, 1), 255, np.uint8)], axis=2),
        "other names": colour,
    }
    save(folder / "0001.png", made[form])
    if form == "other names":
        for i in range(1, 12):
            (folder / f"{i:04d}.png").rename(folder / f"image {i}.PNG")
    expected = verdicts.copy()
    expected[0] = np.where(verdicts[0] == Verdict.USED, Verdict.USED, OUTSIDE)
    np.testing.assert_array_equal(read_observation_mask(folder, SHAPE), expected)


def spoil(folder, how):
    path = folder / "0004.png"
    if how == "soft brush":
        image = load(path).copy()
        image[3, 4] = (250, 3, 1)
        save(path, image)
    elif how == "erased":
        save(path, np.zeros((9, 13, 4), np.uint8))
    elif how == "16 bit in between":
        save(path, np.full((9, 13, 3), 1234, np.uint16))
    elif how == "scaled":
        save(path, np.zeros((18, 26, 3), np.uint8))
    elif how == "missing":
        path.unlink()
    elif how == "one more":
        save(folder / "0012.png", np.zeros((9, 13, 3), np.uint8))
    elif how == "empty":
        for one in folder.iterdir():
            one.unlink()
    else:
        path.write_bytes(path.read_bytes()[:50])


@pytest.mark.parametrize(
    ("how", "kind", "words"),
    [
        ("soft brush", InputError, ("1 pixels of 0004.png", "(250, 3, 1) in column 4, row 3", "hard brush")),
        ("erased", InputError, ("0004.png", "transparent", "Paint black")),
        ("16 bit in between", InputError, ("0004.png", "uint16")),
        ("scaled", InputError, ("0004.png", "26 × 18", "13 × 9")),
        ("missing", InputError, ("10 pictures", "11 images")),
        ("one more", InputError, ("12 pictures", "11 images")),
        ("empty", MissingFileError, ("0 pictures",)),
        ("truncated", UnreadableFileError, ("0004.png",)),
    ],
)
def test_pictures_that_cannot_be_used(folder, how, kind, words):
    spoil(folder, how)
    with pytest.raises(kind) as caught:
        read_observation_mask(folder, SHAPE)
    for word in words:
        assert word in str(caught.value)


def test_files_that_cannot_be_used(tmp_path, folder, verdicts):
    with pytest.raises(InputError, match="is a result") as caught:
        read_observation_mask(tmp_path, SHAPE)
    assert "verdicts.npz" in caught.value.remedy
    with pytest.raises(InputError, match="has the shape"):
        read_observation_mask(tmp_path / "verdicts.npz", (11, 9, 12))
    np.save(tmp_path / "weights.npy", np.ones(SHAPE))
    with pytest.raises(InputError, match="float64"):
        read_observation_mask(tmp_path / "weights.npy", SHAPE)
    with pytest.raises(InputError, match=r"no \.npz or \.npy file"):
        read_observation_mask(folder / "0001.png", SHAPE)
    with pytest.raises(MissingFileError):
        read_observation_mask(tmp_path / "nothing.npz", SHAPE)
    np.savez(tmp_path / "other.npz", images=verdicts)
    whole = (tmp_path / "verdicts.npz").read_bytes()
    (tmp_path / "half.npz").write_bytes(whole[: len(whole) // 2])
    np.save(tmp_path / "object.npy", np.array([None, {}], object), allow_pickle=True)
    for name in ("other.npz", "half.npz", "object.npy"):
        with pytest.raises(UnreadableFileError, match=name):
            read_observation_mask(tmp_path / name, SHAPE)


@pytest.fixture(scope="module")
def result():
    return estimate_normals(demo_capture(24)[0], LeastSquares(), verdicts=True)


def test_a_result_with_verdicts_may_be_replaced_until_somebody_paints_in_it(tmp_path, result):
    out = tmp_path / "out"
    for _ in range(2):
        write_result(out, result, record={}, overwrite=True)
    np.testing.assert_array_equal(read_observation_mask(out / "verdicts", result.verdicts.shape), result.verdicts)
    np.testing.assert_array_equal(np.load(out / "verdicts.npz")["verdicts"], result.verdicts)
    (out / "verdicts" / "Thumbs.db").write_bytes(b"litter")
    write_result(out, result, record={}, overwrite=True)
    image = load(out / "verdicts" / "0002.png").copy()
    image[0, 0] = (255, 0, 0)
    save(out / "verdicts" / "0002.png", image)
    with pytest.raises(ExistingResultError, match=r"verdicts/0002\.png"):
        write_result(out, result, record={}, overwrite=True)
    assert (load(out / "verdicts" / "0002.png") == image).all()


@pytest.mark.parametrize("name", ["notes.txt", "0099.png", "mine"])
def test_what_somebody_put_beside_the_pictures_is_kept(tmp_path, result, name):
    out = tmp_path / "out"
    write_result(out, result, record={})
    if name == "mine":
        (out / "verdicts" / name).mkdir()
    else:
        (out / "verdicts" / name).write_text("ten years of work")
    with pytest.raises(ExistingResultError, match=f"verdicts/{name}"):
        write_result(out, result, record={}, overwrite=True)
    assert (out / "verdicts" / name).exists()


def test_pictures_without_their_sums_are_kept(tmp_path, result):
    out = tmp_path / "out"
    write_result(out, result, record={})
    (out / "verdicts" / "written.txt").unlink()
    with pytest.raises(ExistingResultError, match=r"verdicts/0001\.png"):
        write_result(out, result, record={}, overwrite=True)


def test_without_verdicts_there_are_none(tmp_path):
    plain = estimate_normals(demo_capture(24)[0], LeastSquares())
    write_result(tmp_path / "out", plain, record={})
    assert not (tmp_path / "out" / "verdicts").exists()
    assert not (tmp_path / "out" / "verdicts.npz").exists()
