"""Environment maps against Mitsuba 3's ``envmap``: the same array, the same rotation, absolute radiances."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from psstereo.lights import Environment, lat_long_directions

ROTATIONS = {"none": np.eye(3), "some": Rotation.from_euler("xyz", [40.0, -75.0, 110.0], degrees=True).as_matrix()}
ALBEDO = 0.6


@pytest.fixture(scope="module")
def mi():
    mitsuba = pytest.importorskip("mitsuba", reason="the extra 'test' brings Mitsuba")
    mitsuba.set_variant("scalar_rgb")
    return mitsuba


def asymmetric(rows):
    """A map without any symmetry, of another shape in each channel; smooth, since Mitsuba interpolates."""
    look = lat_long_directions(rows, 2 * rows)
    lobes = ([0.48, 0.6, 0.64], 4.0), ([-0.8, 0.36, 0.48], 2.0), ([0.0, -0.6, -0.8], 6.0)
    return np.stack([0.1 + np.exp(k * (look @ np.array(axis) - 1.0)) for axis, k in lobes], axis=-1)


def emitter(mi, table, rotation):
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    bitmap = mi.Bitmap(np.ascontiguousarray(table, dtype=np.float32))
    return {"type": "envmap", "bitmap": bitmap, "to_world": mi.ScalarTransform4f(matrix)}


def normals(count, seed):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_radiance_from_each_direction(mi, rotation):
    """Mitsuba has the first and last row at the poles, half a row from ours: the gap falls with the size of the map."""
    worst = []
    for rows in (32, 128):
        table = asymmetric(rows)
        light = Environment(radiance=table, rotation=ROTATIONS[rotation])
        sky = mi.load_dict({"type": "scene", "sky": emitter(mi, table, ROTATIONS[rotation])}).environment()
        gaps = []
        for direction in normals(100, seed=1):
            surface = mi.SurfaceInteraction3f()
            surface.wi = mi.Vector3f(*(-direction).tolist())
            gaps.append(np.array(sky.eval(surface)) / light.radiance_from(direction) - 1)
        worst.append(np.abs(gaps).max())
    assert worst[1] < 0.08
    assert worst[0] > 2.5 * worst[1]


@pytest.mark.slow
@pytest.mark.parametrize("rotation", ROTATIONS)
def test_a_matte_plane_in_any_position(mi, rotation):
    """L_out = ρ E(n) with ρ = albedo / π, within the noise of 65536 paths and half a row of the map."""
    table = asymmetric(256)
    light = Environment(radiance=table, rotation=ROTATIONS[rotation])
    gaps = []
    for n in normals(8, seed=2):
        to_world = mi.ScalarTransform4f().look_at(
            origin=[0, 0, 0], target=n.tolist(), up=normals(1, seed=3)[0].tolist()
        )
        scene = mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "direct"},
                "sky": emitter(mi, table, ROTATIONS[rotation]),
                "plane": {
                    "type": "rectangle",
                    "to_world": to_world,
                    "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [ALBEDO] * 3}},
                },
                "sensor": {
                    "type": "perspective",
                    "fov": 5.0,
                    "to_world": mi.ScalarTransform4f().look_at(
                        origin=(3 * n).tolist(), target=[0, 0, 0], up=normals(1, seed=3)[0].tolist()
                    ),
                    "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}},
                    "sampler": {"type": "independent", "sample_count": 4096},
                },
            }
        )
        seen = np.array(mi.render(scene, seed=7))[..., :3].mean(axis=(0, 1))
        gaps.append(seen / (ALBEDO / np.pi * light.irradiance(n, n)) - 1)
    assert np.abs(gaps).max() < 1e-2
    assert np.sqrt(np.mean(np.square(gaps))) < 4e-3
