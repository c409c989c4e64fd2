"""``psstereo reconstruct``: what its options do, and names that nobody knows."""

import shutil

import numpy as np
import pytest

from psstereo.flags import Flag
from psstereo.metrics import angular_error
from psstereo.verdict import Verdict
from tests.cli.capture_files import (
    ARRAYS,
    PICTURES,
    TIMED,
    assert_one_message,
    everything,
    keep_images,
    lights_of,
    read_png,
    record_of,
    results,
    save_png,
    write_lights,
)


@pytest.mark.parametrize(
    ("options", "fact", "value"),
    [
        (("--gray", "bt601"), "gray", "bt601"),
        (("--gray", "r"), "gray", "r"),
        (("--gray", "0.5,0.25,0.25"), "gray", "0.5,0.25,0.25"),
        (("--clip", "0.2"), "clip", 0.2),
        (("--gate", "none"), "gate", "none"),
        (("--gate", "shadow"), "gate", "shadow"),
        (("--gate", "saturation"), "gate", "saturation"),
        (("--valid-range", "0.1,0.9"), "valid_range", [0.1, 0.9]),
    ],
)
def test_an_option_changes_the_normals_and_the_record(run, folder, tmp_path, plain, options, fact, value):  # noqa: PLR0917
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--json", *options)
    assert done.code == 0
    assert done.record["normals"][fact] == (pytest.approx(value) if isinstance(value, list) else value)
    assert (tmp_path / "out" / "normals.npy").read_bytes() != (plain / "normals.npy").read_bytes()


def test_gates_decide_which_observations_count(run, folder, tmp_path):
    counted = {}
    for gate in ("none", "shadow", "saturation", "auto"):
        flags = run("reconstruct", folder, "-o", tmp_path / gate, "--gate", gate, "--normals-only", "--json").record
        flags = flags["normals"]["flags"]
        counted[gate] = (flags.get("SHADOWED", 0) > 0, flags.get("UNUSABLE_SAMPLE", 0) > 0)
    assert counted == {
        "none": (False, False),
        "shadow": (True, False),
        "saturation": (False, True),
        "auto": (True, True),
    }


def test_values_beyond_the_valid_range_are_left_out(run, folder, tmp_path):
    out = tmp_path / "out"
    run("reconstruct", folder, "-o", out, "--gate", "none", "--valid-range", "0.2,0.6", "--normals-only")
    images = np.stack([read_png(p) for p in sorted(folder.glob("0*.png"))]) / 65535.0
    mask = read_png(folder / "mask.png") > 0
    beyond = ((images <= 0.2) | (images >= 0.6)).any(axis=(0, 3))
    flags = np.load(out / "flags.npy")
    assert np.array_equal((flags & Flag.UNUSABLE_SAMPLE) > 0, beyond & mask)
    left = ((images > 0.2) & (images < 0.6)).all(axis=3).sum(axis=0)
    assert np.array_equal((flags & Flag.TOO_FEW_LIGHTS) > 0, (left < 3) & mask)


def test_per_channel_gives_coloured_albedo(run, folder, tmp_path, plain):
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--gray", "per-channel", "--json")
    albedo = np.load(tmp_path / "out" / "albedo.npy")
    assert albedo.shape == (40, 48, 3)
    assert albedo.dtype == np.float32
    assert done.record["normals"]["gray"] == "per-channel"
    ratio = np.nanmedian(albedo / albedo[..., :1], axis=(0, 1))
    assert np.allclose(ratio, [1.0, 0.85, 0.7], atol=0.01)  # the tint of the painted hills
    assert read_png(tmp_path / "out" / "albedo.png").shape == (40, 48, 3)
    difference = np.degrees(angular_error(np.load(tmp_path / "out" / "normals.npy"), np.load(plain / "normals.npy")))
    assert np.nanmedian(difference) < 1


def test_masks_of_all_kinds(run, folder, tmp_path):
    mask = read_png(folder / "mask.png") > 0
    small = np.zeros_like(mask)
    small[15:25, 20:30] = True
    save_png(tmp_path / "small.png", small.astype(np.uint8) * 255)
    pixels = {}
    for choice in (None, "none", "auto", tmp_path / "small.png"):
        out = tmp_path / f"out{len(pixels)}"
        words = () if choice is None else ("--mask", choice)
        done = run("reconstruct", folder, "-o", out, "--normals-only", "--json", *words)
        assert done.code == 0
        inside = (np.load(out / "flags.npy") & Flag.OUTSIDE_MASK) == 0
        assert done.record["normals"]["pixels"] == inside.sum()
        pixels[str(choice)] = inside, done.record["capture"]["notes"]
    assert np.array_equal(pixels["None"][0], mask)
    assert pixels["none"][0].all()
    assert np.array_equal(pixels[str(tmp_path / "small.png")][0], small)
    found, notes = pixels["auto"]
    assert (found & mask).sum() / mask.sum() > 0.97
    assert (found & ~mask).sum() == 0
    assert any("found from brightness" in note for note in notes)


def test_other_lights_replace_the_folders_own(run, folder, tmp_path, plain):
    turned = lights_of(folder) * [-1, -1, 1]  # the same rig seen upside down
    write_lights(tmp_path, turned, "turned.txt")
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--lights", tmp_path / "turned.txt", "--json")
    assert done.record["normals"]["light_source"] == "turned.txt"
    assert done.record["capture"]["lights"] == "turned.txt"
    normals = np.load(tmp_path / "out" / "normals.npy")
    expected = np.load(plain / "normals.npy") * np.array([-1, -1, 1], np.float32)
    assert np.nanmax(angular_error(normals, expected)) < 1e-4
    np.save(tmp_path / "turned.npy", turned.T)
    again = run("reconstruct", folder, "-o", tmp_path / "again", "--lights", tmp_path / "turned.npy")
    assert again.code == 0
    assert (tmp_path / "again" / "normals.npy").read_bytes() == (tmp_path / "out" / "normals.npy").read_bytes()


def test_bare_images_with_lights_of_elsewhere(run, folder, tmp_path, plain):
    (tmp_path / "elsewhere.txt").write_bytes((folder / "light_directions.txt").read_bytes())
    for name in ("light_directions.txt", "light_intensities.txt", "filenames.txt", "Normal_gt.mat", "depth_gt.npz"):
        (folder / name).unlink()
    assert run("reconstruct", folder, "-o", tmp_path / "out").code == 3
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--lights", tmp_path / "elsewhere.txt")
    assert done.code == 0


def test_format_forces_a_reader(run, folder, tmp_path):
    rows = "\n".join(f"{i + 1:03d}.png " + " ".join(map(str, v)) for i, v in enumerate(lights_of(folder)))
    (folder / "lights.lp").write_text(f"8\n{rows}\n")
    normal = run("reconstruct", folder, "-o", tmp_path / "a", "--normals-only", "--json")
    forced = run("reconstruct", folder, "-o", tmp_path / "b", "--normals-only", "--json", "--format", "lp")
    assert normal.record["normals"]["light_source"] == "light_directions.txt"
    assert forced.record["normals"]["light_source"] == "lights.lp"


def test_three_times_three_lights_need_a_word(run, folder, tmp_path):
    keep_images(folder, 3)
    refused = run("reconstruct", folder, "-o", tmp_path / "out")
    assert refused.code == 3
    assert "--lights-layout" in refused.err
    rows = run("reconstruct", folder, "-o", tmp_path / "rows", "--lights-layout", "rows")
    assert rows.code == 0
    write_lights(folder, lights_of(folder).T)
    columns = run("reconstruct", folder, "-o", tmp_path / "columns", "--lights-layout", "columns")
    assert columns.code == 0
    assert results(tmp_path / "rows") == results(tmp_path / "columns")
    mixed = run("reconstruct", folder, "-o", tmp_path / "mixed", "--lights-layout", "rows")
    assert mixed.code == 3 or results(tmp_path / "mixed") != results(tmp_path / "rows")


def test_names_with_blanks_and_accents(run, folder, tmp_path, plain):
    moved = folder.rename(tmp_path / "Ein schöner Käfer (2)")
    out = tmp_path / "Ergebnis für Ä"
    assert run("reconstruct", moved, "-o", out).code == 0
    assert results(out) == results(plain)


def test_a_written_result_may_be_linked_to(run, folder, tmp_path):
    real = tmp_path / "elsewhere" / "real"
    assert run("reconstruct", folder, "-o", real).code == 0
    link = tmp_path / "link"
    try:
        link.symlink_to(real, target_is_directory=True)
    except OSError:
        pytest.skip("this system makes no links")
    assert run("reconstruct", folder, "-o", link, "--overwrite", "--gate", "none").code == 0
    assert link.is_symlink()
    assert record_of(real)["normals"]["gate"] == "none"


def test_overwriting_replaces_the_whole_result(run, folder, tmp_path, plain):
    out = tmp_path / "out"
    shutil.copytree(plain, out)
    refused = run("reconstruct", folder, "-o", out, "--normals-only")
    assert refused.code == 3
    assert "--overwrite" in refused.err
    assert everything(out) == everything(plain)
    assert run("reconstruct", folder, "-o", out, "--normals-only", "--overwrite").code == 0
    assert {p.name for p in out.iterdir()} == ARRAYS | PICTURES | TIMED  # no depth of the earlier run stays
    assert run("reconstruct", folder, "-o", out, "--overwrite").code == 0
    assert results(out) == results(plain)


def test_an_empty_folder_may_be_filled(run, folder, tmp_path):
    (tmp_path / "out").mkdir()
    assert run("reconstruct", folder, "-o", tmp_path / "out").code == 0
    assert (tmp_path / "out" / "run.json").is_file()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--solver", "least-sqares"), ("least-sqares", "Did you mean least-squares?")),
        (("--integrator", "poison"), ("poison", "Did you mean poisson?")),
        (("--integrator", "poison", "--normals-only"), ("poison", "Did you mean poisson?")),
        (("--gate", "shadw"), ("shadw", "none, shadow, saturation, auto", "Did you mean shadow?")),
        (("--gray", "bt602"), ("bt602", "mean, bt601, bt709, r, g, b, chroma", "Did you mean bt601?")),
        (("--gray", "1,2"), ("1.0, 2.0", "3 channels")),
        (("--gray", "1,x,2"), ("1,x,2",)),
        (("--gray", "0,0,0"), ("not all zero",)),
        (("--format", "dilignt"), ("dilignt", "capture, ", "Did you mean diligent?")),
        (("--lights-layout", "row"), ("row", "rows (one light a row) or columns")),
        (("--lights", "no such file.txt"), ("no such file.txt",)),
        (("--mask", "no such mask.png"), ("no such mask.png",)),
        (("--clip", "0"), ("clip is 0", "above zero")),
        (("--clip", "nan"), ("clip is nan", "above zero")),
        (("--valid-range", "0.9,0.1"), ("0.9 to 0.1", "below")),
        (("--valid-range", "nan,1"), ("nan",)),
        (("--valid-range", "0.1"), ("0.1", "2 numbers")),
        (("--max-memory", "plenty"), ("plenty", "500MB")),
        (("--max-memory", "-3MB"), ("-3MB", "500MB")),
        (("--max-memory", "1kB"), ("memory limit", "MB even in tiles")),
    ],
)
def test_unknown_words_are_told_with_the_known_ones(run, folder, tmp_path, options, words):
    before = everything(tmp_path)
    done = run("reconstruct", folder, "-o", tmp_path / "out", *options)
    assert_one_message(done, words)
    assert everything(tmp_path) == before


# --- solvers and their options ----------------------------------------------------------------------------------------


def test_options_of_a_solver_reach_it_and_the_record(run, folder, tmp_path, plain):
    words = ("--solver", "least-squares", "--normals-only", "--json")
    by_gate = run("reconstruct", folder, "-o", tmp_path / "a", *words, "--gate", "none")
    by_option = run("reconstruct", folder, "-o", tmp_path / "b", *words, "--option", "gate=none")
    for done in (by_gate, by_option):
        assert done.code == 0
        assert done.record["normals"]["options"] == {"gate": "none"}
    assert results(tmp_path / "a") == results(tmp_path / "b")
    assert (tmp_path / "a" / "normals.npy").read_bytes() != (plain / "normals.npy").read_bytes()


def test_several_options(run, folder, tmp_path):
    words = ("--solver", "trimmed", "--option", "low=0.1", "--option", "high=0.9", "--normals-only", "--json")
    done = run("reconstruct", folder, "-o", tmp_path / "out", *words)
    assert done.code == 0
    assert done.record["normals"]["solver"] == "trimmed"
    assert done.record["normals"]["options"] == {"gate": "auto", "low": 0.1, "high": 0.9}


def test_without_a_name_the_default_is_taken_and_its_reason_told(run, folder, tmp_path):
    record = run("reconstruct", folder, "-o", tmp_path / "a", "--normals-only", "--json").record
    solver = record["normals"]["solver"]
    again = run("reconstruct", folder, "-o", tmp_path / "b", "--solver", solver, "--normals-only", "--json").record
    assert again["normals"]["solver"] == solver
    stages = ("ambient solving", "robust solving", "non-Lambertian solving")
    chosen, named = (
        {step["name"]: step["reason"] for step in one["steps"] if step["name"] in stages} for one in (record, again)
    )
    assert set(chosen) == set(named) == set(stages)
    assert all("asked for" not in reason for reason in chosen.values())
    assert all("sked for" in reason for reason in named.values())
    assert results(tmp_path / "a") == results(tmp_path / "b")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--option", "gate=none"), ("gate=none", "no solver", "--solver")),
        (("--solver", "least-squares", "--option", "gat=none"), ("'gat'", "Did you mean gate?")),
        (("--solver", "least-squares", "--option", "gate=nine"), ("'nine'", "option gate", "Did you mean none?")),
        (("--solver", "least-squares", "--option", "gate"), ("'gate'", "KEY=VALUE", "solvers least-squares")),
        (("--solver", "least-squares", "--option", "gate="), ("'gate='", "KEY=VALUE")),
        (("--solver", "least-squares", "--option", "=none"), ("'=none'", "KEY=VALUE")),
        (
            ("--solver", "least-squares", "--option", "gate=none", "--option", "gate=auto"),
            ("gate=auto", "given before"),
        ),
        (("--solver", "least-squares", "--gate", "none", "--option", "gate=none"), ("given twice", "--gate")),
        (("--solver", "trimmed", "--option", "low=few"), ("'few'", "number", "default is 0.25")),
        (("--solver", "robust", "--option", "loss=tukay"), ("'tukay'", "Did you mean tukey?")),
    ],
)
def test_options_that_nobody_knows_are_told_before_anything_is_read(run, folder, tmp_path, options, words):
    for image in folder.glob("0*.png"):
        image.write_bytes(b"no picture")
    before = everything(tmp_path)
    done = run("reconstruct", folder, "-o", tmp_path / "out", *options)
    assert_one_message(done, words)
    assert everything(tmp_path) == before


# --- verdicts, and observations left out by hand ----------------------------------------------------------------------


def test_verdicts_are_written_painted_in_and_fed_back(run, folder, tmp_path, plain):
    out = tmp_path / "first"
    assert run("reconstruct", folder, "-o", out, "--verdicts").code == 0
    same = results(plain)
    assert {name: data for name, data in results(out).items() if name in same} == same
    least_squares = ("--solver", "least-squares")  # takes all it is given alike, so that the same mask gives the same
    assert run("reconstruct", folder, "-o", out, "--verdicts", "--overwrite", *least_squares).code == 0
    verdicts = np.load(out / "verdicts.npz")["verdicts"]
    assert verdicts.shape == (8, 40, 48)
    assert sorted(p.name for p in (out / "verdicts").glob("*.png")) == [f"{i:04d}.png" for i in range(1, 9)]

    words = (*least_squares, "--gate", "none", "--json")
    by_file = run("reconstruct", folder, "-o", tmp_path / "a", "--observation-mask", out / "verdicts.npz", *words)
    by_pictures = run("reconstruct", folder, "-o", tmp_path / "b", "--observation-mask", out / "verdicts", *words)
    assert by_file.code == by_pictures.code == 0
    assert results(tmp_path / "a") == results(tmp_path / "b")
    normals, first = np.load(tmp_path / "a" / "normals.npy"), np.load(out / "normals.npy")
    assert np.nanmax(angular_error(normals, first)) < 1e-4
    assert by_file.record["normals"]["left_out_by_hand"] > 0
    assert [s["done"] for s in by_file.record["steps"] if s["name"] == "observation mask"] == [True]

    picture = read_png(out / "verdicts" / "0002.png")
    picture[10:20, 10:20] = (0, 0, 255)  # red, in OpenCV's order
    save_png(out / "verdicts" / "0002.png", picture)
    painted = run(
        "reconstruct", folder, "-o", tmp_path / "c", "--observation-mask", out / "verdicts", "--verdicts", "--json"
    )
    assert painted.code == 0
    assert (np.load(tmp_path / "c" / "verdicts.npz")["verdicts"][1, 10:20, 10:20] == Verdict.UNUSABLE).all()
    refused = run("reconstruct", folder, "-o", out, "--overwrite")
    assert_one_message(refused, ("verdicts/0002.png", "-o"))
    assert np.array_equal(read_png(out / "verdicts" / "0002.png"), picture)


def test_a_result_with_verdicts_can_be_replaced(run, folder, tmp_path):
    out = tmp_path / "out"
    for words in (("--verdicts",), ("--verdicts", "--overwrite"), ("--overwrite",)):
        assert run("reconstruct", folder, "-o", out, "--normals-only", *words).code == 0
    assert {p.name for p in out.iterdir()} == ARRAYS | PICTURES | TIMED


@pytest.mark.parametrize("what", ["missing", "picture", "other images", "result"])
def test_masks_of_observations_that_cannot_be_used(run, folder, tmp_path, what):
    assert run("reconstruct", folder, "-o", tmp_path / "first", "--verdicts", "--normals-only").code == 0
    np.savez(tmp_path / "other.npz", verdicts=np.zeros((8, 40, 47), np.uint8))
    path, words = {
        "missing": (tmp_path / "none.npz", ("none.npz", "does not exist")),
        "picture": (folder / "mask.png", ("mask.png", "--verdicts", "--mask")),
        "other images": (tmp_path / "other.npz", ("(8, 40, 47)", "(8, 40, 48)")),
        "result": (tmp_path / "first", ("is a result", "verdicts.npz")),
    }[what]
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--observation-mask", path)
    assert_one_message(done, words)
    assert not (tmp_path / "out").exists()
