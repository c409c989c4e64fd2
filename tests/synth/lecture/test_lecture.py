import inspect
import subprocess
import sys
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import pytest

import psstereo_synth.lecture
from psstereo_synth.lecture import LECTURE, STATEMENTS, Example
from psstereo_synth.lecture.__main__ import as_text, main
from psstereo_synth.lecture.example import largest_of, largest_relative

FOLDER = Path(psstereo_synth.lecture.__file__).parent


@pytest.fixture(scope="module", params=list(LECTURE))
def example(request):
    return request.param, LECTURE[request.param]()


def test_every_example_has_its_statement():
    assert list(LECTURE) == list(STATEMENTS)
    for sentence in STATEMENTS.values():
        assert sentence.endswith(".")
        assert "\n" not in sentence


def test_it_holds_and_is_a_table(example):
    name, found = example
    assert found.holds
    assert found.largest_error <= found.tolerance <= 1e-3
    assert found.statement == STATEMENTS[name]
    assert found.title
    assert len(found.rows) >= 5
    for row in found.rows:
        assert len(row) == len(found.columns)
        assert all(type(cell) in (float, str) for cell in row)


def test_its_docstring_teaches(example):
    text = inspect.getdoc(LECTURE[example[0]])
    assert "*Statement.*" in text
    assert "*Where it stops being true.*" in text


def test_it_is_frozen(example):
    with pytest.raises(FrozenInstanceError):
        example[1].holds = False


def test_it_is_the_same_again(example):
    assert LECTURE[example[0]]() == example[1]


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_modules_are_short(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) < 120


def test_a_column_is_found_by_the_beginning_of_its_heading():
    found = Example(
        title="t",
        statement="s.",
        columns=("a [m]", "a b [m]", "c"),
        rows=((1.0, 2.0, "x"), (3.0, 4.0, "y")),
        largest_error=0.0,
        tolerance=0.0,
        holds=True,
    )
    assert found.column("a [") == (1.0, 3.0)
    assert found.column("c") == ("x", "y")
    for heading in ("a", "d"):
        with pytest.raises(KeyError):
            found.column(heading)


def test_errors_hand_nan_on():
    nan = float("nan")
    assert largest_relative([1.0, -2.0], [1.0, -4.0]) == 0.5
    assert not largest_relative([1.0, nan], [1.0, 1.0]) < 1.0
    assert not largest_of(0.0, nan, 1.0) < 2.0
    assert largest_of(0.0, 3.0, 1.0) == 3.0


def test_the_command_prints_what_was_asked_for(capsys):
    assert main(["room", "cosine"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out.startswith("A room fills the sphere\n" + STATEMENTS["room"])
    assert "\nThe cosine law\n" in out
    assert out.count("holds: largest error") == 2
    assert "tube" not in out


def test_a_table_is_aligned():
    found = LECTURE["room"]()
    lines = as_text(found).splitlines()
    start = lines.index("") + 1
    table = lines[start : start + len(found.rows) + 1]
    assert len({len(line) for line in table}) == 1
    assert table[0].split("  ")[0] == "room"


def test_an_unknown_name_offers_the_nearest(capsys):
    assert main(["tub"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "Did you mean tube?" in err


def test_a_statement_that_does_not_hold_is_said(capsys, monkeypatch):
    broken = replace(LECTURE["cosine"](), holds=False)
    monkeypatch.setitem(LECTURE, "cosine", lambda: broken)
    assert main(["cosine", "tube"]) == 1
    assert "DOES NOT HOLD" in capsys.readouterr().out


def test_it_runs_as_a_module():
    words = [sys.executable, "-m", "psstereo_synth.lecture", "sun"]
    done = subprocess.run(words, capture_output=True, check=True)
    assert "L_sun = 1361 / Ω_sun = 2.003e+07" in done.stdout.decode("utf-8")
