import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.io.green_convention import green_convention
from psstereo.io.normal_map import read_normal_map

FLIP = np.array([1.0, -1.0, 1.0])
y, x = np.mgrid[1.2:-1.2:160j, -1.2:1.2:160j]


def _masked(nx, ny, nz, mask):
    normals = np.stack(np.broadcast_arrays(nx, ny, nz), axis=-1).astype(float)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.where(mask[..., None], normals, np.nan)


def _sphere(limit=1.0):
    r2 = x**2 + y**2
    return _masked(x, y, np.sqrt(np.clip(1 - r2, 1e-6, None)), r2 < limit**2)


def _both(normals):
    return green_convention(normals).verdict, green_convention(normals * FLIP).verdict


def test_whole_sphere_by_both_cues():
    plain = green_convention(_sphere())
    assert plain.verdict == "opengl"
    assert plain.relative_curl < 0.2
    assert plain.outward_x > 0.99
    assert plain.outward_y > 0.99
    flipped = green_convention(_sphere() * FLIP)
    assert flipped.verdict == "directx"
    assert "'directx'" in flipped.sentence


def test_shallow_cap_by_its_curl_alone():
    assert np.isnan(green_convention(_sphere(0.4)).outward_x)
    assert _both(_sphere(0.4)) == ("opengl", "directx")


def test_steep_bowl():
    """Flipped, it has the very normals of a ball whose red is upside down, so nobody can tell."""
    assert _both(_sphere() * [-1, -1, 1]) == ("opengl", "undecided")
    assert _both(_sphere(0.4) * [-1, -1, 1]) == ("opengl", "directx")


def test_paraboloid_by_its_outline_alone():
    """Its cross derivatives vanish, so that only rounding to 8 bits is left of them."""
    normals = np.round(127 * _masked(3 * x, 3 * y, 1, x**2 + y**2 < 1)) / 127
    assert abs(green_convention(normals).relative_curl - 1) < 0.25
    assert _both(normals) == ("opengl", "directx")


def test_relief_over_the_whole_frame():
    normals = _masked(-np.cos(5 * x + 3 * y), -np.cos(5 * x + 3 * y) * 0.6, 1, np.ones_like(x, dtype=bool))
    assert _both(normals) == ("opengl", "directx")


@pytest.mark.parametrize(
    "normals",
    [
        _masked(0.3, 0.2, 1, x < 9),
        _masked(np.cos(5 * x), 0, 1, x < 9),
        _masked(np.cos(5 * x), np.sign(y), 1, x < 9),
        np.random.default_rng(1).normal((0, 0, 1), 0.3, (160, 160, 3)),
        _sphere()[60:70, 60:70],
        np.full((8, 8, 3), np.nan),
    ],
    ids=["plane", "grooves", "tent", "noise", "tiny", "empty"],
)
def test_weak_evidence_is_undecided(normals):
    assert _both(normals) == ("undecided", "undecided")


def test_red_upside_down_is_not_blamed_on_green():
    verdict = green_convention(_sphere() * [-1, 1, 1])
    assert verdict.verdict == "undecided"
    assert "red" in verdict.sentence


def test_contradiction_is_undecided():
    waves = _masked(-np.cos(9 * x + 6 * y), np.cos(9 * x + 6 * y) * 0.6, 1, x**2 + y**2 < 0.95**2)
    mixed = np.where(np.isfinite(waves), waves, _sphere())
    assert green_convention(waves).verdict == "directx"
    verdict = green_convention(mixed)
    assert verdict.verdict == "undecided"
    assert "contradict" in verdict.sentence


def test_noise_of_ten_degrees_is_survived():
    noise = np.random.default_rng(2).normal(0, 0.17, (160, 160, 3))
    assert _both(_sphere() + noise) == ("opengl", "directx")


def test_shapes_are_checked():
    with pytest.raises(InputError):
        green_convention(np.ones((4, 3)))
    with pytest.raises(InputError):
        green_convention(np.ones((4, 4, 3)), np.ones((4, 5), dtype=bool))


@pytest.mark.data
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("name", ["cat", "cow", "goblet", "pot1", "toy_vase"])
def test_real_maps(data_dir, name, bits):
    normals = read_normal_map(data_dir / "normal_maps" / name / "normal_map.png").normals
    if bits == 8:
        normals = np.round((normals + 1) * 127.5) / 127.5 - 1
    assert _both(normals) == ("opengl", "directx")


@pytest.mark.data
@pytest.mark.parametrize("name", ["toy_tent", "toy_stripes"])
def test_real_maps_that_cannot_tell(data_dir, name):
    """Both are f(x) + g(y) without an outline: surfaces either way up."""
    normals = read_normal_map(data_dir / "normal_maps" / name / "normal_map.png").normals
    assert _both(normals) == ("undecided", "undecided")


@pytest.mark.data
@pytest.mark.parametrize(
    "name", ["diligent/ballPNG", "diligent/catPNG", "rendered/teapot-plastic", "rendered/sphere-near24"]
)
def test_real_truths(data_dir, name):
    assert _both(read_normal_map(data_dir / name / "Normal_gt.mat").normals) == ("opengl", "directx")
