import pickle

import numpy as np
import pytest

from psstereo.errors import InputError, MissingFileError, OptionError, PsstereoError, UnreadableFileError
from psstereo.surface_mesh import SurfaceMesh
from psstereo_synth.meshes import READABLE_SUFFIXES, TriangleMesh, read_mesh

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
ONE = np.array([[0, 1, 2]])


def sphere(subdivisions=3, **options):
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions)
    return TriangleMesh(vertices=ball.vertices, faces=ball.faces, **options)


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (TRIANGLE, np.zeros((0, 3), int)),
        (TRIANGLE, np.array([[0, 1, 3]])),
        (TRIANGLE, np.array([[0, 1, -1]])),
        (TRIANGLE, np.array([[0.0, 1.0, 2.0]])),
        (TRIANGLE, np.array([[0, 1, 2, 0]])),
        (TRIANGLE[:, :2], ONE),
        (np.where(TRIANGLE == 1, np.nan, TRIANGLE), ONE),
        (np.where(TRIANGLE == 1, np.inf, TRIANGLE), ONE),
        (np.zeros((0, 3)), ONE),
        (TRIANGLE, np.array([[0, 1, 1]])),
        (TRIANGLE[[0, 1, 1]] + [[0, 0, 0], [0, 0, 0], [1, 0, 0]], ONE),
    ],
)
def test_hostile_meshes_are_refused(vertices, faces):
    with pytest.raises(InputError) as caught:
        TriangleMesh(vertices=vertices, faces=faces)
    assert caught.value.remedy


@pytest.mark.parametrize("normals", [np.zeros((3, 3)), np.full((3, 3), np.nan), np.ones((2, 3)), np.ones(3)])
def test_hostile_vertex_normals_are_refused(normals):
    with pytest.raises(InputError, match="Vertex normals"):
        TriangleMesh(vertices=TRIANGLE, faces=ONE, vertex_normals=normals)


def test_areas_centres_and_normals_of_one_triangle():
    mesh = TriangleMesh(vertices=TRIANGLE, faces=ONE)
    assert mesh.areas == [0.5]
    np.testing.assert_allclose(mesh.centres, [[1 / 3, 1 / 3, 0]], rtol=1e-15)
    np.testing.assert_array_equal(mesh.face_normals, [[0, 0, 1]])
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 1


def test_a_triangle_without_area_among_others_has_no_normal():
    mesh = TriangleMesh(vertices=TRIANGLE, faces=np.array([[0, 1, 2], [0, 1, 1]]), smooth=True)
    np.testing.assert_array_equal(np.isnan(mesh.face_normals).all(axis=1), [False, True])
    np.testing.assert_allclose(mesh.smooth_normals, [[0, 0, 1]] * 3, atol=1e-15)


def test_smooth_normals_of_a_sphere_tend_to_the_radii():
    """Linear in the edge: where the icosahedron's sides meet, triangles on either side differ in size."""
    worst = [np.abs(sphere(k).smooth_normals - sphere(k).vertices).max() for k in (2, 3, 4)]
    assert worst[2] < 3e-3
    assert np.log2(worst[0] / worst[1]) > 0.9


def test_angle_weights_do_not_depend_on_how_a_square_is_cut():
    """The corner of a cube points along its diagonal, however its squares are divided; area weights would not do."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]])
    faces = np.array([[0, 4, 1], [0, 2, 4], [0, 1, 5], [0, 5, 3], [0, 6, 2], [0, 3, 6]])
    other = np.array([[0, 2, 1], [4, 1, 2], [0, 1, 5], [0, 5, 3], [0, 3, 2], [6, 2, 3]])
    for cut in (faces, other):
        mesh = TriangleMesh(vertices=corners, faces=cut, smooth=True)
        np.testing.assert_allclose(mesh.smooth_normals[0], -np.ones(3) / np.sqrt(3), rtol=1e-14)


def test_interpolated_normals_are_of_unit_length_and_given_ones_are_used():
    given = np.array([[0.0, 0, 2], [1, 0, 1], [0, 1, 1]])
    mesh = TriangleMesh(vertices=TRIANGLE, faces=ONE, vertex_normals=given, smooth=True)
    normals = mesh.normals_at(np.array([0, 0]), np.array([[1.0, 0, 0], [0.2, 0.3, 0.5]]))
    np.testing.assert_allclose(normals[0], [0, 0, 1], atol=1e-15)
    mixed = 0.2 * np.array([0, 0, 1]) + 0.3 * given[1] / np.sqrt(2) + 0.5 * given[2] / np.sqrt(2)
    np.testing.assert_allclose(normals[1], mixed / np.linalg.norm(mixed), rtol=1e-14)
    flat = TriangleMesh(vertices=TRIANGLE, faces=ONE, vertex_normals=given)
    np.testing.assert_array_equal(flat.normals_at(np.array([0]), np.ones((1, 3)) / 3), [[0, 0, 1]])


def test_centred_fits_the_longest_side_and_leaves_unused_vertices_out_of_it():
    vertices = np.vstack([TRIANGLE * [4.0, 2.0, 1.0] + 100.0, [[1e6, 0, 0]]])
    mesh = TriangleMesh(vertices=vertices, faces=ONE).centred(3.0)
    np.testing.assert_allclose(mesh.corners.min(axis=(0, 1)), [-3, -1.5, 0], atol=1e-12)
    np.testing.assert_allclose(mesh.corners.max(axis=(0, 1)), [3, 1.5, 0], atol=1e-12)
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError):
            mesh.centred(bad)


def test_a_surface_mesh_is_taken_over():
    surface = SurfaceMesh(vertices=TRIANGLE, faces=ONE.astype(np.int32), normals=np.tile([0.0, 0, 1], (3, 1)))
    mesh = TriangleMesh.from_surface(surface)
    assert mesh.smooth
    np.testing.assert_array_equal(mesh.vertices, TRIANGLE)
    np.testing.assert_array_equal(mesh.vertex_normals, surface.normals)


def test_pickles():
    mesh = sphere(1, smooth=True)
    again = pickle.loads(pickle.dumps(mesh))
    np.testing.assert_array_equal(again.corners, mesh.corners)
    assert again.smooth


@pytest.mark.parametrize("suffix", READABLE_SUFFIXES)
def test_files_come_back(tmp_path, suffix):
    import trimesh

    box = trimesh.creation.box((2, 3, 4))
    path = tmp_path / f"box{suffix.upper()}"
    if suffix == ".gltf":
        path.write_bytes(trimesh.exchange.gltf.export_gltf(trimesh.Scene([box]), embed_buffers=True)["model.gltf"])
    else:
        path.write_bytes(_bytes(box.export(file_type=suffix[1:])))
    mesh = read_mesh(path, smooth=True)
    assert len(mesh.faces) == 12
    assert mesh.smooth
    np.testing.assert_allclose(mesh.areas.sum(), 52, rtol=1e-6)
    np.testing.assert_allclose(mesh.corners.max(axis=(0, 1)), [1, 1.5, 2], rtol=1e-6)
    outward = (mesh.face_normals * mesh.centres).sum(axis=1)
    assert (outward > 0).all()


def _bytes(content):
    return content.encode() if isinstance(content, str) else content


def test_a_scene_is_joined_each_part_at_its_place(tmp_path):
    import trimesh

    move = np.eye(4)
    move[0, 3] = 10.0
    scene = trimesh.Scene([trimesh.creation.box()])
    scene.add_geometry(trimesh.creation.box(), transform=move)
    path = tmp_path / "two.glb"
    path.write_bytes(scene.export(file_type="glb"))
    mesh = read_mesh(path)
    assert len(mesh.faces) == 24
    np.testing.assert_allclose(mesh.corners[..., 0].max(), 10.5, rtol=1e-6)


def test_no_other_file_is_opened(tmp_path):
    import trimesh

    for name, content in trimesh.Scene([trimesh.creation.box()]).export(file_type="gltf").items():
        (tmp_path / name).write_bytes(content)
    with pytest.raises(UnreadableFileError):
        read_mesh(tmp_path / "model.gltf")


@pytest.mark.parametrize(
    ("name", "content", "error"),
    [
        (
            "points.ply",
            b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
            b"property float z\nend_header\n0 0 0\n1 1 1\n",
            InputError,
        ),
        ("garbage.ply", b"\x00\xff" * 100, PsstereoError),
        ("garbage.stl", b"\x00\xff" * 100, PsstereoError),
        ("garbage.glb", b"glTF" + b"\x00\xff" * 100, PsstereoError),
        ("garbage.off", b"OFF nonsense", PsstereoError),
        ("garbage.obj", b"import os; f 1 2 3", PsstereoError),
        ("empty.obj", b"", PsstereoError),
        ("range.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", PsstereoError),
        ("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", PsstereoError),
        ("mesh.zip", b"PK", OptionError),
        ("mesh.py", b"raise SystemExit", OptionError),
        ("mesh", b"", OptionError),
    ],
)
def test_files_that_are_no_mesh_say_so(tmp_path, name, content, error):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(error) as caught:
        read_mesh(path)
    assert name in str(caught.value) or isinstance(caught.value, InputError)
    assert caught.value.remedy


def test_a_missing_file_says_so(tmp_path):
    with pytest.raises(MissingFileError):
        read_mesh(tmp_path / "nothing.ply")
