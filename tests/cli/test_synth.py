"""``psstereo synth``: captures in any layout, from names and files; all or nothing on disk."""

import json
import signal
import subprocess
import sys
import tomllib

import numpy as np
import pytest
import trimesh

from psstereo.io import WRITERS, read_capture
from psstereo_synth.gallery import GALLERY
from psstereo_synth.scenes.template import TEMPLATE

SMALL = ("--size", "24", "--lights", "4")


def files(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture
def scene(tmp_path):
    """Write a scene file from its text and return its path."""

    def write(text, name="my.toml"):
        path = tmp_path / "in" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_named_scene_becomes_a_capture_with_its_truth(run, tmp_path):
    done = run("synth", "hills", "-o", tmp_path / "c", "--size", "30x20", "--lights", "5", "--json")
    assert done.code == 0
    record = done.record
    assert (record["command"], record["scene"], record["layout"], record["images"]) == ("synth", "hills", "capture", 5)
    assert record["size"] == [30, 20]
    assert record["out"] == [str(tmp_path / "c")]
    assert record["not_written"] == []
    assert record["seconds"]["render"] > 0
    names = {step["name"]: step for step in record["steps"]}
    assert names["cast shadows"]["done"]
    assert not names["OpenGL"]["done"]
    capture, truth = read_capture(tmp_path / "c")
    assert capture.stack.shape == (5, 20, 30, 1)
    assert capture.stack.dtype == np.uint16
    assert truth is not None
    assert truth.normals.shape == (20, 30, 3)
    assert truth.visibility.shape == (5, 20, 30)
    assert truth.depth.shape == truth.albedo.shape == (20, 30)


def test_it_tells_a_person_the_same(run, tmp_path):
    done = run("synth", "hills", "-o", tmp_path / "c", *SMALL)
    assert done.code == 0
    assert done.out == ""
    assert "hills: Steep painted hills" in done.text
    assert "left out" in done.text
    assert "4 images of 24 × 24 pixels" in done.text
    assert f"psstereo reconstruct {tmp_path / 'c'} -o RESULT" in done.text


def test_what_it_suggests_next_works(run, tmp_path):
    assert run("synth", "matte-sphere", "-o", tmp_path / "c", *SMALL).code == 0
    assert run("reconstruct", tmp_path / "c", "-o", tmp_path / "r").code == 0
    done = run("evaluate", tmp_path / "r", tmp_path / "c", "--json")
    assert done.record["normals"]["mean_deg"] < 0.1


def test_near_lights_are_not_sent_to_a_solver_for_distant_ones(run, tmp_path):
    done = run("synth", "near-leds", "-o", tmp_path / "c", *SMALL)
    assert done.code == 0
    assert "reconstruct" not in done.text


LAMPS = '[surface]\nshape = "sphere"\n[camera]\ntype = "pinhole"\n[lights]\nkind = "led"\ncount = 5\ndistance = 4\n'
SUITS = {"luces": LAMPS, "near-ps": LAMPS}


@pytest.mark.parametrize("layout", WRITERS)
def test_every_layout_comes_back(run, tmp_path, scene, layout):
    text = SUITS.get(layout, '[surface]\nshape = "sphere"\n[lights]\ncount = 5\n')
    done = run("synth", scene(text), "-o", tmp_path / "c", "--layout", layout, "--size", "24", "--json")
    assert done.code == 0, done.err
    assert done.record["layout"] == layout
    capture, _ = read_capture(tmp_path / "c")
    assert capture.stack.shape[:3] == (5, 24, 24)
    assert len(capture.rig) == 5
    assert layout == "capture" or done.record["not_written"]


def test_what_a_layout_cannot_hold_is_told_and_nothing_is_written(run, tmp_path):
    done = run("synth", "near-leds", "-o", tmp_path / "c", "--layout", "diligent", *SMALL, "--json")
    assert done.code == 3
    assert done.record["error"]["kind"] == "UnsupportedError"
    assert not list(tmp_path.iterdir())


def test_the_list(run):
    done = run("synth", "--list")
    assert done.code == 0
    assert done.out == ""
    assert all(name in done.text for name in GALLERY)
    record = run("synth", "--list", "--json").record
    assert list(record) == list(GALLERY)
    assert all(sentence.endswith(".") for sentence in record.values())


def test_the_template_can_be_rendered(run, tmp_path, scene):
    done = run("synth", "--template")
    assert done.code == 0
    assert done.out == TEMPLATE
    assert done.err == ""
    assert tomllib.loads(done.out)["name"] == "my-scene"
    assert run("synth", scene(done.out), "-o", tmp_path / "c", *SMALL).code == 0


def test_a_scene_and_a_folder_are_needed(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("synth").code == 2
    assert run("synth", "hills").code == 2
    assert run("synth", "-o", "x").code == 2
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("options", [("--lights", "0"), ("--seed", "-1"), ("--threads", "0"), ("--lights", "many")])
def test_numbers_out_of_range_are_usage_errors(run, tmp_path, options):
    assert run("synth", "hills", "-o", tmp_path / "c", *options).code == 2
    assert not list(tmp_path.iterdir())


SPHERE = '[surface]\nshape = "sphere"\n'
HOSTILE = {
    "an unknown shape": ('[surface]\nshape = "spere"', "Did you mean sphere?"),
    "an unknown key": (f"{SPHERE}[camera]\nwith = 3", "Did you mean width?"),
    "an unknown table": (f"{SPHERE}[light]\ncount = 3", "Did you mean lights?"),
    "negative albedo": (f'{SPHERE}[albedo]\npattern = "constant"\nalbedo = -0.2', "-0.2"),
    "a light inside": (f'{SPHERE}[lights]\nkind = "led"\ndistance = 0.5', "is inside the surface"),
    "a light under the ground": (
        '[surface]\nshape = "hills"\n[lights]\nkind = "led"\ndirections = [[0.1, 0, -0.9]]',
        "is inside the surface",
    ),
    "a size of zero": (f"size = [0, 0]\n{SPHERE}", "0 × 0"),
    "a size of text": (f'size = "big"\n{SPHERE}', "size"),
    "no file": ('[surface]\nmesh = "none.ply"', "none.ply"),
    "no albedo at all": (f'{SPHERE}[albedo]\npattern = "constant"\nalbedo = 0', "black under every light"),
    "two channels": (f"{SPHERE}[lights]\nirradiance = [1, 2]", "irradiance"),
    "channels that differ": (
        f'{SPHERE}[albedo]\npattern = "constant"\nalbedo = [0.1, 0.2]\n[lights]\nirradiance = [1, 2, 3]',
        "channels",
    ),
    "a camera under the ground": (f'{SPHERE}[camera]\ntype = "pinhole"\ndistance = 0.2', "below the sphere"),
    "a camera that sees nothing": (f"{SPHERE}[[views]]\nposition = [50, 0, 8]\ntarget = [50, 0, 0]", "sees the sphere"),
    "a night": (f'{SPHERE}[lights]\narrangement = "day"\nhours = [0, 4]', "below the horizon"),
    "nothing": ("", "[surface]"),
    "no TOML": ("= = =", "TOML"),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_bad_scenes_end_with_3_and_one_message_and_leave_nothing(run, tmp_path, scene, what):
    text, part = HOSTILE[what]
    path = scene(text)
    done = run("synth", path, "-o", tmp_path / "out" / "c", "--json")
    assert done.code == 3, done.err
    error = done.record["error"]
    assert part in f"{error['given']} {error['needed']} {error['remedy']}"
    assert done.err.count("psstereo: ") == 1
    assert len(done.err.splitlines()) == 3
    assert "Traceback" not in done.err
    assert not (tmp_path / "out").exists()


def test_a_mesh_without_faces(run, tmp_path, scene):
    path = scene('[surface]\nmesh = "points.ply"')
    trimesh.PointCloud(np.eye(3)).export(path.with_name("points.ply"))
    done = run("synth", path, "-o", tmp_path / "c")
    assert done.code == 3
    assert "no triangles" in done.text
    assert not (tmp_path / "c").exists()


def test_a_mesh_beside_its_scene_is_rendered(run, tmp_path, scene):
    path = scene('[surface]\nmesh = "ball.ply"\nsmooth = true\n[lights]\ncount = 4\n', "Kugel ü.toml")
    trimesh.creation.icosphere(3).export(path.with_name("ball.ply"))
    done = run("synth", path, "-o", tmp_path / "c", "--size", "32", "--engine", "rays", "--json")
    assert done.code == 0
    assert done.record["scene"] == "Kugel ü"
    assert done.record["steps"][0]["reason"] == "The mesh was viewed by casting rays, as asked for."
    assert read_capture(tmp_path / "c")[1] is not None


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (("hils",), "Did you mean hills?"),
        (("nothing-like-it",), "Known are matte-sphere"),
        (("none.toml",), "none.toml"),
        (("hills", "--layout", "diligence"), "Did you mean diligent?"),
        (("hills", "--engine", "openlg"), "Did you mean opengl?"),
        (("hills", "--size", "0"), "0 × 0"),
        (("hills", "--size", "0x7"), "0 × 7"),
        (("hills", "--size", "99999"), "99999"),
        (("hills", "--size", "-3"), "-3"),
        (("hills", "--size", "3x"), "3x"),
        (("hills", "--size", "1e3"), "1e3"),
        (("hills", "--size", "nan"), "nan"),
        (("hills", "--size", ""), "''"),
        (("hills", "--size", "20000x20000", "--lights", "5000"), "memory"),
        (("hills", "--lights", "1000000000"), "1000000000 lights"),
        (("two-views", "--layout", "diligent", "--lights", "300000"), "300000"),
    ],
)
def test_bad_words_end_with_3_and_leave_nothing(run, tmp_path, monkeypatch, words, part):
    monkeypatch.chdir(tmp_path)
    done = run("synth", *words, "-o", "c", "--json")
    assert done.code == 3, done.err
    error = done.record["error"]
    assert part in f"{error['given']} {error['needed']} {error['remedy']}"
    assert not list(tmp_path.iterdir())


def test_a_name_is_a_scene_of_the_gallery_even_beside_a_file_of_that_name(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hills").write_text("no scene", encoding="utf-8")
    assert run("synth", "hills", "-o", "c", *SMALL).code == 0
    (tmp_path / "mine").write_text(SPHERE, encoding="utf-8")
    assert run("synth", "mine", "-o", "d", *SMALL, "--json").record["scene"] == "mine"
    assert run("synth", "c", "-o", "e").code == 3  # a folder is no scene


@pytest.mark.parametrize("name", ["hills", "two-views"])
def test_the_folder_is_protected(run, tmp_path, name):
    out = tmp_path / "c"
    assert run("synth", name, "-o", out, *SMALL).code == 0
    before = files(out)
    refused = run("synth", name, "-o", out, *SMALL, "--seed", "3", "--json")
    assert refused.code == 3
    assert "--overwrite" in refused.record["error"]["remedy"]
    assert files(out) == before
    assert run("synth", name, "-o", out, "--size", "20", "--lights", "4", "--overwrite").code == 0
    after = files(out)
    assert set(after) == set(before)
    assert after != before
    (out / "notes.txt").write_text("mine", encoding="utf-8")
    kept = files(out)
    refused = run("synth", name, "-o", out, *SMALL, "--overwrite", "--json")
    assert refused.code == 3
    assert "notes.txt" in refused.record["error"]["given"]
    assert files(out) == kept


def test_other_folders_are_never_replaced(run, tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "holiday.jpg").write_bytes(b"x")
    for words in ((), ("--overwrite",)):
        assert run("synth", "hills", "-o", tmp_path / "photos", *SMALL, *words).code == 3
    (tmp_path / "file").write_text("x", encoding="utf-8")
    for words in ((), ("--overwrite",)):
        assert run("synth", "hills", "-o", tmp_path / "file", *SMALL, *words).code == 3
    assert run("synth", "hills", "-o", tmp_path / "file" / "c", *SMALL).code == 3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "photos"]
    (tmp_path / "empty").mkdir()
    assert run("synth", "hills", "-o", tmp_path / "empty", *SMALL).code == 0


def test_several_views_become_folders_in_one(run, tmp_path):
    done = run("synth", "two-views", "-o", tmp_path / "c", *SMALL, "--json")
    assert done.code == 0
    assert done.record["out"] == [str(tmp_path / "c" / f"view_0{i}") for i in (1, 2)]
    assert sorted(p.name for p in (tmp_path / "c").iterdir()) == ["view_01", "view_02"]
    first, second = (read_capture(tmp_path / "c" / f"view_0{i}")[0] for i in (1, 2))
    assert first.name != second.name
    assert first.radiance_at_white == second.radiance_at_white
    assert (first.stack.read() != second.stack.read()).any()


def test_several_views_appear_all_or_none(run, tmp_path, monkeypatch):
    from psstereo import io

    real, calls = io.write_capture, []

    def fails_on_the_second(*arguments, **options):
        calls.append(1)
        if len(calls) == 2:
            raise OSError(28, "No space left on device", "disk")
        return real(*arguments, **options)

    monkeypatch.setattr(io, "write_capture", fails_on_the_second)
    done = run("synth", "two-views", "-o", tmp_path / "c", *SMALL)
    assert done.code == 3
    assert "No space left" in done.text
    assert len(calls) == 2
    assert not list(tmp_path.iterdir())


def test_the_same_seed_gives_the_same_bytes_on_any_number_of_threads(run, tmp_path):
    for name, words in {"a": (), "b": ("--threads", "1"), "c": ("--threads", "3"), "d": ("--seed", "1")}.items():
        assert run("synth", "low-light", "-o", tmp_path / name, *SMALL, *words).code == 0
    assert files(tmp_path / "a") == files(tmp_path / "b") == files(tmp_path / "c")
    other = files(tmp_path / "d")
    assert all(other[name] != data for name, data in files(tmp_path / "a").items() if name.startswith("images/"))


_SLOW = """
import os, signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell that starts tests behind itself has it ignored
import psstereo_synth.rendering.stage as stage
import psstereo.io.capture_writer as writer
where = sys.argv.pop(1)
if where == "rendering":
    real = stage.Stage._photograph
    def slow(self, *rest):
        os.write(1, b"at work\\n")
        time.sleep(0.3)
        return real(self, *rest)
    stage.Stage._photograph = slow
else:
    real = writer.write_png
    def slow(path, image):
        real(path, image)
        if "view_02" in str(path):
            os.write(1, b"at work\\n")
            time.sleep(0.3)
    writer.write_png = slow
from psstereo_cli.app import main
sys.argv = ["psstereo", *sys.argv[1:]]
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
@pytest.mark.parametrize("where", ["rendering", "writing"])
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_an_interrupted_run_leaves_nothing(environment, tmp_path, where, number, code):
    out = tmp_path / "results" / "c"
    out.parent.mkdir()
    words = [sys.executable, "-c", _SLOW, where, "synth", "two-views", "-o", str(out), *SMALL, "--threads", "2"]
    process = subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "at work\n"
        assert where == "rendering" or list(out.parent.iterdir())
        process.send_signal(number)
        _, errors = process.communicate(timeout=120)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == code
    assert "Traceback" not in errors
    assert not list(out.parent.iterdir())


def test_the_record_is_plain_json(run, tmp_path):
    done = run("synth", "room", "-o", tmp_path / "c", "--size", "12", "--lights", "2", "--json")
    assert json.loads(done.out) == done.record
    assert {"penumbra", "interreflection", "cast shadows"} <= {s["name"] for s in done.record["steps"] if s["done"]}
    assert not done.record["lights_distant"]


def test_help_has_an_example(run):
    done = run("synth", "--help")
    assert done.code == 0
    assert "psstereo synth hills -o hills" in " ".join(done.out.split())


def test_layouts_are_named_in_the_help(run):
    out = run("synth", "--help").out
    assert all(layout in out for layout in WRITERS)
