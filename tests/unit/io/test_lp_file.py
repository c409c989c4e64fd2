import cv2
import numpy as np
import pytest

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io import Choices, read_capture, read_directions, read_lp, write_lp
from psstereo.normals import estimate_normals

L = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8]])
NAMES = ["a 1.png", "b.png", "c.png", "d.png"]


def picture(path, value):
    cv2.imencode(".png", np.full((3, 4), value, np.uint8))[1].tofile(path)


@pytest.fixture
def folder(tmp_path):
    for i, name in enumerate(NAMES):
        picture(tmp_path / name, int(200 * L[i, 2]))
    write_lp(tmp_path / "x.lp", NAMES, L)
    return tmp_path


def write(path, text):
    path.write_bytes(text.encode("utf-8"))
    return path


def test_comes_back_as_written(tmp_path):
    write_lp(tmp_path / "x.lp", NAMES, L * 3)
    text = (tmp_path / "x.lp").read_bytes()
    assert text.startswith(b"4\na 1.png 0.0000000000 ")
    assert text.endswith(b"\n")
    assert not any(line != line.strip() for line in text.decode().splitlines())
    found = read_lp(tmp_path / "x.lp")
    assert found.names == tuple(NAMES)
    np.testing.assert_allclose(found.vectors, L, atol=1e-10)


def test_takes_what_people_write(tmp_path):
    """Blanks in names and at the ends, tabs, CRLF, a byte-order mark, mixed decimal commas, an empty last line."""
    text = (
        "\ufeff3 \r\n  my photo 1.jpg\t0,577 0.577  0,577 \r\nC:\\été\\b.jpg -1e-3 0 1,0\r\n\r\nc.jpg 0 0.5 .8\r\n\r\n"
    )
    found = read_lp(write(tmp_path / "x.lp", text))
    assert found.names == ("my photo 1.jpg", "C:\\été\\b.jpg", "c.jpg")
    np.testing.assert_allclose(found.vectors, [[0.577, 0.577, 0.577], [-0.001, 0, 1], [0, 0.5, 0.8]])
    assert "decimal commas on 2 lines" in found.notes[0]
    assert "only their directions count" in found.notes[1]


def test_blanks_inside_a_name_are_kept(tmp_path):
    assert read_lp(write(tmp_path / "x.lp", "1\na  b\tc.jpg 0 0 1\n")).names == ("a  b\tc.jpg",)


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        ("3\na.jpg 0 0 1\nb.jpg 0 1 1\n", UnreadableFileError, "says 3 lights on its first line and has 2 lines"),
        ("1\na.jpg 0 0 1\nb.jpg 0 1 1\n", UnreadableFileError, "says 1 lights on its first line and has 2 lines"),
        ("a.jpg 0 0 1\nb.jpg 0 1 1\n", UnreadableFileError, "begins with the number of lights"),
        ("2\na.jpg 0 0 1\nb.jpg 0 1\n", UnreadableFileError, "Line 3 of .*'b.jpg 0 1'"),
        ("2\na.jpg 0 0 1\nb.jpg,0,1,1\n", UnreadableFileError, "Line 3 of"),
        ("2\n\na.jpg 0 0 1\nb.jpg 0 x 1\n", UnreadableFileError, "Line 4 of"),
        ("2\na.jpg 0 0 1\nb.jpg 0 0 0\n", InputError, r"Line 3 of .*\(b\.jpg\).*\[0\.0, 0\.0, 0\.0\]"),
        ("2\na.jpg 0 nan 1\nb.jpg 0 0 1\n", InputError, r"Line 2 of .*\(a\.jpg\)"),
        ("0\n", UnreadableFileError, "no lights"),
        ("  \n", UnreadableFileError, "is blank"),
    ],
)
def test_says_what_is_wrong_and_where(tmp_path, text, kind, said):
    with pytest.raises(kind, match=said):
        read_lp(write(tmp_path / "x.lp", text))


@pytest.mark.parametrize("names", [[" a.png"], ["a.png "], ["a  b.png"], ["a\tb.png"], [""]])
def test_does_not_write_names_that_relight_would_lose(tmp_path, names):
    with pytest.raises(InputError, match="blanks"):
        write_lp(tmp_path / "x.lp", names, L[:1])


def test_does_not_write_zero_vectors_or_wrong_counts(tmp_path):
    with pytest.raises(InputError, match=r"b\.png"):
        write_lp(tmp_path / "x.lp", ["a.png", "b.png"], [[0, 0, 1], [0, 0, 0]])
    with pytest.raises(InputError, match="2 names"):
        write_lp(tmp_path / "x.lp", ["a.png", "b.png"], L)


def test_images_follow_the_names_not_the_order(folder):
    """relight would go by the order; the note says so."""
    write_lp(folder / "x.lp", NAMES[::-1], L[::-1])
    capture, _ = read_capture(folder)
    assert capture.stack.names == tuple(NAMES[::-1])
    assert any("relight, would pair them otherwise" in note for note in capture.notes)
    normals = estimate_normals(capture).normals
    np.testing.assert_allclose(normals[0, 0], [0, 0, 1], atol=0.01)


def test_the_file_itself_may_be_named_and_lists_may_be_several(folder):
    assert len(read_capture(folder / "x.lp")[0].stack) == 4
    write_lp(folder / "y.lp", NAMES[:3], L[:3])
    assert len(read_capture(folder / "y.lp")[0].stack) == 3
    with pytest.raises(InputError, match=r"2 \.lp files: x\.lp, y\.lp"):
        read_capture(folder)


def test_other_case_and_ending_are_found_and_said(folder):
    write(folder / "x.lp", "3\nA 1.PNG 0 0 1\nb.jpg .6 0 .8\nD:\\c.png 0 .6 .8\n")
    capture, _ = read_capture(folder)
    assert capture.stack.names == ("a 1.png", "b.png", "c.png")
    assert sum("letter case" in n or "another ending" in n or "base names" in n for n in capture.notes) == 3


def test_all_missing_images_are_named(folder):
    (folder / "b.png").unlink()
    (folder / "d.png").unlink()
    with pytest.raises(MissingFileError, match=r"b\.png, d\.png"):
        read_capture(folder)


def test_jpeg_is_remarked(folder):
    for i, name in enumerate(NAMES):
        cv2.imencode(".jpg", np.full((3, 4), 50 + i, np.uint8))[1].tofile(folder / name.replace("png", "jpg"))
    write_lp(folder / "x.lp", [name.replace("png", "jpg") for name in NAMES], L)
    assert any("JPEG" in note for note in read_capture(folder)[0].notes)


def test_chosen_lp_goes_by_name_where_it_can(folder, tmp_path):
    write_lp(tmp_path / "z.lp", ["e.png", *NAMES[::-1]], [L[1], *L[::-1]])
    capture, _ = read_capture(folder / "x.lp", choices=Choices(lights=tmp_path / "z.lp"))
    np.testing.assert_allclose(capture.rig.directions, L, atol=1e-9)
    assert any("1 more images" in note for note in capture.notes)
    write_lp(tmp_path / "z.lp", ["1.jpg", "2.jpg", "3.jpg", "4.jpg"], L[::-1])
    capture, _ = read_capture(folder / "x.lp", choices=Choices(lights=tmp_path / "z.lp"))
    np.testing.assert_allclose(capture.rig.directions, L[::-1], atol=1e-9)
    assert any("None of the names" in note for note in capture.notes)
    write_lp(tmp_path / "z.lp", ["a 1.jpg", "2.jpg", "3.jpg", "4.jpg"], L[::-1])
    with pytest.raises(InputError, match=r"does not name b\.png, c\.png, d\.png"):
        read_capture(folder / "x.lp", choices=Choices(lights=tmp_path / "z.lp"))


def test_three_rows_are_no_riddle_in_this_format(tmp_path):
    write_lp(tmp_path / "x.lp", NAMES[:3], L[:3])
    np.testing.assert_allclose(read_directions(tmp_path / "x.lp", 3).vectors, L[:3], atol=1e-9)
