import unicodedata

import pytest

from psstereo.errors import InputError, MissingFileError
from psstereo.io.image_names import base_name, match_files


def touch(folder, *names):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_bytes(b"x")


@pytest.mark.parametrize(
    ("listed", "on_disk", "said"),
    [
        ("a.png", "a.png", None),
        (r"C:\photos 1\Séance\a.png", "a.png", "base names"),
        ("/photos/me/a.png", "a.png", "base names"),
        ("./a.png", "a.png", None),
        ("A.PNG", "a.png", "letter case"),
        ("my  photo.png", "my photo.png", "letter case or blanks"),
        ("a.tif", "a.jpg", "another ending"),
        (unicodedata.normalize("NFD", "été.png"), "été.png", "letter case"),
    ],
)
def test_finds_the_file_and_says_how(tmp_path, listed, on_disk, said):
    touch(tmp_path, on_disk)
    found = match_files(tmp_path, [listed], "list.txt")
    assert found.paths == (tmp_path / on_disk,)
    assert found.notes == () if said is None else said in found.notes[0]


def test_looks_in_the_folder_that_the_name_says(tmp_path):
    """RTIBuilder keeps the list in assembly-files and the pictures in jpeg-exports."""
    touch(tmp_path / "jpeg-exports", "a.jpg")
    touch(tmp_path / "assembly-files")
    found = match_files(tmp_path / "assembly-files", [r"D:\coin\jpeg-exports\a.jpg"], "coin.lp")
    assert found.paths == (tmp_path / "jpeg-exports" / "a.jpg",)


def test_names_all_missing_files_at_once(tmp_path):
    touch(tmp_path, "b.png")
    with pytest.raises(MissingFileError, match=r"lists 4 images, of which 3 are not there: a\.png, c\.png, d\.png"):
        match_files(tmp_path, ["a.png", "b.png", "c.png", r"x\d.png"], "list.txt")


def test_refuses_a_name_that_fits_two_files(tmp_path):
    touch(tmp_path, "a.png", "a.tif")
    with pytest.raises(InputError, match=r"a\.jpg in list\.txt fits a\.png, a\.tif"):
        match_files(tmp_path, ["a.jpg"], "list.txt")


def test_refuses_two_names_for_one_file(tmp_path):
    touch(tmp_path, "a.png", "b.png")
    with pytest.raises(InputError, match="Rows 1 and 3"):
        match_files(tmp_path, ["a.png", "b.png", "A.png"], "list.txt")


def test_base_name_takes_both_kinds_of_slash():
    assert base_name("a/b\\c d.png ") == "c d.png"
