import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import triangulate
from psstereo.errors import InputError

ORTHOGRAPHIC = Orthographic(pixel_size=0.5, length_unit="mm")
PINHOLE = Pinhole(fx=50.0, fy=45.0, cx=3.0, cy=2.0, skew=3.0)


def face_normals(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return np.cross(b - a, c - a), (a + b + c) / 3


def test_a_block_gives_two_triangles_and_vertices_in_row_major_order():
    mesh = triangulate(np.array([[1.0, 2.0], [3.0, 4.0]]), ORTHOGRAPHIC)
    assert mesh.vertices.tolist() == [[0, 0, 1], [0.5, 0, 2], [0, -0.5, 3], [0.5, -0.5, 4]]
    assert mesh.faces.dtype == np.int32
    assert mesh.faces.tolist() == [[0, 2, 1], [1, 2, 3]]
    assert mesh.normals is None
    assert mesh.colors is None


@pytest.mark.parametrize(("depth", "diagonal"), [([[0, 9], [5, 0]], {0, 3}), ([[0, 5], [5, 9]], {1, 2})])
def test_the_diagonal_with_the_smaller_step_is_chosen(depth, diagonal):
    mesh = triangulate(np.array(depth, float), ORTHOGRAPHIC)
    assert set(mesh.faces[0]) & set(mesh.faces[1]) == diagonal


@pytest.mark.parametrize("missing", [0, 1, 2, 3])
def test_three_of_four_give_one_triangle(missing):
    depth = np.ones(4)
    depth[missing] = np.nan
    mesh = triangulate(depth.reshape(2, 2), ORTHOGRAPHIC)
    assert len(mesh.vertices) == 3
    assert sorted(mesh.faces[0]) == [0, 1, 2]
    assert face_normals(mesh)[0][0, 2] > 0


@settings(max_examples=40, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 12), st.integers(1, 12)),
    seed=st.integers(0, 2**32),
    share=st.floats(0.2, 1.0),
    camera=st.sampled_from([ORTHOGRAPHIC, PINHOLE]),
)
def test_faces_look_at_the_camera_and_cover_each_block_once(shape, seed, share, camera):
    rng = np.random.default_rng(seed)
    depth = np.where(rng.random(shape) < share, rng.uniform(1, 5, shape), np.nan)
    depth[0, 0] = 2.0
    mesh = triangulate(depth, camera)
    known = np.isfinite(depth)
    assert len(mesh.vertices) == known.sum()
    assert np.isfinite(mesh.vertices).all()
    corners = sum(known[i : shape[0] - 1 + i, j : shape[1] - 1 + j].astype(int) for i in (0, 1) for j in (0, 1))
    assert len(mesh.faces) == 2 * (corners == 4).sum() + (corners == 3).sum()
    normals, centres = face_normals(mesh)
    toward = np.array([0, 0, 1.0]) if camera is ORTHOGRAPHIC else -centres
    assert (np.sum(normals * toward, axis=-1) > 0).all()
    # Corners of a triangle lie within one block, and no triangle occurs twice.
    pixels = np.argwhere(known)[mesh.faces]
    assert (np.ptp(pixels, axis=1) == 1).all()
    assert len({tuple(sorted(face)) for face in mesh.faces.tolist()}) == len(mesh.faces)


def test_no_triangle_joins_two_components():
    components = np.ones((4, 6), np.int32)
    components[:, 3:] = 2
    components[0, 0] = 0
    mesh = triangulate(np.ones((4, 6)), ORTHOGRAPHIC, components=components)
    labels = components[components > 0][mesh.faces]
    assert (np.ptp(labels, axis=1) == 0).all()
    assert len(mesh.faces) == 2 * 2 * 6 - 1
    assert len(mesh.vertices) == 23


def test_a_single_row_has_vertices_only():
    mesh = triangulate(np.ones((1, 5)), PINHOLE)
    assert mesh.vertices.shape == (5, 3)
    assert mesh.faces.shape == (0, 3)


def test_pinhole_vertices_lie_on_the_rays():
    depth = np.full((5, 7), 4.0)
    mesh = triangulate(depth, PINHOLE)
    np.testing.assert_allclose(mesh.vertices, (4.0 * PINHOLE.rays((5, 7))).reshape(-1, 3))


def test_normals_have_unit_length_and_gaps_point_to_the_camera():
    normals = np.broadcast_to([0.0, 3.0, 4.0], (2, 2, 3)).copy()
    normals[0, 0] = np.nan
    mesh = triangulate(np.ones((2, 2)), ORTHOGRAPHIC, normals=normals)
    assert mesh.normals.tolist() == [[0, 0, 1], [0, 0.6, 0.8], [0, 0.6, 0.8], [0, 0.6, 0.8]]


def test_colours_are_srgb_of_the_relative_albedo():
    albedo = np.array([[0.0, 0.5], [1.0, np.nan]])
    mesh = triangulate(np.ones((2, 2)), ORTHOGRAPHIC, albedo=np.where(albedo > 0.6, 1e3, albedo * 990))
    assert mesh.colors.dtype == np.uint8
    assert mesh.colors[0].tolist() == [0, 0, 0]
    assert mesh.colors[2].tolist() == [255, 255, 255]
    assert mesh.colors[3].tolist() == [0, 0, 0]
    assert abs(int(mesh.colors[1, 0]) - 188) <= 1  # the sRGB value of one half


def test_coloured_albedo_keeps_its_channels():
    albedo = np.ones((2, 2, 3)) * [1.0, 0.0, 0.5]
    colors = triangulate(np.ones((2, 2)), ORTHOGRAPHIC, albedo=albedo).colors
    assert colors[0].tolist() == [255, 0, 188]
    assert triangulate(np.ones((2, 2)), ORTHOGRAPHIC, albedo=np.zeros((2, 2, 1))).colors.tolist() == [[0, 0, 0]] * 4


@pytest.mark.parametrize(
    ("depth", "options"),
    [
        (np.full((3, 3), np.nan), {}),
        (np.zeros((0, 3)), {}),
        (np.ones(3), {}),
        (np.ones((3, 3)), {"normals": np.ones((3, 3))}),
        (np.ones((3, 3)), {"albedo": np.ones((3, 3, 2))}),
        (np.ones((3, 3)), {"components": np.ones((3, 2), int)}),
    ],
)
def test_what_cannot_be_a_surface_is_refused(depth, options):
    with pytest.raises(InputError):
        triangulate(depth, ORTHOGRAPHIC, **options)
