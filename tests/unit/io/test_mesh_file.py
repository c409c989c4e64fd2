import numpy as np
import pytest
import trimesh

from psstereo.camera import Orthographic
from psstereo.depth import triangulate
from psstereo.errors import InputError, MissingFileError, OptionError
from psstereo.io.mesh_file import MESH_SUFFIXES, write_mesh
from psstereo.surface_mesh import SurfaceMesh


@pytest.fixture
def mesh():
    rng = np.random.default_rng(6)
    depth = rng.uniform(0, 2, (7, 9))
    depth[3, 4] = np.nan
    normals = rng.normal(size=(7, 9, 3)) + np.array([0, 0, 3])
    return triangulate(depth, Orthographic(), normals=normals, albedo=rng.random((7, 9, 3)))


def read(path):
    # Not force="mesh": that recomputes the normals and so would hide what the file holds.
    loaded = trimesh.load(path, process=False, maintain_order=True)
    return next(iter(loaded.geometry.values())) if isinstance(loaded, trimesh.Scene) else loaded


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_what_is_written_reads_back(mesh, suffix, tmp_path):
    path = tmp_path / f"surface{suffix}"
    write_mesh(mesh, path)
    back = read(path)
    np.testing.assert_allclose(back.vertices, mesh.vertices, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(back.faces, mesh.faces)
    np.testing.assert_allclose(back.vertex_normals, mesh.normals, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(back.visual.vertex_colors[:, :3], mesh.colors)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_bare_meshes_are_written_too(mesh, suffix, tmp_path):
    bare = SurfaceMesh(vertices=mesh.vertices.astype(np.float32), faces=mesh.faces)
    path = tmp_path / f"surface{suffix.upper()}"
    write_mesh(bare, path)
    back = read(path)
    np.testing.assert_allclose(back.vertices, mesh.vertices, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(back.faces, mesh.faces)


def test_ply_is_binary_and_holds_the_normals(mesh, tmp_path):
    write_mesh(mesh, tmp_path / "a.ply")
    head = (tmp_path / "a.ply").read_bytes().split(b"end_header")[0]
    assert b"binary_little_endian" in head
    assert b"property float nx" in head
    assert b"property uchar red" in head


def test_a_finished_file_is_replaced(mesh, tmp_path):
    path = tmp_path / "a.ply"
    path.write_bytes(b"old")
    write_mesh(mesh, path)
    assert path.read_bytes().startswith(b"ply")


def test_points_alone_go_into_a_ply_file(tmp_path):
    points = SurfaceMesh(vertices=np.array([[1.0, 2.0, 3.0]]), faces=np.zeros((0, 3), np.int32))
    write_mesh(points, tmp_path / "a.ply")
    assert b"element vertex 1" in (tmp_path / "a.ply").read_bytes()
    with pytest.raises(InputError, match="0 triangles"):
        write_mesh(points, tmp_path / "a.glb")


def test_nothing_is_refused(tmp_path):
    empty = SurfaceMesh(vertices=np.zeros((0, 3)), faces=np.zeros((0, 3), np.int32))
    with pytest.raises(InputError, match="0 vertices"):
        write_mesh(empty, tmp_path / "a.ply")


@pytest.mark.parametrize("name", ["a.stl", "a", "a.ply.txt"])
def test_unknown_suffixes_are_refused_with_the_known_ones(mesh, name, tmp_path):
    with pytest.raises(OptionError, match=r"\.ply, \.glb, \.obj"):
        write_mesh(mesh, tmp_path / name)


def test_a_missing_folder_is_named(mesh, tmp_path):
    with pytest.raises(MissingFileError, match="does not exist"):
        write_mesh(mesh, tmp_path / "none" / "a.ply")


@pytest.mark.parametrize(
    "arrays",
    [
        {"vertices": np.zeros((3, 2)), "faces": np.zeros((1, 3), np.int32)},
        {"vertices": np.zeros((3, 3)), "faces": np.array([[0, 1, 3]], np.int32)},
        {"vertices": np.zeros((3, 3)), "faces": np.zeros((0, 3), np.int32), "normals": np.zeros((2, 3))},
    ],
)
def test_arrays_that_do_not_fit_are_refused(arrays):
    with pytest.raises(InputError, match="A mesh has"):
        SurfaceMesh(**arrays)
