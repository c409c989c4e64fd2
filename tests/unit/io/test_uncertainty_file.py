"""Maps of how far normals may be off."""

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.io.uncertainty_file import read_uncertainty

SHAPE = (3, 4)


def test_degrees_become_radians(tmp_path):
    degrees = np.array([[0.0, 1.0, 2.0, 3.0], [4.0, np.nan, np.inf, 5.0], [180.0, 0.5, 0.25, 0.125]], np.float32)
    np.save(tmp_path / "u.npy", degrees)
    found = read_uncertainty(tmp_path / "u.npy", SHAPE)
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, degrees.astype(float) * np.pi / 180, rtol=1e-15)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.ones((4, 3)), "3 × 4 pixels"),
        (-np.ones(SHAPE), "12 negative"),
        (np.ones(SHAPE, np.uint8), "uint8"),
        (np.full(SHAPE, np.nan), "knows no pixel"),
    ],
)
def test_what_is_no_uncertainty(tmp_path, values, words):
    np.save(tmp_path / "u.npy", values)
    with pytest.raises(InputError, match=words):
        read_uncertainty(tmp_path / "u.npy", SHAPE)
