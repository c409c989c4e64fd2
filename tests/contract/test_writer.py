"""What every writer of captures promises: what is written comes back, whole or not at all."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from psstereo.capture import Truth
from psstereo.errors import (
    ExistingResultError,
    InputError,
    PsstereoError,
)
from psstereo.io import WRITERS, read_capture, recognise, write_capture
from psstereo.stack import MemoryStack
from tests.contract.written_captures import (
    COLOURED,
    COUNT,
    HOLDS,
    READER_OF,
    Failing,
    assert_same_rig,
    assert_same_values,
    changed,
    every_writer,
    everything,
    sample,
)


@every_writer
def test_has_a_name_and_a_summary(name):
    assert WRITERS[name].name == name
    assert WRITERS[name].summary


@every_writer
@pytest.mark.parametrize("coloured", [True, False])
@pytest.mark.parametrize(("bits", "white"), [(16, None), (8, None), (16, 1023), (16, 4095), (16, 16383)])
def test_comes_back_as_it_was(name, coloured, bits, white, tmp_path):
    wanted, truth = sample(name, bits=bits, coloured=coloured, white=white)
    lost = write_capture(wanted, tmp_path / "Éte 1", name, truth=truth)
    assert recognise(tmp_path / "Éte 1")[0].format == READER_OF.get(name, name)
    got, found = read_capture(tmp_path / "Éte 1")
    assert_same_values(got.stack, wanted.stack)
    assert got.stack.shape[3] == (3 if coloured or name in COLOURED else 1)
    assert_same_rig(got.rig, wanted.rig, relative=name == "lp")
    np.testing.assert_array_equal(got.mask, wanted.mask)
    assert got.camera == wanted.camera
    assert got.dark is None
    inside = wanted.mask
    parts = HOLDS[name]
    assert (found is None) == (not parts)
    for part in ("normals", "depth", "albedo", "visibility"):
        value = getattr(found, part, None)
        assert (value is not None) == (part in parts)
    if "normals" in parts:
        exact = name in ("capture", "diligent")
        atol = 4e-16 if exact else np.sqrt(3) / 2 / 32767.5
        np.testing.assert_allclose(found.normals[inside], truth.normals[inside], rtol=0, atol=atol)
    if "depth" in parts:
        np.testing.assert_array_equal(found.depth, truth.depth)
    if "albedo" in parts:
        np.testing.assert_array_equal(found.albedo, truth.albedo)
        assert found.albedo.dtype == truth.albedo.dtype
    if "visibility" in parts:
        np.testing.assert_array_equal(found.visibility, truth.visibility.astype(np.float32))
    said = " ".join(lost)
    for part in {"normals", "depth", "albedo", "visibility"} - parts:
        assert part in said
    assert (said == "") == (name == "capture")
    if name == "capture":
        assert got.name == wanted.name
        assert got.radiance_at_white == wanted.radiance_at_white
        assert got.rig.strength_unit is wanted.rig.strength_unit
        assert (got.stack.dtype, got.stack.white) == (wanted.stack.dtype, wanted.stack.white)
        assert got.stack.read().tobytes() == wanted.stack.read().tobytes()


@every_writer
def test_writes_the_files_that_it_announces_and_ends_its_lines(name, tmp_path):
    capture, truth = sample(name)
    told = []
    write_capture(capture, tmp_path / "x", name, truth=truth, progress=lambda *words: told.append(words))
    files = everything(tmp_path / "x")
    assert set(files) == WRITERS[name].file_names(capture, truth)
    for file, data in files.items():
        if Path(file).suffix in (".txt", ".toml", ".json", ".lp"):
            assert data.endswith(b"\n")
            assert not data.endswith(b"\n\n")
            assert b"\r" not in data
            assert not any(line != line.rstrip() for line in data.decode().split("\n"))
    assert told == [("writing images", i + 1, COUNT) for i in range(COUNT)]


@every_writer
def test_any_number_of_threads_gives_the_same_bytes(name, tmp_path):
    capture, truth = sample(name, count=23)
    write_capture(capture, tmp_path / "one", name, truth=truth)
    with ThreadPoolExecutor(4) as pool:
        write_capture(capture, tmp_path / "four", name, truth=truth, over=pool.map)
    assert everything(tmp_path / "one") == everything(tmp_path / "four")


@every_writer
def test_without_a_mask_and_with_little_truth(name, tmp_path):
    capture, truth = sample(name)
    capture = changed(capture, mask=None)
    write_capture(capture, tmp_path / "x", name, truth=Truth(depth=truth.depth) if name == "luces" else None)
    got, found = read_capture(tmp_path / "x")
    assert got.effective_mask.all()
    assert (found is None) == (name != "luces")
    assert_same_values(got.stack, capture.stack)


@every_writer
@pytest.mark.parametrize("threads", [0, 3])
def test_a_failing_image_leaves_nothing_behind(name, threads, tmp_path):
    capture, truth = sample(name)
    broken = changed(capture, stack=Failing(capture.stack, 4))
    with ThreadPoolExecutor(max(threads, 1)) as pool, pytest.raises(RuntimeError, match="the lamp broke"):
        write_capture(broken, tmp_path / "a" / "x", name, truth=truth, over=pool.map if threads else map)
    assert [p for p in tmp_path.rglob("*") if p != tmp_path / "a"] == []


@every_writer
def test_each_image_is_asked_for_once(name, tmp_path):
    capture, truth = sample(name)
    stack = Failing(capture.stack, None)
    write_capture(changed(capture, stack=stack), tmp_path / "x", name, truth=truth)
    assert sorted(stack.asked) == list(range(COUNT))


@every_writer
def test_an_interruption_leaves_nothing_behind(name, tmp_path):
    capture, truth = sample(name)

    def interrupt(_stage, done, _total):
        if done == 2:
            raise KeyboardInterrupt

    with ThreadPoolExecutor(3) as pool, pytest.raises(KeyboardInterrupt):
        write_capture(capture, tmp_path / "x", name, truth=truth, over=pool.map, progress=interrupt)
    assert list(tmp_path.iterdir()) == []


@every_writer
def test_an_image_unlike_its_promise_is_refused(name, tmp_path):
    capture, truth = sample(name)

    class Odd(Failing):
        def frame(self, index):
            image = super().frame(index)
            return image[:-1] if index == 3 else image

    with pytest.raises(InputError, match=r"image 4 has the shape"):
        write_capture(changed(capture, stack=Odd(capture.stack, None)), tmp_path / "x", name, truth=truth)
    assert list(tmp_path.iterdir()) == []


@every_writer
def test_replaces_only_a_folder_of_the_same_files_and_only_if_asked(name, tmp_path):
    capture, truth = sample(name)
    target = tmp_path / "x"
    target.mkdir()
    write_capture(capture, target, name, truth=truth)
    first = everything(target)
    with pytest.raises(ExistingResultError, match="earlier run wrote"):
        write_capture(capture, target, name, truth=truth)
    assert everything(target) == first
    again = changed(capture, stack=MemoryStack(capture.stack.read()[::-1]))
    (target / ".DS_Store").write_text("")
    write_capture(again, target, name, truth=truth, overwrite=True)
    second = everything(target)
    assert set(second) == set(first)
    assert second != first
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


@every_writer
@pytest.mark.parametrize("overwrite", [False, True])
def test_never_replaces_what_is_not_its_own(name, overwrite, tmp_path):
    capture, truth = sample(name)
    target = tmp_path / "x"

    def refused(match):
        before = everything(tmp_path)
        with pytest.raises(PsstereoError, match=match):
            write_capture(capture, target, name, truth=truth, overwrite=overwrite)
        assert everything(tmp_path) == before

    write_capture(capture, target, name, truth=truth)
    (target / "notes of mine.txt").write_text("mine")
    refused("notes of mine")
    (target / "notes of mine.txt").unlink()
    (target / "mine").mkdir()
    refused("holds mine,")
    (target / "mine").rmdir()
    last = sorted(everything(target))[-1]
    (target / last).rename(tmp_path / "moved")
    refused("does not hold")
    (tmp_path / "moved").replace(target / last)
    fewer = sample(name, count=COUNT - 1)
    with pytest.raises(ExistingResultError):
        write_capture(fewer[0], target, name, truth=fewer[1], overwrite=overwrite)
    target = tmp_path / "moved"
    target.write_text("mine")
    refused("is a file")
    target = tmp_path / "moved" / "y"
    refused("is a file")


def test_a_link_in_the_folder_is_not_ours(tmp_path):
    capture, truth = sample("capture")
    write_capture(capture, tmp_path / "x", truth=truth)
    (tmp_path / "x" / "truth").rename(tmp_path / "elsewhere")
    (tmp_path / "x" / "truth").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ExistingResultError, match="truth"):
        write_capture(capture, tmp_path / "x", truth=truth, overwrite=True)
    assert (tmp_path / "elsewhere" / "normals.npy").is_file()
