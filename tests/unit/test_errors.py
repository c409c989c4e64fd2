import pickle

import pytest

from psstereo import errors
from psstereo.errors import PsstereoError

KINDS = [getattr(errors, name) for name in errors.__all__]
BUILTINS = {
    "InputError": ValueError,
    "RigError": ValueError,
    "OptionError": ValueError,
    "UnsupportedError": TypeError,
    "MissingFileError": FileNotFoundError,
    "UnreadableFileError": OSError,
    "ExistingResultError": FileExistsError,
}


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.__name__)
def test_three_parts_in_this_order_and_a_builtin(kind):
    error = kind(given="2 lights.", needed="At least 3 are needed.", remedy="Add images.")
    assert str(error) == "2 lights. At least 3 are needed. Add images."
    assert (error.given, error.needed, error.remedy) == ("2 lights.", "At least 3 are needed.", "Add images.")
    assert isinstance(error, PsstereoError)
    if kind is not PsstereoError:
        assert isinstance(error, BUILTINS[kind.__name__])


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.__name__)
def test_errors_come_back_from_other_processes(kind):
    again = pickle.loads(pickle.dumps(kind(given="a.", needed="b.", remedy="c.")))
    assert type(again) is kind
    assert str(again) == "a. b. c."


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.__name__)
def test_all_parts_must_be_given_by_name(kind):
    with pytest.raises(TypeError):
        kind("a", "b", "c")
    with pytest.raises(TypeError):
        kind(given="a", needed="b")
