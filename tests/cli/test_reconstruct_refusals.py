"""``psstereo reconstruct``: input that cannot be used, and places where no result can go."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from psstereo.io import read_capture
from tests.cli.capture_files import assert_one_message, everything
from tests.cli.spoilt_captures import BAD, corrupt_image


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_told_once_and_leaves_nothing(run, folder, tmp_path, case):
    spoil, words = BAD[case]
    spoil(folder)
    before = everything(tmp_path)
    assert_one_message(run("reconstruct", folder, "-o", tmp_path / "out"), words)
    assert everything(tmp_path) == before


@pytest.mark.parametrize("case", BAD)
def test_an_earlier_result_survives_bad_input(run, folder, tmp_path, plain, case):
    BAD[case][0](folder)
    before = everything(tmp_path)
    assert_one_message(run("reconstruct", folder, "-o", plain, "--overwrite"))
    assert everything(tmp_path) == before


@pytest.mark.parametrize("case", ["two lights", "corrupt image", "no folder"])
def test_machines_are_told_too(run, folder, tmp_path, case):
    BAD[case][0](folder)
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--json")
    assert done.code == 3
    error = done.record["error"]
    assert set(error) == {"kind", "given", "needed", "remedy"}
    assert done.err.endswith(f"psstereo: {error['given']}\n  {error['needed']}\n  {error['remedy']}\n")


def test_bad_input_is_told_on_many_threads_and_in_tiles(run, folder, tmp_path):
    corrupt_image(folder)
    before = everything(tmp_path)
    for options in (("--threads", "4"), ("--max-memory", "9MB"), ("--mask", "auto")):
        assert_one_message(run("reconstruct", folder, "-o", tmp_path / "out", *options), ("003.png",))
    assert everything(tmp_path) == before


# --- places where no result can go ------------------------------------------------------------------------------------


@pytest.mark.parametrize("overwrite", [(), ("--overwrite",)])
@pytest.mark.parametrize(
    "place", ["notes", "photos with run.json", "result with more in it", "capture", "file", "in a file"]
)
def test_what_is_no_result_is_never_replaced(run, folder, tmp_path, plain, overwrite, place):  # noqa: PLR0917
    out = tmp_path / "precious"
    if place == "notes":
        out.mkdir()
        (out / "notes.txt").write_text("ten years of work")
    elif place == "photos with run.json":
        out.mkdir()
        (out / "run.json").write_text("{}")
        (out / "model.bin").write_bytes(b"ten years of work")
    elif place == "result with more in it":
        shutil.copytree(plain, out)
        (out / "thesis").mkdir()
        (out / "thesis" / "chapter 1.txt").write_text("ten years of work")
    elif place == "capture":
        out = folder
    else:
        out.write_text("ten years of work")
        out = out / "below" / "out" if place == "in a file" else out
    before = everything(tmp_path)
    assert_one_message(
        run("reconstruct", folder, "-o", out, *overwrite), ("-o", "precious" if out != folder else "capture")
    )
    assert everything(tmp_path) == before


def test_a_place_that_cannot_be_written_to(run, folder, tmp_path, monkeypatch):
    from psstereo.io import atomic

    def refuse(**_keywords):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(atomic.tempfile, "mkdtemp", refuse)
    done = run("reconstruct", folder, "-o", tmp_path / "out")
    assert_one_message(done, (str(tmp_path), "Permission denied", "-o"))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_disk_that_is_full_leaves_nothing_and_takes_nothing(run, folder, tmp_path, monkeypatch, plain, overwrite):  # noqa: PLR0917
    from psstereo.io import result_folder

    def full(*_arguments, **_words):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(result_folder, "write_mesh", full)
    before = everything(tmp_path)
    out, more = (plain, ("--overwrite",)) if overwrite else (tmp_path / "out", ())
    assert_one_message(run("reconstruct", folder, "-o", out, *more), ("No space left on device",))
    assert everything(tmp_path) == before


def test_the_photographs_stay_as_they_are(run, folder, tmp_path):
    before = everything(folder)
    assert run("reconstruct", folder, "-o", tmp_path / "out").code == 0
    assert run("reconstruct", folder, "-o", folder / "out").code == 0
    after = {k: v for k, v in everything(folder).items() if not k.startswith("out")}
    assert after == before


def test_options_of_the_library_default_to_those_of_the_command(folder, tmp_path, plain):
    from psstereo.pipeline import reconstruct

    capture, _ = read_capture(folder)
    result = reconstruct(capture)
    assert np.array_equal(np.load(plain / "normals.npy"), result.normals.normals.astype(np.float32), equal_nan=True)
    assert result.depth is not None
    assert np.array_equal(np.load(plain / "depth.npy"), result.depth.depth.astype(np.float32), equal_nan=True)
    assert replace(result, depth=None).converged
