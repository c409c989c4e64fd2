"""Members of a family from tables: keys are fields, angles are in degrees, everything else is refused."""

import re
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt
import pytest

from psstereo.brdf import BRDFS
from psstereo.errors import InputError, OptionError
from psstereo.io.toml_section import Section
from psstereo.types import FloatArray
from psstereo_synth.faults import FAULTS
from psstereo_synth.patterns import PATTERNS
from psstereo_synth.scenes import build as module
from psstereo_synth.scenes.build import build, build_member, parameters
from psstereo_synth.sensor import Sensor
from psstereo_synth.shapes import RELIEFS


@dataclass(frozen=True, kw_only=True)
class Everything:
    """One field of every kind that a scene file can fill."""

    real: float
    whole: int = 1
    maybe: float | None = None
    word: str = "a"
    chosen: Literal["x", "y"] = "x"
    bits: Literal[8, 16] | None = None
    yes: bool = False
    path: Path = Path("none")
    pair: tuple[float, float] = (0.0, 0.0)
    level: float | tuple[float, ...] = 0.0
    array: FloatArray = field(default_factory=lambda: np.zeros(1))
    like: npt.ArrayLike = 0.0
    hidden: int = field(init=False, default=7)


def section(**values):
    return Section(values, "table", Path("folder") / "scene.toml")


def test_every_kind_of_value_arrives():
    made = build(
        Everything,
        section(
            real=2, whole=3, maybe=0.5, word="b", chosen="y", bits=8, yes=True, path="sub/x.png", pair=[1, 2],
            level=[1.0, 2.0, 3.0], array=[[1, 2], [3, 4]], like=[0.1, 0.2],
        ),
    )  # fmt: skip
    assert (made.real, made.whole, made.maybe, made.word, made.chosen, made.bits, made.yes) == (
        2, 3, 0.5, "b", "y", 8, True,
    )  # fmt: skip
    assert made.path == Path("folder/sub/x.png")
    assert made.pair == (1, 2)
    assert made.level == (1.0, 2.0, 3.0)
    assert made.array.dtype == np.float64
    assert made.array.tolist() == [[1, 2], [3, 4]]
    assert np.asarray(made.like).tolist() == [0.1, 0.2]
    assert made.hidden == 7


def test_an_absolute_path_stays_one(tmp_path):
    assert build(Everything, section(real=1.0, path=str(tmp_path / "x"))).path == tmp_path / "x"


WRONG = [
    ("real", "1"), ("real", True), ("real", [1.0]), ("real", float("nan")), ("real", float("inf")), ("real", {"a": 1}),
    ("whole", 1.5), ("whole", True), ("whole", "1"), ("whole", [1]), ("maybe", "x"), ("maybe", float("-inf")),
    ("word", 1), ("word", ["a"]), ("chosen", 1), ("bits", "8"), ("bits", 8.0), ("bits", True), ("yes", 1),
    ("yes", "true"), ("path", 5), ("path", ""), ("path", ["a"]), ("pair", 1.0), ("pair", ["1", "2"]),
    ("pair", [[1, 2]]), ("pair", [True, False]), ("level", "1"), ("level", [[1.0]]), ("array", "abc"),
    ("array", [[1, 2], [3]]), ("array", [1, "2"]), ("array", {"a": 1}), ("like", "0.5"), ("like", [True]),
]  # fmt: skip


@pytest.mark.parametrize(("key", "value"), WRONG, ids=[f"{key}={value!r}" for key, value in WRONG])
def test_every_other_kind_is_refused_by_name(key, value):
    with pytest.raises(InputError, match=rf"table\.{key} in scene\.toml is") as caught:
        build(Everything, section(**({"real": 1.0} | {key: value})))
    assert "It must be" in caught.value.needed


def test_a_date_is_refused():
    import datetime

    with pytest.raises(InputError, match=r"table\.real"):
        build(Everything, section(real=datetime.date(2020, 1, 1)))


def test_what_is_missing_is_named():
    with pytest.raises(InputError, match=r"\[table\] in scene\.toml has no real") as caught:
        build(Everything, section(word="b"))
    assert "pair" in caught.value.needed


def test_the_nearest_key_is_offered():
    with pytest.raises(OptionError, match="Did you mean whole"):
        build(Everything, section(real=1.0, wohle=2))
    with pytest.raises(OptionError, match="hidden"):
        build(Everything, section(real=1.0, hidden=2))


def test_fields_that_come_from_elsewhere_are_neither_needed_nor_taken():
    assert parameters(Everything, section(whole=2), given=("real",)) == {"whole": 2}
    with pytest.raises(OptionError, match=r"table\.real"):
        parameters(Everything, section(real=1.0), given=("real",))


def test_members_are_chosen_by_name():
    made = build_member(RELIEFS, section(shape="sphere", radius=0.5), "shape", "shape")
    assert made == RELIEFS["sphere"](radius=0.5)
    with pytest.raises(OptionError, match="Did you mean sphere"):
        build_member(RELIEFS, section(shape="spere"), "shape", "shape")
    with pytest.raises(InputError, match="does not say which shape") as caught:
        build_member(RELIEFS, section(radius=0.5), "shape", "shape")
    assert 'shape = "plane"' in caught.value.remedy
    with pytest.raises(OptionError, match="Did you mean radius"):
        build_member(RELIEFS, section(shape="sphere", radios=0.5), "shape", "shape")
    with pytest.raises(InputError, match="radius of a sphere"):
        build_member(RELIEFS, section(shape="sphere", radius=-1.0), "shape", "shape")


def test_what_a_class_itself_cannot_take_is_told_as_an_error_of_the_table():
    @dataclass(frozen=True)
    class Picky:
        pair: tuple[float, float] = (0.0, 0.0)

        def __post_init__(self):
            first, second = self.pair
            del first, second

    with pytest.raises(InputError, match="do not fit"):
        build(Picky, section(pair=[1.0, 2.0, 3.0]))


def test_angles_are_in_degrees():
    made = build_member(PATTERNS, section(pattern="gradient", direction_deg=90), "pattern", "pattern")
    assert made.direction == pytest.approx(np.pi / 2, rel=1e-15)
    with pytest.raises(OptionError, match="Did you mean direction_deg"):
        build_member(PATTERNS, section(pattern="gradient", direction=1.0), "pattern", "pattern")
    rough = parameters(BRDFS["oren-nayar"], section(roughness_deg=[10, 20, 30]), given=("albedo",))
    assert rough["roughness"] == pytest.approx(np.radians([10, 20, 30]))


def documented_angles(kind):
    """Fields whose description ends with [rad], in the docstrings of a class and its parents."""
    found = set()
    for parent in kind.__mro__:
        text = re.sub(r"\s*\n\s{8,}", " ", parent.__doc__ or "")
        for names, description in re.findall(r"^ {4}(\w[\w, ]*) : ([^\n]*)$", text, re.MULTILINE):
            if "[rad]" in description:
                found |= {name.strip() for name in names.split(",")}
    return found & {f.name for f in fields(kind)}


def test_the_list_of_angles_is_that_of_the_docstrings():
    kinds = [*RELIEFS.values(), *PATTERNS.values(), *BRDFS.values(), *FAULTS.values(), Sensor]
    found = {f"{kind.__name__}.{name}" for kind in kinds for name in documented_angles(kind)}
    assert found == module._ANGLES


def test_every_field_of_every_member_is_of_a_known_kind():
    for kind in [*RELIEFS.values(), *PATTERNS.values(), *FAULTS.values(), *BRDFS.values()]:
        for one in fields(kind):
            assert not one.init or module._kinds(one.type), f"{kind.__name__}.{one.name}"
