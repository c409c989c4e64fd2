"""One file in its place: whole or not at all, and never over what is of another kind."""

import os
import tempfile
from pathlib import Path

import pytest

from psstereo.errors import ExistingResultError, MissingFileError, UnreadableFileError
from psstereo.io.one_file import begins_with, put_file, require_file_place

OURS = begins_with(b"MINE", b"mine")


def put(path, data=b"MINE 2", *, overwrite=True):
    put_file(path, data, overwrite=overwrite, ours=OURS, kind="file of mine")


def test_a_file_is_written_with_the_rights_that_the_umask_gives(tmp_path):
    put(tmp_path / "a", overwrite=False)
    assert (tmp_path / "a").read_bytes() == b"MINE 2"
    mask = os.umask(0)
    os.umask(mask)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o666 & ~mask
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_only_its_own_kind_is_replaced_and_only_if_asked(tmp_path):
    (tmp_path / "a").write_bytes(b"mine 1")
    with pytest.raises(ExistingResultError, match="is there already") as caught:
        put(tmp_path / "a", overwrite=False)
    assert "--overwrite" in caught.value.remedy
    put(tmp_path / "a")
    assert (tmp_path / "a").read_bytes() == b"MINE 2"
    (tmp_path / "b").write_bytes(b"yours")
    with pytest.raises(ExistingResultError, match="is no file of mine") as caught:
        put(tmp_path / "b")
    assert "--overwrite" not in caught.value.remedy
    (tmp_path / "folder").mkdir()
    with pytest.raises(ExistingResultError, match="as a folder"):
        put(tmp_path / "folder")
    with pytest.raises(MissingFileError, match="does not exist"):
        require_file_place(tmp_path / "none" / "a", overwrite=True, ours=OURS, kind="file of mine")
    assert (tmp_path / "b").read_bytes() == b"yours"


def test_a_folder_that_cannot_be_written_to_is_named(tmp_path, monkeypatch):
    def refuse(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(tempfile, "mkstemp", refuse)
    with pytest.raises(UnreadableFileError, match="Permission denied"):
        put(tmp_path / "a")


def test_what_goes_wrong_leaves_the_earlier_file_and_no_litter(tmp_path, monkeypatch):
    (tmp_path / "a").write_bytes(b"MINE 1")

    def fail(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(KeyboardInterrupt):
        put(tmp_path / "a")
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    assert (tmp_path / "a").read_bytes() == b"MINE 1"
