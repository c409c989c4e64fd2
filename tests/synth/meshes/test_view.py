import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from psstereo.camera import Camera, Orthographic, Pinhole, Pose
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.results import DepthKind
from psstereo_synth.meshes import (
    OpenGLError,
    RayCaster,
    TriangleMesh,
    view_mesh,
    view_mesh_opengl,
    view_mesh_rays,
)
from psstereo_synth.meshes.exact import meet
from psstereo_synth.meshes.opengl import draw, require_opengl
from psstereo_synth.meshes.pixels import pixel_rays

ROOT = Path(__file__).resolve().parents[3]
TURNED = Pose.looking_at(np.array([0.5, 0.7, 4.0]), np.array([0.02, 0.05, 0.0]))


@pytest.fixture(scope="module")
def opengl():
    try:
        require_opengl()
    except OpenGLError as error:
        pytest.skip(str(error))


def made(kind="icosphere", *arguments, **options):
    import trimesh

    shape = getattr(trimesh.creation, kind)(*arguments)
    return TriangleMesh(vertices=shape.vertices, faces=shape.faces, **options)


def cameras(n, pose=TURNED):
    """A parallel and a central projection, neither centred."""
    corner = pose.rotation @ np.array([-1.55, 1.45, 4.0])
    return {
        "orthographic": (Orthographic(pixel_size=3 / n), Pose(rotation=pose.rotation, position=corner)),
        "pinhole": (Pinhole(fx=1.1 * n, fy=1.2 * n, cx=0.43 * n, cy=0.56 * n), pose),
        "skewed": (Pinhole(fx=1.1 * n, fy=1.2 * n, cx=0.43 * n, cy=0.56 * n, skew=0.1 * n), pose),
    }


def check_consistent(view, mesh, shape):
    """Depth, points, distances and directions of a view must belong together, whatever made it."""
    points = view.pose.to_scene(view.camera.points(view.depth))
    mask = view.geometry.mask
    assert mask.shape == shape
    np.testing.assert_array_equal(np.isfinite(view.depth), mask)
    np.testing.assert_allclose(points[mask], view.geometry.points, rtol=0, atol=2e-14 * (1 + mesh.radius))
    np.testing.assert_allclose(np.linalg.norm(view.geometry.normals, axis=-1), 1, rtol=1e-14)
    assert ((view.geometry.normals * view.geometry.to_eye).sum(axis=-1) > 0).all()
    if view.camera.depth_kind is DepthKind.DISTANCE:
        back = view.geometry.to_eye * view.geometry.eye_distances[:, None]
        np.testing.assert_allclose(
            view.geometry.points + back, np.tile(view.pose.position, (mask.sum(), 1)), atol=1e-13
        )
    else:
        assert view.geometry.to_eye.shape == (3,)
        assert view.geometry.eye_distances is None


@pytest.mark.parametrize("camera", ["orthographic", "pinhole", "skewed"])
@pytest.mark.parametrize("kind", ["icosphere", "torus", "box"])
def test_rays_see_what_every_ray_against_every_triangle_does(camera, kind):
    mesh = made(kind, *{"icosphere": (2,), "torus": (1.0, 0.4, 24, 12), "box": ()}[kind])
    shape = (30, 36)
    view = view_mesh_rays(mesh, *cameras(36)[camera], shape)
    check_consistent(view, mesh, shape)
    origins, directions = pixel_rays(mesh, *cameras(36)[camera], shape)
    best, which = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for face, corners in enumerate(mesh.corners):
        inside, distance, _ = meet(np.broadcast_to(corners, (len(origins), 3, 3)), origins, directions)
        nearer = inside & (distance < best)
        best[nearer], which[nearer] = distance[nearer], face
    seen = (which >= 0).reshape(shape)
    np.testing.assert_array_equal(view.geometry.mask, seen)
    assert 100 < seen.sum() < seen.size
    hits = (origins + best[:, None] * directions)[which >= 0]
    np.testing.assert_allclose(view.geometry.points, hits, rtol=0, atol=1e-13)
    np.testing.assert_allclose(view.geometry.normals, mesh.face_normals[which[which >= 0]], rtol=0, atol=1e-14)


def test_a_sphere_against_the_formula():
    """Heights and normals of a fine sphere tend to √(1 − x² − y²) and the point itself."""
    worst = []
    for subdivisions in (3, 4, 5):
        mesh = made("icosphere", subdivisions, smooth=True)
        camera, pose = Orthographic(pixel_size=0.05), Pose(position=np.array([-1.5, 1.5, 0.0]))
        view = view_mesh_rays(mesh, camera, pose, (61, 61))
        rows, columns = np.indices((61, 61))
        x, y = 0.05 * columns - 1.5, 1.5 - 0.05 * rows
        inner = x * x + y * y < 0.8
        assert view.geometry.mask[inner].all()
        assert not view.geometry.mask[x * x + y * y > 1].any()
        height = np.sqrt(1 - x[inner] ** 2 - y[inner] ** 2)
        normals = view.geometry.scatter(view.geometry.normals)[inner]
        exact = np.stack([x[inner], y[inner], height], axis=1)
        worst.append([np.abs(view.depth[inner] - height).max(), np.abs(normals - exact).max()])
    assert worst[2][0] < 1e-3
    assert worst[2][1] < 2e-3
    orders = np.log2(np.array(worst[:-1]) / worst[1:])
    assert (orders[:, 0] > 1.7).all()
    assert (orders[:, 1] > 0.7).all()


def test_smooth_normals_that_face_away_give_way_to_the_triangles_own():
    mesh, (camera, pose) = made("icosphere", 1, smooth=True), cameras(80)["pinhole"]
    view = view_mesh_rays(mesh, camera, pose, (80, 80))
    check_consistent(view, mesh, (80, 80))
    faces, _, weights = RayCaster(mesh).first_hit(*pixel_rays(mesh, camera, pose, (80, 80)))
    seen = faces >= 0
    interpolated = mesh.normals_at(faces[seen], weights[seen])
    away = (interpolated * view.geometry.to_eye).sum(axis=1) <= 0
    assert 5 < np.count_nonzero(away) < 0.1 * away.size
    np.testing.assert_array_equal(view.geometry.normals[~away], interpolated[~away])
    np.testing.assert_array_equal(view.geometry.normals[away], mesh.face_normals[faces[seen][away]])


def test_a_triangle_seen_from_behind_has_its_normal_turned():
    vertices = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]])
    camera, pose = Orthographic(pixel_size=0.1), Pose(position=np.array([-1.0, 1.0, 0.0]))
    for faces in ([[0, 1, 2]], [[0, 2, 1]]):
        view = view_mesh_rays(TriangleMesh(vertices=vertices, faces=np.array(faces)), camera, pose, (21, 21))
        np.testing.assert_allclose(view.geometry.normals, np.tile([0.0, 0, 1], (len(view.geometry.normals), 1)))


@pytest.mark.parametrize("camera", ["orthographic", "pinhole", "skewed"])
@pytest.mark.parametrize(("kind", "arguments"), [("icosphere", (4,)), ("torus", (1.0, 0.4, 64, 32)), ("box", ())])
@pytest.mark.usefixtures("opengl")
def test_opengl_and_rays_agree(camera, kind, arguments):
    mesh, shape = made(kind, *arguments, smooth=True), (200, 240)
    seen, pose = cameras(240)[camera]
    rays, drawn = view_mesh_rays(mesh, seen, pose, shape), view_mesh_opengl(mesh, seen, pose, shape)
    check_consistent(drawn, mesh, shape)
    assert np.count_nonzero(rays.geometry.mask != drawn.geometry.mask) <= 1
    both = rays.geometry.mask & drawn.geometry.mask
    assert 5000 < both.sum() < both.size
    np.testing.assert_allclose(drawn.depth[both], rays.depth[both], rtol=0, atol=1e-12)
    one, other = (v.geometry.scatter(v.geometry.normals)[both] for v in (rays, drawn))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-11)


@pytest.mark.parametrize("camera", ["orthographic", "pinhole"])
@pytest.mark.usefixtures("opengl")
def test_what_opengl_draws_before_it_is_corrected(camera):
    """The drawn triangle is another one in a few pixels at edges; the depth buffer is right to its 24 bits.

    Before an edge is corrected, corners moved by 1/256 px cost half of that times the slope.
    """
    mesh, shape = made("torus", 1.0, 0.4, 64, 32), (200, 240)
    seen, pose = cameras(240)[camera]
    faces, depth = draw(mesh, seen, pose, shape)
    want, _, _ = RayCaster(mesh).first_hit(*pixel_rays(mesh, seen, pose, shape))
    view = view_mesh_rays(mesh, seen, pose, shape)
    same = faces == want.reshape(shape)
    assert np.count_nonzero(~same) < 1e-3 * same.size
    own = same & (faces >= 0)
    error = np.abs(depth - view.depth)[own]
    assert np.median(error) < 5e-7
    assert error.max() < 2e-4
    np.testing.assert_array_equal(np.isnan(depth), faces < 0)


@pytest.mark.usefixtures("opengl")
def test_the_orthographic_depth_is_undone_at_known_heights():
    """Level squares have the same depth all over, to single precision of some two and a half times the range."""
    rng = np.random.default_rng(0)
    heights = np.sort(rng.uniform(-3, 8, 12))
    base = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    vertices = np.concatenate([base + np.array([k, 0, z]) for k, z in enumerate(heights)])
    faces = np.concatenate([[[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]] for k in range(12)])
    mesh = TriangleMesh(vertices=vertices, faces=faces)
    drawn, depth = draw(mesh, Orthographic(pixel_size=0.1), Pose(position=np.array([-0.45, 0.45, 1.0])), (10, 120))
    np.testing.assert_array_equal(drawn // 2, np.tile(np.repeat(np.arange(12), 10), (10, 1)))
    np.testing.assert_allclose(depth, np.tile(np.repeat(heights - 1.0, 10), (10, 1)), rtol=0, atol=1e-5)


@pytest.mark.usefixtures("opengl")
def test_many_triangles_keep_their_numbers():
    """All three colours are needed beyond 65 535; each pixel of this grid is two triangles of its own."""
    n = 300
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
    vertices = np.stack([x.ravel(), -y.ravel(), np.zeros(x.size)], axis=1)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + n + 1, corner + n + 2], 1), np.stack([corner, corner + n + 2, corner + 1], 1)]
    )
    pose = Pose(position=np.array([0.25, -0.75, 0.0]))  # pixels' centres are well inside the lower triangles
    drawn, _ = draw(TriangleMesh(vertices=vertices, faces=faces), Orthographic(pixel_size=1.0), pose, (n, n))
    np.testing.assert_array_equal(drawn, np.arange(n * n).reshape(n, n))


@pytest.mark.usefixtures("opengl")
def test_opengl_refuses_what_it_cannot_draw_and_auto_casts_rays():
    mesh = made("icosphere", 2)
    inside, camera = Pose(position=np.array([0.1, 0.2, 0.0])), Pinhole(fx=20, fy=20, cx=10, cy=10)
    with pytest.raises(UnsupportedError, match="before the pinhole"):
        view_mesh_opengl(mesh, camera, inside, (21, 21))
    view, reason = view_mesh(mesh, camera, inside, (21, 21))
    assert view.geometry.mask.all()
    assert "casting rays, because" in reason
    assert "pinhole" in reason

    class Other(Orthographic):
        name = "other"
        depth_kind = None

    class Unknown(Camera):
        name, depth_kind, unit = "unknown", None, "px"

        def rays(self, shape):
            return Orthographic().rays(shape)

        def points(self, depth):
            return Orthographic().points(depth)

    for unknown in (Unknown(), Other()):
        with pytest.raises(UnsupportedError):
            view_mesh(mesh, unknown, inside, (21, 21))


@pytest.mark.usefixtures("opengl")
def test_auto_takes_opengl_where_it_works_and_says_so():
    mesh, (camera, pose) = made("icosphere", 2), cameras(40)["pinhole"]
    view, reason = view_mesh(mesh, camera, pose, (40, 40))
    assert "with OpenGL" in reason
    other, said = view_mesh(mesh, camera, pose, (40, 40), engine="rays")
    assert "rays, as asked for" in said
    np.testing.assert_allclose(view.depth, other.depth, atol=1e-12)
    assert "OpenGL, as asked for" in view_mesh(mesh, camera, pose, (40, 40), engine="opengl")[1]


def test_an_engine_that_does_not_exist_is_refused():
    camera, pose = cameras(40)["pinhole"]
    with pytest.raises(OptionError, match="vulkan"):
        view_mesh(made("box"), camera, pose, (40, 40), engine="vulkan")


@pytest.mark.parametrize("engine", ["auto", "rays"])
def test_a_mesh_out_of_sight_and_images_of_no_size_are_refused(engine):
    mesh, camera = made("box"), Orthographic(pixel_size=0.1)
    with pytest.raises(InputError, match="sees the mesh"):
        view_mesh(mesh, camera, Pose(position=np.array([50.0, 0, 0])), (20, 20), engine=engine)
    for shape in ((0, 5), (5,), (-1, 3)):
        with pytest.raises(InputError, match="shape"):
            view_mesh(mesh, camera, Pose(), shape, engine=engine)


@pytest.mark.parametrize(
    "environment",
    [
        {"PYOPENGL_PLATFORM": "nonsense"},
        {"PYOPENGL_PLATFORM": "osmesa", "LD_LIBRARY_PATH": ""},
        {"PYOPENGL_PLATFORM": "egl", "EGL_DEVICE_ID": "99"},
        {"PYOPENGL_PLATFORM": "egl", "__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent.json"},
    ],
    ids=["platform", "library", "device", "driver"],
)
@pytest.mark.slow
def test_without_opengl_auto_casts_rays_and_says_why(environment):
    program = """
import numpy as np
from psstereo.camera import Orthographic, Pose
from psstereo_synth.meshes import OpenGLError, TriangleMesh, view_mesh
mesh = TriangleMesh(vertices=np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]), faces=np.array([[0, 1, 2]]))
where = Orthographic(pixel_size=0.1), Pose(position=np.array([-1.0, 1.0, 0.0])), (21, 21)
view, reason = view_mesh(mesh, *where)
assert view.geometry.mask.sum() > 100
assert "casting rays, because OpenGL cannot be used here" in reason and "libegl1" in reason, reason
try:
    view_mesh(mesh, *where, engine="opengl")
except OpenGLError as error:
    assert "libgl1-mesa-dri" in error.remedy
else:
    raise SystemExit("OpenGL worked")
"""
    paths = os.pathsep.join(str(ROOT / part) for part in ("", "synth"))
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"PYTHONPATH": paths} | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if environment["PYOPENGL_PLATFORM"] == "osmesa" and "OpenGL worked" in done.stderr:
        pytest.skip("OSMesa is installed here")
    assert done.returncode == 0, done.stderr


def test_an_opengl_that_fails_while_drawing_is_reported(monkeypatch, opengl):
    from psstereo_synth.meshes import opengl as module

    def broken(*_):
        raise RuntimeError("GL_OUT_OF_MEMORY\nmore")

    monkeypatch.setattr(module, "_render", broken)
    mesh, (camera, pose) = made("icosphere", 1), cameras(20)["pinhole"]
    with pytest.raises(OpenGLError, match="RuntimeError: GL_OUT_OF_MEMORY"):
        view_mesh_opengl(mesh, camera, pose, (20, 20))
    _, reason = view_mesh(mesh, camera, pose, (20, 20))
    assert "GL_OUT_OF_MEMORY" in reason
    monkeypatch.undo()
    assert view_mesh(mesh, camera, pose, (20, 20), engine="opengl")[0].geometry.mask.any()
