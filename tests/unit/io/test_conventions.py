import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from psstereo.errors import InputError, OptionError
from psstereo.io.conventions import (
    CONVENTIONS,
    convert_frame,
    find_convention,
    from_canonical,
    from_slant_tilt,
    to_canonical,
    to_slant_tilt,
)

some = arrays(np.float64, (2, 4, 3), elements=st.floats(-2, 2))
RIGHT, UP, NEAR = np.eye(3)


@pytest.mark.parametrize(
    ("name", "right", "up", "near"),
    [
        ("opengl", (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ("directx", (1, 0, 0), (0, -1, 0), (0, 0, 1)),
        ("opencv", (1, 0, 0), (0, -1, 0), (0, 0, -1)),
        ("meshroom", (1, 0, 0), (0, -1, 0), (0, 0, -1)),
        ("bini", (0, 1, 0), (1, 0, 0), (0, 0, -1)),
    ],
)
def test_axes_are_where_the_program_puts_them(name, right, up, near):
    """By hand from the table of frames: where do our right, up and toward-the-camera lie over there?"""
    for ours, theirs in ((RIGHT, right), (UP, up), (NEAR, near)):
        assert from_canonical(ours, name).tolist() == list(theirs)
        assert to_canonical(np.array(theirs, dtype=float), name).tolist() == ours.tolist()


@pytest.mark.parametrize(("source", "target"), list(itertools.product(CONVENTIONS, repeat=2)))
@settings(max_examples=10)
@given(vectors=some)
def test_every_pair_comes_back_exactly(source, target, vectors):
    there = convert_frame(vectors, source, target)
    assert (convert_frame(there, target, source) == vectors).all()
    assert (there == from_canonical(to_canonical(vectors, source), target)).all()


@pytest.mark.parametrize("name", CONVENTIONS)
def test_matrices_are_rotations_or_reflections(name):
    matrix = np.array(CONVENTIONS[name].matrix)
    assert (matrix @ matrix.T == np.eye(3)).all()
    assert np.linalg.det(matrix) == pytest.approx(-1 if name == "directx" else 1)
    assert CONVENTIONS[name].name == name


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_precision_and_nan_are_kept(dtype):
    vectors = np.array([[np.nan, 1, 2], [3, 4, 5]], dtype=dtype)
    result = to_canonical(vectors, "bini")
    assert result.dtype == dtype
    assert np.array_equal(result, np.array([[1, np.nan, -2], [4, 3, -5]], dtype=dtype), equal_nan=True)
    assert to_canonical(vectors, "opengl") is not vectors


angles = st.floats(0.01, np.pi - 0.01), st.floats(0, 2 * np.pi, exclude_max=True)


@given(*angles)
def test_slant_and_tilt_come_back(slant, tilt):
    vector = from_slant_tilt(np.array(slant), np.array(tilt))
    back = to_slant_tilt(7 * vector)
    assert np.linalg.norm(vector) == pytest.approx(1)
    assert float(back[0]) == pytest.approx(slant, abs=1e-13)
    assert abs((float(back[1]) - tilt + np.pi) % (2 * np.pi) - np.pi) < 1e-12


def test_slant_and_tilt_by_hand():
    assert from_slant_tilt(np.array(np.pi / 2), np.array(np.pi / 2)) == pytest.approx([0, 1, 0], abs=1e-15)
    assert [float(a) for a in to_slant_tilt(np.array([0.0, 0, 3]))] == [0, 0]
    for dtype in (np.float32, np.float64):
        tiny = to_slant_tilt(np.array([1, -1e-30, 0], dtype=dtype))[1]
        assert 0 <= tiny < 2 * np.pi
        assert tiny.dtype == dtype


def test_bad_input_is_refused():
    with pytest.raises(OptionError, match="'directx'"):
        find_convention("OpenGL")
    with pytest.raises(InputError, match="Three components"):
        to_canonical(np.ones((2, 4)), "opengl")
    with pytest.raises(InputError):
        to_slant_tilt(np.array(1.0))
