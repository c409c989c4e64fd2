"""Textures, units and the files beside an OBJ."""

import json
import struct

import numpy as np
import pytest
import trimesh

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import triangulate
from psstereo.errors import InputError
from psstereo.io.mesh_file import write_mesh
from psstereo.surface_mesh import SurfaceMesh

PIXEL = 0.25


@pytest.fixture
def albedo():
    return np.random.default_rng(4).uniform(0.1, 1.0, (11, 14, 3))


@pytest.fixture
def mesh(albedo):
    rng = np.random.default_rng(5)
    depth = rng.uniform(0, 2, (11, 14))
    depth[:2], depth[:, :3], depth[5, 6] = np.nan, np.nan, np.nan
    normals = rng.normal(size=(11, 14, 3)) + np.array([0, 0, 3])
    camera = Orthographic(pixel_size=PIXEL, length_unit="mm")
    return triangulate(depth, camera, normals=normals, albedo=albedo, texture=True)


def texels(uv, picture):
    """Pick the pixels of a picture at places from its lower left corner; each must be in the middle of one."""
    height, width = picture.shape[:2]
    column, row = uv[:, 0] * width - 0.5, (1.0 - uv[:, 1]) * height - 0.5
    np.testing.assert_allclose([column, row], np.rint([column, row]), rtol=0, atol=1e-4)
    return picture[np.rint(row).astype(int), np.rint(column).astype(int)]


def test_the_texture_is_the_albedo_of_the_surface(mesh, albedo):
    assert mesh.texture.shape == (9, 11, 3)
    np.testing.assert_array_equal(texels(mesh.uv, mesh.texture), mesh.colors)
    # Vertex k of row i and column j stands at (j, −i) pixels.
    column, row = mesh.vertices[:, 0] / PIXEL, -mesh.vertices[:, 1] / PIXEL
    np.testing.assert_allclose(mesh.uv[:, 0], (column - 3 + 0.5) / 11, rtol=0, atol=1e-12)
    np.testing.assert_allclose(mesh.uv[:, 1], 1 - (row - 2 + 0.5) / 9, rtol=0, atol=1e-12)
    # The hole repeats one of its neighbours.
    assert mesh.texture[3, 3].tolist() in mesh.texture[[2, 4, 3, 3], [3, 3, 2, 4]].tolist()


@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_a_vertex_finds_its_colour_in_the_file(mesh, suffix, tmp_path):
    path = tmp_path / f"two words{suffix}"
    write_mesh(mesh, path, unit="mm")
    loaded = trimesh.load(path, process=False, maintain_order=True)
    back = next(iter(loaded.geometry.values())) if isinstance(loaded, trimesh.Scene) else loaded
    np.testing.assert_allclose(back.vertices, mesh.vertices, rtol=0, atol=1e-6)
    np.testing.assert_allclose(back.vertex_normals, mesh.normals, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(back.faces, mesh.faces)
    material = back.visual.material
    picture = np.asarray(material.baseColorTexture if suffix == ".glb" else material.image)
    np.testing.assert_array_equal(picture[..., :3], mesh.texture)
    np.testing.assert_array_equal(texels(back.visual.uv, picture)[:, :3], mesh.colors)


def test_obj_refers_to_its_neighbours_by_bare_names(mesh, tmp_path):
    (tmp_path / "two words.png").write_bytes(b"somebody's photograph")
    write_mesh(mesh, tmp_path / "two words.obj")
    names = sorted(entry.name for entry in tmp_path.iterdir())
    assert names == ["two words.obj", "two words.png", "two_words.mtl", "two_words_texture.png"]
    assert "mtllib two_words.mtl\n" in (tmp_path / "two words.obj").read_text()
    assert "map_Kd two_words_texture.png" in (tmp_path / "two_words.mtl").read_text()
    assert (tmp_path / "two words.png").read_bytes() == b"somebody's photograph"


def glb_json(path):
    content = path.read_bytes()
    length = struct.unpack("<I", content[12:16])[0]
    return json.loads(content[20 : 20 + length])


def test_glb_is_a_matte_texture_in_metres(mesh, tmp_path):
    write_mesh(mesh, tmp_path / "a.glb", unit="mm")
    tree = glb_json(tmp_path / "a.glb")
    attributes = tree["meshes"][0]["primitives"][0]["attributes"]
    # A viewer would multiply the texture with colours.
    assert sorted(attributes) == ["NORMAL", "POSITION", "TEXCOORD_0"]
    assert tree["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] == 0.0
    assert tree["meshes"][0]["extras"]["unit"] == "mm"
    # glTF counts from the upper left corner.
    view = tree["bufferViews"][tree["accessors"][attributes["TEXCOORD_0"]]["bufferView"]]
    content = (tmp_path / "a.glb").read_bytes()
    start = 20 + struct.unpack("<I", content[12:16])[0] + 8 + view["byteOffset"]
    first = np.frombuffer(content[start : start + 8], "<f4")
    np.testing.assert_allclose(first, [mesh.uv[0, 0], 0.5 / 9], rtol=1e-6)
    scene = trimesh.load(tmp_path / "a.glb", process=False)
    np.testing.assert_allclose(scene.extents, 1e-3 * np.ptp(mesh.vertices, axis=0), rtol=1e-6)
    # Without a length nothing is scaled.
    for unit in (None, "relative"):
        write_mesh(mesh, tmp_path / "a.glb", unit=unit)
        scene = trimesh.load(tmp_path / "a.glb", process=False)
        np.testing.assert_allclose(scene.extents, np.ptp(mesh.vertices, axis=0), rtol=1e-6)


def test_the_unit_is_named(mesh, tmp_path):
    write_mesh(mesh, tmp_path / "a.ply", unit="µm")
    head, _ = (tmp_path / "a.ply").read_bytes().split(b"end_header\n", 1)
    assert "comment unit µm\n".encode() in head
    assert b"property uchar red" in head
    np.testing.assert_allclose(trimesh.load(tmp_path / "a.ply", process=False).vertices, mesh.vertices, atol=1e-6)
    write_mesh(mesh, tmp_path / "a.obj", unit="mm")
    assert (tmp_path / "a.obj").read_text().startswith("# psstereo, unit mm\n")
    for bad in ("", "mm\nend_header"):
        with pytest.raises(InputError, match="The unit is"):
            write_mesh(mesh, tmp_path / "b.ply", unit=bad)


def test_one_pixel_and_no_albedo(albedo, tmp_path):
    depth = np.full((11, 14), np.nan)
    depth[4, 5] = 2.0
    point = triangulate(depth, Pinhole(fx=9.0, fy=9.0, cx=5.0, cy=4.0), albedo=albedo[..., 0], texture=True)
    assert point.uv.tolist() == [[0.5, 0.5]]
    assert point.texture.tolist() == [[point.colors[0].tolist()]]
    with pytest.raises(InputError, match="0 triangles"):
        write_mesh(point, tmp_path / "a.obj")
    with pytest.raises(InputError, match="there is no albedo"):
        triangulate(depth, Orthographic(), texture=True)


@pytest.mark.parametrize(
    "change", [{"uv": None}, {"uv": np.full((3, 2), 1.1)}, {"uv": np.zeros((2, 2))}, {"texture": np.zeros((2, 2, 3))}]
)
def test_textures_that_do_not_fit_are_refused(change):
    whole = {
        "vertices": np.zeros((3, 3)),
        "faces": np.array([[0, 1, 2]], np.int32),
        "texture": np.zeros((2, 2, 3), np.uint8),
        "uv": np.zeros((3, 2)),
    }
    SurfaceMesh(**whole)
    with pytest.raises(InputError, match="Both or neither"):
        SurfaceMesh(**{**whole, **change})
