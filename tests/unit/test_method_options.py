"""Solvers from words, and back."""

from dataclasses import dataclass, field
from enum import Enum
from typing import ClassVar, Literal

import pytest

from psstereo.errors import OptionError
from psstereo.lights import Rig
from psstereo.method_options import configure, options_of, settings_of
from psstereo.normals import (
    GATES,
    NORMAL_SOLVERS,
    LeastSquares,
    default_solver,
    estimate_normals,
)
from psstereo_synth import demo_capture, ring

SHAPES = {"round": (1, 2), "square": (3, 4)}


class Mood(Enum):
    CALM = "calm"
    WILD = "wild"


@dataclass(frozen=True, kw_only=True)
class Example(LeastSquares):
    """An example.

    Attributes
    ----------
    rounds : int
        Rounds at most,
        over two lines [1].
    tolerance, scale : float
        When it stops [1].

    References
    ----------
    rounds : not this one.
    """

    name: ClassVar[str] = "example"
    rounds: int = 7
    tolerance: float = 1e-3
    eager: bool = False
    label: str = "x"
    scale: float | None = None
    mood: Mood = Mood.CALM
    side: Literal["left", "right"] = "left"
    shape: tuple[int, int] = field(default=SHAPES["round"], metadata={"choices": SHAPES})
    table: dict[str, int] = field(default_factory=dict)


def test_options_have_type_default_and_meaning():
    found = {option.name: option for option in options_of(Example)}
    assert list(found) == ["gate", "rounds", "tolerance", "eager", "label", "scale", "mood", "side", "shape"]
    assert found["gate"].kind == "none, shadow, saturation, auto"
    assert found["gate"].default == "auto"
    assert found["gate"].meaning.startswith("Which observations are left out")  # of the base class
    assert (found["rounds"].kind, found["rounds"].default) == ("whole number", 7)
    assert found["rounds"].meaning == "Rounds at most, over two lines [1]."
    assert (found["scale"].kind, found["scale"].default) == ("number, or none", None)
    assert found["scale"].meaning == found["tolerance"].meaning == "When it stops [1]."
    assert found["eager"].kind == "true or false"
    assert (found["mood"].kind, found["mood"].default) == ("calm, wild", "calm")
    assert found["side"].kind == "left, right"
    assert found["shape"].kind == "round, square"
    assert found["label"].meaning == ""


def test_words_become_values():
    words = {
        "gate": "none", "rounds": "12", "tolerance": "1e-6", "eager": "Yes", "label": "a=b", "scale": "0.25",
        "mood": "wild", "side": "right", "shape": "square",
    }  # fmt: skip
    solver = configure(Example, words)
    assert solver == Example(
        gate=GATES["none"], rounds=12, tolerance=1e-6, eager=True, label="a=b", scale=0.25, mood=Mood.WILD,
        side="right", shape=(3, 4),
    )  # fmt: skip
    assert configure(Example, {}) == Example()
    assert configure(Example, {"scale": "None"}).scale is None
    assert settings_of(solver) | {"table": None} == {
        "gate": "none", "rounds": 12, "tolerance": 1e-6, "eager": True, "label": "a=b", "scale": 0.25,
        "mood": "wild", "side": "right", "shape": [3, 4], "table": None,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        ({"ronds": "3"}, ("'ronds'", "option of example", "Did you mean rounds?")),
        ({"table": "3"}, ("'table'",)),
        ({"gate": "shadw"}, ("'shadw'", "option gate", "Did you mean shadow?")),
        ({"mood": "wlid"}, ("'wlid'", "Did you mean wild?")),
        ({"side": "up"}, ("'up'", "left, right")),
        ({"shape": "squar"}, ("'squar'", "Did you mean square?")),
        ({"rounds": "3.5"}, ("'3.5'", "whole number", "default is 7")),
        ({"rounds": ""}, ("whole number",)),
        ({"tolerance": "small"}, ("'small'", "number")),
        ({"tolerance": "nan"}, ("'nan'", "number")),
        ({"eager": "perhaps"}, ("'perhaps'", "true or false")),
        ({"rounds": "1", " rounds": "2"}, ("twice",)),
    ],
)
def test_words_that_mean_nothing_are_refused(words, parts):
    with pytest.raises(OptionError) as caught:
        configure(Example, words)
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize("name", sorted(NORMAL_SOLVERS))
def test_every_solver_can_be_configured_with_its_own_defaults(name):
    kind = NORMAL_SOLVERS[name]
    options = options_of(kind)
    settings = settings_of(kind())
    assert {option.name for option in options} <= set(settings)
    tables = {key: value for key, value in settings.items() if key not in {option.name for option in options}}
    known = {
        "sky": {"sky": None},
        "exemplar": {"materials": [], "usual": []},
    }  # tables of numbers, which no word can give
    assert tables == known.get(name, {})
    words = {option.name: "none" if option.default is None else str(option.default) for option in options}
    assert configure(kind, words) == kind()
    for option in options:
        assert option.kind
        assert option.meaning.endswith((".", "]")), (name, option.name)


def test_hyphens_stand_for_underscores():
    @dataclass(frozen=True, kw_only=True)
    class Other(LeastSquares):
        most_rounds: int = 3

    assert configure(Other, {"most-rounds": "5"}).most_rounds == 5


@pytest.mark.parametrize("lights", [3, 5, 12])
def test_the_default_is_decided_in_one_place(lights):
    choice = default_solver(Rig.distant(ring(lights)))
    assert choice.solver.name in NORMAL_SOLVERS
    assert choice.reason.startswith("No solver was named")
    assert choice.reason.endswith(".")
    capture, _ = demo_capture(24, lights=lights)
    result, named = estimate_normals(capture), estimate_normals(capture, choice.solver)
    assert result.facts["solver"] == choice.solver.name
    assert result.facts["options"] == settings_of(choice.solver)
    assert result.normals.tobytes() == named.normals.tobytes()
