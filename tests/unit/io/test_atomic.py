"""Folders that appear whole or not at all, and what is never replaced."""

import os
import sys
from pathlib import Path

import pytest

from psstereo.errors import ExistingResultError, MissingFileError, UnreadableFileError
from psstereo.io import atomic
from psstereo.io.atomic import RECORD, new_folder, require_free


def make_result(folder: Path, text: str = "{}") -> Path:
    folder.mkdir(parents=True)
    (folder / RECORD).write_text(text)
    (folder / "normals.npy").write_text(text)
    return folder


def everything(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"" for p in sorted(folder.rglob("*"))}


def test_a_folder_appears_at_the_end_and_whole(tmp_path):
    target = tmp_path / "a" / "b"
    with new_folder(target) as work:
        assert work.parent == target.parent
        (work / "x").write_text("1")
        assert not target.exists()
    assert everything(tmp_path) == {"a": b"", "a/b": b"", "a/b/x": b"1"}


def write_half(target: Path, error: type[BaseException]) -> None:
    with new_folder(target, overwrite=True) as work:
        (work / "half").write_text("1")
        raise error


def write_new(target: Path, before_the_exchange) -> None:
    with new_folder(target, overwrite=True) as work:
        (work / RECORD).write_text("new")
        before_the_exchange()


@pytest.mark.parametrize("error", [ValueError, OSError, KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("earlier", [False, True])
def test_whatever_goes_wrong_leaves_all_as_it_was(tmp_path, error, earlier):
    target = tmp_path / "out"
    if earlier:
        make_result(target, "old")
    before = everything(tmp_path)
    with pytest.raises(error):
        write_half(target, error)
    assert everything(tmp_path) == before


def test_an_earlier_result_stays_until_the_new_one_is_complete(tmp_path):
    target = make_result(tmp_path / "out", "old")
    with new_folder(target, overwrite=True) as work:
        (work / RECORD).write_text("new")
        assert (target / RECORD).read_text() == "old"
    assert everything(tmp_path) == {"out": b"", f"out/{RECORD}": b"new"}


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("which", [1, 2])
def test_trouble_between_the_two_renames_gives_the_earlier_result_back(tmp_path, monkeypatch, error, which):
    target = make_result(tmp_path / "out", "old")
    before = everything(tmp_path)
    whole, calls = Path.rename, []

    def rename(self, other):
        calls.append(self)
        if len(calls) == which:
            raise error
        return whole(self, other)

    with pytest.raises(error):
        write_new(target, lambda: monkeypatch.setattr(Path, "rename", rename))
    monkeypatch.undo()
    assert len(calls) == which + (which == 2)
    assert everything(tmp_path) == before


def test_if_nothing_can_be_put_back_the_earlier_result_is_still_somewhere(tmp_path, monkeypatch):
    target = make_result(tmp_path / "out", "old")
    whole, calls = Path.rename, []

    def rename(self, other):
        calls.append(self)
        if len(calls) > 1:
            raise OSError
        return whole(self, other)

    with pytest.raises(OSError), new_folder(target, overwrite=True):  # noqa: PT011
        monkeypatch.setattr(Path, "rename", rename)
    monkeypatch.undo()
    assert [p.read_text() for p in tmp_path.rglob(RECORD)] == ["old"]


@pytest.mark.parametrize("name", ["nothing", "empty"])
def test_new_and_empty_places_are_free(tmp_path, name):
    (tmp_path / "empty").mkdir()
    require_free(tmp_path / name, overwrite=False)
    with new_folder(tmp_path / name) as work:
        (work / "x").write_text("1")
    assert (tmp_path / name / "x").is_file()


def test_an_earlier_result_wants_a_word(tmp_path):
    target = make_result(tmp_path / "out")
    with pytest.raises(ExistingResultError, match="--overwrite"):
        require_free(target, overwrite=False)
    require_free(target, overwrite=True)


@pytest.mark.parametrize("name", [".DS_Store", "Thumbs.db", "report.html", "mesh.glb", "depth.png"])
def test_what_a_result_or_a_file_manager_writes_may_go(tmp_path, name):
    target = make_result(tmp_path / "out")
    (target / name).write_text("")
    require_free(target, overwrite=True)


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("name", ["notes.txt", "normals of mine.npy", "photo.png", ".git", "depth"])
def test_anything_else_in_a_result_is_kept(tmp_path, overwrite, name):
    target = make_result(tmp_path / "out")
    if "." in name.strip("."):
        (target / name).write_text("mine")
    else:
        (target / name).mkdir()
    with pytest.raises(ExistingResultError, match=name.replace(".", r"\.")):
        require_free(target, overwrite=overwrite)


@pytest.mark.parametrize("overwrite", [False, True])
def test_other_folders_and_files_are_refused(tmp_path, overwrite):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "x").write_text("mine")
    (tmp_path / "file").write_text("mine")
    for place in ("folder", "file"):
        with pytest.raises(ExistingResultError, match="no result"), new_folder(tmp_path / place, overwrite=overwrite):
            pytest.fail("it was entered")
    with pytest.raises(MissingFileError, match="is a file"):
        require_free(tmp_path / "file" / "a" / "b", overwrite=overwrite)
    assert everything(tmp_path) == {"file": b"mine", "folder": b"", "folder/x": b"mine"}


def test_a_name_with_dots_means_the_folder_itself(tmp_path, monkeypatch):
    make_result(tmp_path / "out", "old")
    (tmp_path / "out" / "mesh").mkdir()
    (tmp_path / "out" / "mesh").rmdir()
    (tmp_path / "other").mkdir()
    monkeypatch.chdir(tmp_path / "other")
    with new_folder(Path("../other/../out"), overwrite=True) as work:
        assert work.parent == tmp_path.resolve()
        (work / RECORD).write_text("new")
    assert (tmp_path / "out" / RECORD).read_text() == "new"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["other", "out"]


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights on Windows")
def test_a_link_stays_a_link(tmp_path):
    make_result(tmp_path / "real", "old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with new_folder(tmp_path / "link", overwrite=True) as work:
        (work / RECORD).write_text("new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / RECORD).read_text() == "new"


@pytest.mark.skipif(os.name != "posix", reason="rights of this kind are POSIX's")
@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_rights_are_those_of_any_new_folder(tmp_path, mask):
    before = os.umask(mask)
    try:
        with new_folder(tmp_path / "out"):
            pass
    finally:
        os.umask(before)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o777 & ~mask


def test_where_nothing_can_be_written_is_told(tmp_path, monkeypatch):
    def refuse(**_words):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(atomic.tempfile, "mkdtemp", refuse)
    with pytest.raises(UnreadableFileError, match="Permission denied"), new_folder(tmp_path / "out"):
        pytest.fail("it was entered")


NAMES = {"a.txt", "sub/b.txt"}


def make_capture(folder: Path, text: str = "old") -> Path:
    (folder / "sub").mkdir(parents=True)
    (folder / "a.txt").write_text(text)
    (folder / "sub" / "b.txt").write_text(text)
    return folder


def test_a_capture_of_the_same_files_is_replaced_if_asked_for(tmp_path):
    target = make_capture(tmp_path / "out")
    with pytest.raises(ExistingResultError, match="earlier run wrote"):
        require_free(target, overwrite=False, names=NAMES)
    (target / "sub" / "Thumbs.db").write_text("")
    with new_folder(target, overwrite=True, names=NAMES) as work:
        make_capture(work / "x")
        (work / "x" / "a.txt").rename(work / "a.txt")
        (work / "x" / "sub").rename(work / "sub")
        (work / "x").rmdir()
    assert everything(target) == {"a.txt": b"old", "sub": b"", "sub/b.txt": b"old"}


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_capture_with_more_or_less_is_kept(tmp_path, overwrite):
    def refused(match):
        before = everything(tmp_path)
        with pytest.raises(ExistingResultError, match=match):
            require_free(tmp_path / "out", overwrite=overwrite, names=NAMES)
        assert everything(tmp_path) == before

    target = make_capture(tmp_path / "out")
    (target / "sub" / "mine.txt").write_text("mine")
    refused(r"sub/mine\.txt")
    (target / "sub" / "mine.txt").unlink()
    (target / "a.txt").unlink()
    refused(r"does not hold a\.txt")
    (target / "a.txt").mkdir()
    refused(r"holds a\.txt")
    (target / "a.txt").rmdir()
    (target / "a.txt").write_text("")
    (target / "sub" / ".DS_Store").mkdir()
    refused("DS_Store")
    make_result(tmp_path / "result")
    with pytest.raises(ExistingResultError):
        require_free(tmp_path / "result", overwrite=overwrite, names=NAMES)
    with pytest.raises(ExistingResultError):
        require_free(target, overwrite=overwrite)
