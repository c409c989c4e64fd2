import numpy as np
import pytest
import scipy.io

from psstereo.errors import InputError, OptionError, UnreadableFileError
from psstereo.io import read_directions
from psstereo.io.text import read_lines, read_table

L = np.array([[0.1, 0.2, 0.9], [0.5, -0.1, 0.8], [-0.5, 0.3, 0.7], [0.0, 0.6, 0.7]])


def text(path, values, head="", separator=" ", end="\n"):
    rows = [separator.join(str(v) for v in row) for row in values]
    path.write_bytes((head + end.join(rows) + end).encode())
    return path


@pytest.mark.parametrize("separator", [" ", "\t", ",", ", ", ";", "; "])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_any_separator_and_line_end(tmp_path, separator, end):
    found = read_directions(text(tmp_path / "l.txt", L, separator=separator, end=end), 4)
    assert found.vectors.tolist() == L.tolist()


def test_columns_are_transposed_and_said(tmp_path):
    found = read_directions(text(tmp_path / "l.txt", L.T), 4)
    assert found.vectors.tolist() == L.tolist()
    assert "transposed" in found.notes[0]


def test_count_line(tmp_path):
    for separator in (" ", ","):
        found = read_directions(text(tmp_path / "l.txt", L, "# lights\n\n4\n", separator), 4)
        assert found.vectors.tolist() == L.tolist()
    with pytest.raises(UnreadableFileError, match="says 5 lights on its first line and has 4 lines"):
        read_directions(text(tmp_path / "l.txt", L, "5\n"), 4)


def test_decimal_commas(tmp_path):
    (tmp_path / "l.txt").write_text("0,1 0,2 0,9\n0.5 -0,1 0,8\n-0,5 0,3 0,7\n0 0,6 0,7\n")
    found = read_directions(tmp_path / "l.txt", 4)
    assert found.vectors.tolist() == L.tolist()
    assert "decimal commas" in found.notes[0]


def test_three_by_three_is_refused_unless_something_tells(tmp_path):
    three = L[:3]
    with pytest.raises(InputError, match="--lights-layout rows or columns"):
        read_directions(text(tmp_path / "l.txt", three), 3)
    with pytest.raises(InputError, match="3 × 3"):
        read_directions(text(tmp_path / "l.txt", three))
    assert read_directions(tmp_path / "l.txt", 3, layout="rows").vectors.tolist() == three.tolist()
    assert read_directions(tmp_path / "l.txt", 3, layout="columns").vectors.tolist() == three.T.tolist()
    # Three numbers below a count are one light, and a symmetric matrix reads the same both ways.
    assert read_directions(text(tmp_path / "l.txt", three, "3\n"), 3).vectors.tolist() == three.tolist()
    assert read_directions(text(tmp_path / "l.txt", np.eye(3)), 3).vectors.tolist() == np.eye(3).tolist()
    with pytest.raises(InputError, match="there are 5 images"):
        read_directions(text(tmp_path / "l.txt", three), 5)
    with pytest.raises(OptionError, match="cols"):
        read_directions(tmp_path / "l.txt", 3, layout="cols")


def test_arrays_and_matlab(tmp_path):
    np.save(tmp_path / "l.npy", L.astype(np.float32))
    assert np.allclose(read_directions(tmp_path / "l.npy", 4).vectors, L)
    scipy.io.savemat(tmp_path / "l.mat", {"L": L.T, "n": 4})
    assert np.allclose(read_directions(tmp_path / "l.mat", 4).vectors, L)
    np.save(tmp_path / "l.npy", np.zeros((2, 2, 3)))
    with pytest.raises(UnreadableFileError, match="shape"):
        read_directions(tmp_path / "l.npy", 4)
    (tmp_path / "l.mat").write_bytes(b"nothing of the kind")
    with pytest.raises(UnreadableFileError, match=r"l\.mat"):
        read_directions(tmp_path / "l.mat", 4)


def test_a_bad_line_is_named(tmp_path):
    (tmp_path / "l.txt").write_text("0 0 1\n0 1 1\n0 one 1\n")
    with pytest.raises(UnreadableFileError, match="Line 3"):
        read_directions(tmp_path / "l.txt", 3)
    (tmp_path / "l.txt").write_text("0 0 1\n0 1\n")
    with pytest.raises(UnreadableFileError, match="Line 2"):
        read_directions(tmp_path / "l.txt", 2)


def test_lines_break_at_line_ends_only(tmp_path):
    (tmp_path / "names.txt").write_bytes("a\x85b.png\r\nc\u2028d.png\n".encode())
    assert read_lines(tmp_path / "names.txt") == ["a\x85b.png", "c\u2028d.png"]


def test_old_and_wide_encodings(tmp_path):
    (tmp_path / "names.txt").write_bytes("été.png\n".encode("latin-1"))
    assert read_lines(tmp_path / "names.txt") == ["été.png"]
    (tmp_path / "wide.txt").write_bytes("1 2 3\n".encode("utf-16"))
    assert read_table(tmp_path / "wide.txt").values.tolist() == [[1, 2, 3]]
    (tmp_path / "wide.txt").write_bytes("1 2 3\n".encode("utf-16")[:-1])
    with pytest.raises(UnreadableFileError, match="not text"):
        read_lines(tmp_path / "wide.txt")
