import pytest

from psstereo.errors import OptionError
from psstereo.normals import GATES, gate


def test_names_say_what_they_do():
    assert {name: (g.shadow, g.saturation) for name, g in GATES.items()} == {
        "none": (False, False),
        "shadow": (True, False),
        "saturation": (False, True),
        "auto": (True, True),
    }
    for name in GATES:
        assert gate(name) is GATES[name]
        assert GATES[name].name == name
        assert GATES[name].sentence.endswith(".")


def test_an_unknown_gate_is_refused():
    with pytest.raises(OptionError, match=r"gate 'shadows' is unknown.*Did you mean shadow"):
        gate("shadows")
