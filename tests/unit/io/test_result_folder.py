"""Result folders: written whole, read back, and damaged ones told."""

import json

import numpy as np
import pytest

from psstereo.errors import ExistingResultError, InputError, MissingFileError, UnreadableFileError
from psstereo.io.result_folder import read_result, write_result
from psstereo.pipeline import reconstruct
from psstereo.results import DepthKind, DepthResult, NormalsResult
from psstereo.surface_mesh import SurfaceMesh
from psstereo_synth import demo_capture


@pytest.fixture(scope="module")
def result():
    return reconstruct(demo_capture(24)[0])


def save(folder, result, **options):
    record = {"schema": 1, "depth": {"kind": "height"}}
    write_result(folder, result.normals, depth=result.depth, mesh=result.mesh, record=record, **options)


def test_a_result_comes_back(tmp_path, result):
    save(tmp_path / "r", result)
    saved = read_result(tmp_path / "r")
    assert saved.normals.dtype == saved.albedo.dtype == saved.depth.dtype == np.float32
    assert np.array_equal(saved.normals, result.normals.normals.astype(np.float32), equal_nan=True)
    assert np.array_equal(saved.albedo, result.normals.albedo.astype(np.float32), equal_nan=True)
    assert np.array_equal(saved.depth, result.depth.depth.astype(np.float32), equal_nan=True)
    assert saved.record == {"schema": 1, "depth": {"kind": "height"}}
    spread = np.load(tmp_path / "r" / "uncertainty.npy")
    assert np.allclose(spread, np.degrees(result.normals.uncertainty), rtol=1e-6, equal_nan=True)
    assert np.load(tmp_path / "r" / "flags.npy").dtype == np.uint16


def test_what_was_written_may_be_overwritten(tmp_path, result):
    save(tmp_path / "r", result)
    with pytest.raises(ExistingResultError):
        save(tmp_path / "r", result)
    save(tmp_path / "r", result, overwrite=True)  # nothing in a result may count as somebody else's
    assert len(list((tmp_path / "r").iterdir())) == 11


def test_without_depth_its_files_are_missing(tmp_path, result):
    write_result(tmp_path / "r", result.normals, record={})
    assert sorted(p.name for p in (tmp_path / "r").iterdir()) == [
        "albedo.npy", "albedo.png", "flags.npy", "normals.npy", "normals.png", "run.json", "uncertainty.npy",
    ]  # fmt: skip
    assert read_result(tmp_path / "r").depth is None


def test_a_mesh_without_triangles_makes_no_glb(tmp_path, result):
    points = SurfaceMesh(vertices=np.zeros((1, 3)), faces=np.zeros((0, 3), np.int64))
    write_result(tmp_path / "r", result.normals, mesh=points, record={})
    assert (tmp_path / "r" / "mesh.ply").is_file()
    assert not (tmp_path / "r" / "mesh.glb").exists()


def test_distances_are_bright_where_small(tmp_path, result):
    import cv2

    distance = np.array([[1.0, 2.0], [np.nan, 3.0]])
    depth = DepthResult(
        depth=distance, kind=DepthKind.DISTANCE, unit="mm", components=np.ones((2, 2), int), iterations=1, residual=0.0
    )
    write_result(tmp_path / "r", result.normals, depth=depth, record={})
    picture = cv2.imdecode(np.fromfile(tmp_path / "r" / "depth.png", np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture.tolist() == [[65535, 32768], [0, 1]]


def test_two_channels_are_shown_as_their_mean(tmp_path):
    normals = np.tile([0.0, 0.0, 1.0], (4, 5, 1))
    two = NormalsResult(
        normals=normals, albedo=np.ones((4, 5, 2)), uncertainty=np.zeros((4, 5)), flags=np.zeros((4, 5), np.uint16)
    )
    write_result(tmp_path / "r", two, record={})
    assert np.load(tmp_path / "r" / "albedo.npy").shape == (4, 5, 2)
    assert (tmp_path / "r" / "albedo.png").is_file()


def test_a_record_that_json_lacks_leaves_nothing(tmp_path, result):
    with pytest.raises(ValueError, match="JSON"):
        write_result(tmp_path / "r", result.normals, record={"x": float("nan")})
    assert not list(tmp_path.iterdir())


def test_names_that_are_no_utf8_are_escaped(tmp_path, result):
    write_result(tmp_path / "r", result.normals, record={"name": "caf\udce9 é"})
    raw = (tmp_path / "r" / "run.json").read_bytes()
    assert json.loads(raw.decode("utf-8")) == {"name": "caf\udce9 é"}


@pytest.mark.parametrize("name", ["run.json", "normals.npy"])
def test_without_its_two_files_it_is_no_result(tmp_path, result, name):
    save(tmp_path / "r", result)
    (tmp_path / "r" / name).unlink()
    with pytest.raises(MissingFileError, match="not a result folder"):
        read_result(tmp_path / "r")


@pytest.mark.parametrize(
    ("name", "data", "error"),
    [
        ("run.json", b"{", UnreadableFileError),
        ("run.json", b"[]", UnreadableFileError),
        ("run.json", b"\xff\xfe\xfa", UnreadableFileError),
        ("normals.npy", b"", UnreadableFileError),
        ("albedo.npy", b"\x93NUMPY\x01\x00", UnreadableFileError),
        ("depth.npy", b"no array at all", UnreadableFileError),
    ],
)
def test_a_damaged_file_is_named(tmp_path, result, name, data, error):
    save(tmp_path / "r", result)
    (tmp_path / "r" / name).write_bytes(data)
    with pytest.raises(error, match=name.replace(".", r"\.")):
        read_result(tmp_path / "r")


def test_a_truncated_array_is_told(tmp_path, result):
    save(tmp_path / "r", result)
    path = tmp_path / "r" / "normals.npy"
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(UnreadableFileError, match=r"normals\.npy"):
        read_result(tmp_path / "r")


def test_pickles_are_refused(tmp_path, result):
    save(tmp_path / "r", result)
    np.save(tmp_path / "r" / "albedo.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(UnreadableFileError, match=r"albedo\.npy"):
        read_result(tmp_path / "r")


def test_normals_of_another_shape_are_refused(tmp_path, result):
    save(tmp_path / "r", result)
    np.save(tmp_path / "r" / "normals.npy", np.zeros((5, 4)))
    with pytest.raises(InputError, match=r"\(5, 4\)"):
        read_result(tmp_path / "r")
