"""The command as a whole: help, exit codes, streams, errors, and what an interruption leaves."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import psstereo_cli.app
from psstereo_cli.commands.calibrate import CALIBRATIONS
from psstereo_cli.execution import parse_floats, parse_size, threaded
from psstereo_cli.failure import report_failure
from psstereo_cli.record import finite

COMMANDS = (
    "synth", "reconstruct", "plan", "integrate", "sfs", "terrain", "evaluate", "info", "match", "solvers", "demo",
    "bench", "rig", "convert", "calibrate",
)  # fmt: skip

_SLOW_WRITING = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a suite in the background may have passed on to ignore it
import psstereo.io.result_folder as folder_module
whole = folder_module.write_normal_map
def slow(*arguments, **keywords):
    whole(*arguments, **keywords)
    print("writing", flush=True)
    time.sleep(60)
folder_module.write_normal_map = slow
from psstereo_cli.app import main
sys.argv = ["psstereo", *sys.argv[1:]]
main()
"""


def everything(folder: Path) -> dict[str, bytes]:
    """Return the content of all files below a folder, by relative name; folders have a name only."""
    return {
        str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"<folder>" for p in sorted(folder.rglob("*"))
    }


@pytest.mark.parametrize("command", COMMANDS)
def test_every_help_has_an_example_that_is_a_command(run, command):
    done = run(command, "--help")
    assert done.code == 0
    assert re.search(rf"Example:\s+psstereo {command}\b", done.out)
    assert done.err == ""


@pytest.mark.parametrize("target", CALIBRATIONS)
def test_every_calibration_has_an_example_too(run, target):
    done = run("calibrate", target, "--help")
    assert done.code == 0
    assert re.search(rf"Example:\s+psstereo\s+calibrate\s+{target}\b", done.out)


def test_help_lists_every_command(run):
    done = run("--help")
    assert done.code == 0
    assert all(re.search(rf"(?m)^\W*{command} ", done.out) for command in COMMANDS)


def test_no_word_at_all_shows_the_help(run):
    done = run()
    assert done.code == 2
    assert "reconstruct" in done.out + done.err


def test_version(run):
    done = run("--version")
    assert done.code == 0
    assert re.fullmatch(r"psstereo \d+\.\d+\.\d+\S*\n", done.out)


@pytest.mark.parametrize(
    "words",
    [
        ("reconstrukt",),
        ("reconstruct",),
        ("reconstruct", "somewhere"),
        ("reconstruct", "somewhere", "-o"),
        ("reconstruct", "somewhere", "-o", "x", "--nonsense"),
        ("reconstruct", "somewhere", "-o", "x", "--threads", "0"),
        ("reconstruct", "somewhere", "-o", "x", "--clip", "word"),
        ("evaluate", "one"),
        ("info",),
        ("demo", "--size", "2"),
        ("bench", "--repeats", "0"),
    ],
)
def test_wrong_usage_ends_with_2_and_writes_nothing_to_stdout(run, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(*words)
    assert done.code == 2
    assert done.out == ""
    assert "Error" in done.err
    assert "Traceback" not in done.err
    assert not list(tmp_path.iterdir())


def test_a_fault_of_the_program_itself_is_not_dressed_up_as_bad_input():
    with pytest.raises(ZeroDivisionError):
        report_failure(ZeroDivisionError("division by zero"), as_json=True)


def test_lack_of_memory_and_trouble_with_the_disk_are_told(capsys):
    assert report_failure(MemoryError(), as_json=False) == 3
    assert "--max-memory" in capsys.readouterr().err
    assert report_failure(OSError(28, "No space left on device", "normals.npy"), as_json=True) == 3
    caught = capsys.readouterr()
    assert "normals.npy: No space left on device" in caught.err
    assert json.loads(caught.out)["error"]["kind"] == "OSError"


def test_an_error_while_the_pool_works_is_told_at_once():
    begun = []

    def work(item):
        begun.append(item)
        if item == 0:
            raise ValueError(item)
        time.sleep(0.05)
        return item

    with pytest.raises(ValueError, match="0"), threaded(2) as over:
        list(over(work, range(400)))
    assert len(begun) < 400  # what was queued is given up


@pytest.mark.parametrize(
    ("text", "size"),
    [("30MB", 30_000_000), (" 2 gib ", 2**31), ("1.5k", 1500), ("7", 7), ("1MiB", 2**20), (None, None)],
)
def test_sizes_of_memory(text, size):
    assert parse_size(text) == size


@pytest.mark.parametrize("text", ["", "MB", "-3MB", "0", "3 TB", "1e9", "nan", "3 MB please"])
def test_nonsense_is_no_size(text):
    with pytest.raises(ValueError, match="memory limit") as caught:
        parse_size(text)
    assert "500MB" in caught.value.needed


@pytest.mark.parametrize("text", ["", "a,b", "1,2,3", "1", "1;2", "1,,2"])
def test_nonsense_is_no_pair(text):
    with pytest.raises(ValueError, match="range"):
        parse_floats(text, 2, "range")


def test_records_hold_nothing_that_json_does_not_know():
    import numpy as np

    given = {"a": np.float32(0.5), 1: (np.int64(3), float("nan")), "b": {"c": np.inf, "d": np.bool_(True)}, "e": None}
    assert finite(given) == {"a": 0.5, "1": [3, None], "b": {"c": None, "d": True}, "e": None}


def run_module(environment, *words, **options):
    return subprocess.run(
        [sys.executable, "-m", "psstereo_cli", *map(str, words)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
        **options,
    )


def test_a_process_keeps_stdout_for_the_one_json_object(environment, folder, tmp_path):
    done = run_module(environment, "reconstruct", folder, "-o", tmp_path / "out", "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["out"] == str(tmp_path / "out")
    assert done.stderr == ""


def test_a_process_tells_a_failure_on_both_streams(environment, tmp_path):
    done = run_module(environment, "reconstruct", tmp_path / "nothing", "-o", tmp_path / "out", "--json")
    assert done.returncode == 3
    error = json.loads(done.stdout)["error"]
    assert set(error) == {"kind", "given", "needed", "remedy"}
    assert error["kind"] == "MissingFileError"
    assert done.stderr == f"psstereo: {error['given']}\n  {error['needed']}\n  {error['remedy']}\n"


def test_output_in_a_poor_encoding_still_parses(environment, folder, tmp_path):
    named = folder.rename(tmp_path / "Käfer ×2")
    poor = {**environment, "PYTHONIOENCODING": "ascii"}
    done = run_module(poor, "info", named, "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["name"] == "Käfer ×2"
    assert run_module(poor, "info", named).returncode == 0


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux keeps file names as bytes")
def test_a_folder_whose_name_is_no_utf8(run, folder, tmp_path):
    import os

    odd = tmp_path / os.fsdecode(b"caf\xe9")
    folder.rename(odd)
    done = run("reconstruct", odd, "-o", tmp_path / "out", "--json")
    assert done.code == 0
    assert os.fsencode(done.record["capture"]["name"]) == b"caf\xe9"
    assert json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))["capture"]["name"] == odd.name
    assert run("info", odd).code == 0


def interrupt_while_writing(environment, folder: Path, out: Path, number: signal.Signals, *options: str):
    """Start a reconstruction, send a signal when half of the result is written, and return code and streams."""
    words = [sys.executable, "-c", _SLOW_WRITING, "reconstruct", str(folder), "-o", str(out), *options]
    process = subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "writing\n"
        beside = [p for p in out.parent.iterdir() if p.name.startswith(f".{out.name}-")]
        assert beside, "the half-written folder is there while the work goes on"
        process.send_signal(number)
        output, errors = process.communicate(timeout=120)
    finally:
        process.kill()
        process.wait()
    return process.returncode, output, errors


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_an_interrupted_run_leaves_nothing(environment, folder, tmp_path, number, code):
    out = tmp_path / "results" / "out"
    found, _, errors = interrupt_while_writing(environment, folder, out, number)
    assert found == code
    assert "Traceback" not in errors
    assert not list(out.parent.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
def test_an_interrupted_run_leaves_the_earlier_result_alone(environment, run, folder, tmp_path):
    out = tmp_path / "results" / "out"
    assert run("reconstruct", folder, "-o", out).code == 0
    before = everything(out.parent)
    code, _, _ = interrupt_while_writing(environment, folder, out, signal.SIGTERM, "--overwrite", "--gate", "none")
    assert code == 143
    assert everything(out.parent) == before


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
def test_an_interruption_while_images_are_decoded_leaves_nothing(environment, folder, tmp_path):
    slow = """
import sys, time
import psstereo.stack.files as files
whole = files.decode_image
def decode(path):
    print("decoding", flush=True)
    time.sleep(0.3)
    return whole(path)
files.decode_image = decode
from psstereo_cli.app import main
sys.argv = ["psstereo", *sys.argv[1:]]
main()
"""
    out = tmp_path / "results" / "out"
    out.parent.mkdir()
    words = [sys.executable, "-c", slow, "reconstruct", str(folder), "-o", str(out), "--threads", "2"]
    process = subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "decoding\n"
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=120)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 143
    assert "Traceback" not in errors
    assert not list(out.parent.iterdir())


def test_the_module_can_be_run_by_name(environment):
    done = run_module(environment, "--version")
    assert done.returncode == 0
    assert done.stdout.startswith("psstereo ")


def test_help_loads_nothing_heavy(environment):
    code = (
        "import sys; sys.argv = ['psstereo', '--help']\n"
        "from psstereo_cli.app import app\n"
        "try: app()\nexcept SystemExit: pass\n"
        "print(sorted({'numpy', 'cv2', 'scipy', 'skimage', 'numba'} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stderr.strip() == "[]"


def test_progress_reaches_a_terminal_only(monkeypatch):
    from psstereo.types import no_progress
    from psstereo_cli import console

    with console.progress_bars() as progress:
        assert progress is no_progress
    drawn = []
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(console, "_PATIENCE", 0.0)
    whole = console._Bars._draw
    monkeypatch.setattr(console._Bars, "_draw", staticmethod(lambda: drawn.append(1) or whole()))
    with console.progress_bars() as progress:
        progress("quick", 1, 1)
        assert not drawn  # what is done already needs no bar
        progress("long", 1, 3)
        progress("long", 3, 3)
    assert drawn == [1]


def test_the_command_registers_each_command_once():
    names = [c.callback.__name__ for c in psstereo_cli.app.app.registered_commands if c.callback]
    groups = [group.name for group in psstereo_cli.app.app.registered_groups]
    assert sorted([*names, *groups]) == sorted(COMMANDS)
