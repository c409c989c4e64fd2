import numpy as np
import pytest

from psstereo.errors import OptionError
from psstereo.stack import GRAY, gray_weights


@pytest.mark.parametrize("name", sorted(GRAY))
def test_named_weights(name):
    assert gray_weights(name, 3).matrix.tolist() == [list(GRAY[name])]
    assert gray_weights(name, 1).matrix.tolist() == [[1.0]]
    assert gray_weights(name, 3).name == name


def test_the_mean_of_any_number_of_channels():
    np.testing.assert_array_equal(gray_weights("mean", 2).matrix, [[0.5, 0.5]])
    np.testing.assert_array_equal(gray_weights("mean", 3).matrix, [[1 / 3] * 3])


def test_per_channel_keeps_them_apart():
    for channels in (1, 2, 3):
        np.testing.assert_array_equal(gray_weights("per-channel", channels).matrix, np.eye(channels))


def test_numbers_as_given():
    found = gray_weights([0.25, 0.0, 3], 3)
    assert found.matrix.tolist() == [[0.25, 0.0, 3.0]]
    assert found.name == "0.25,0,3"


@pytest.mark.parametrize(
    ("choice", "channels"),
    [
        ("grey", 3),
        ("", 3),
        ("g", 2),
        ("bt601", 4),
        ([0.3, 0.7], 3),
        ([0.0, 0.0, 0.0], 3),
        ([0.3, np.nan, 0.7], 3),
        ([0.3, np.inf, 0.7], 3),
        ([], 3),
    ],
)
def test_what_does_not_fit_is_refused(choice, channels):
    with pytest.raises(OptionError):
        gray_weights(choice, channels)
