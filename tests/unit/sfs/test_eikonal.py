"""The Hamilton–Jacobi equation of shape from shading against surfaces that are known."""

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.flags import Flag
from psstereo.lights import Directional, Led
from psstereo.results import Outcome
from psstereo.sfs import ShadedImage
from psstereo.sfs.eikonal import Eikonal

OBLIQUE = (0.35, 0.25, 0.9)
FOUR = ((-0.45, 0.4, 0.25, 0.22), (0.4, 0.45, 0.22, 0.2), (-0.4, -0.45, 0.2, 0.18), (0.45, -0.4, 0.28, 0.25))


def sun(direction, strength=1.0):
    return Directional(direction=np.array(direction, float), strength=np.array([strength]))


def surface(kind, n):
    """Return heights and unit normals over [−1, 1]², x right and y up, and the camera."""
    line = np.linspace(-1, 1, n)
    x, y = np.meshgrid(line, -line)
    if kind == "paraboloid":
        z, p, q = -0.5 * (x * x + y * y) - 0.15 * x * y, -x - 0.15 * y, -y - 0.15 * x
    elif kind == "cosines":
        a, b = np.pi * x, np.pi * y
        z = 0.3 * np.cos(a) * np.cos(b)
        p, q = -0.3 * np.pi * np.sin(a) * np.cos(b), -0.3 * np.pi * np.cos(a) * np.sin(b)
    else:
        z = p = q = 0.0
        for cx, cy, s, height in FOUR:
            g = height * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * s * s))
            z, p, q = z + g, p - g * (x - cx) / s**2, q - g * (y - cy) / s**2
    normals = np.stack([-p, -q, np.ones_like(z)], axis=-1)
    return (
        z,
        normals / np.linalg.norm(normals, axis=-1, keepdims=True),
        Orthographic(pixel_size=2 / (n - 1), length_unit="mm"),
    )


def starts(z, cosine, border):
    """Return the heights of the brightest places, and of the border if it is asked for."""
    from scipy.ndimage import maximum_filter

    known = (cosine >= maximum_filter(cosine, 3)) & (cosine > 0.999)
    if border:
        known[[0, -1]] = known[:, [0, -1]] = True
    return np.where(known, z, np.nan)


def angle(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))


def errors(kind, n, direction, **options):
    z, normals, camera = surface(kind, n)
    light = sun(direction)
    cosine = normals @ light.direction
    given = starts(z, cosine, direction != (0, 0, 1))
    result = Eikonal(**options).recover(
        ShadedImage(image=np.maximum(cosine, 0), light=light, camera=camera, heights=given)
    )
    assert result.normals.outcome is Outcome.SOLVED
    assert result.depth.unit == "mm"
    assert result.normals.facts["phase"].startswith("second order, paths" if options["order"] == 2 else "monotone")
    np.testing.assert_allclose(np.linalg.norm(result.normals.normals, axis=-1), 1.0, rtol=1e-12)
    return np.abs(result.depth.depth - z).mean(), angle(result.normals.normals, normals).mean()


GRIDS = (33, 65, 129, 257)


@pytest.mark.parametrize(
    ("kind", "direction", "relief"),
    [
        ("paraboloid", (0, 0, 1), "convex"),
        ("cosines", (0, 0, 1), "concave"),
        ("paraboloid", OBLIQUE, "convex"),
        ("hills", OBLIQUE, "concave"),
    ],
)
@pytest.mark.parametrize(("order", "least"), [(1, 0.9), (2, 1.8)])
def test_orders_of_convergence(kind, direction, relief, order, least):
    found = np.array([errors(kind, n, direction, relief=relief, order=order) for n in GRIDS])
    slopes = -np.polyfit(np.log2(GRIDS), np.log2(found), 1)[0]
    assert slopes[0] > least
    assert found[-1, 0] < (6e-3, 3e-4)[order - 1]
    assert found[-1, 1] < (1.2, 0.08)[order - 1]


def test_cone_has_the_orders_of_a_distance_function():
    found = []
    for n in (65, 129, 257):
        line = np.linspace(-1, 1, n)
        distance = np.hypot(*np.meshgrid(line, line))
        image = np.full((n, n), np.sqrt(0.5))
        image[n // 2, n // 2] = 1.0
        camera = Orthographic(pixel_size=2 / (n - 1))
        result = Eikonal(order=1).recover(ShadedImage(image=image, light=sun((0, 0, 1)), camera=camera))
        found.append(np.abs(result.depth.depth + distance).mean())
        assert not np.isnan(result.depth.depth).any()
    orders = np.log2(np.array(found[:-1]) / found[1:])
    assert (orders > 0.7).all()
    assert (orders < 0.85).all()
    assert found[0] == pytest.approx(2.06e-2, rel=0.02)


def lamp_scene(n, bump, skew=0.0):
    """Return a surface seen by a pinhole with exact normals: d(x, y) along the rays (x, y, −1)."""
    camera = Pinhole(fx=1.2 * n, fy=1.3 * n, cx=0.52 * n, cy=0.47 * n, skew=skew * n)
    x, y = np.moveaxis(camera.rays((n, n)), -1, 0)[:2]
    if bump:
        d, dx, dy = 100 + 30 * (x * x + y * y) + 6 * x * y, 60 * x + 6 * y, 60 * y + 6 * x
    else:
        d = 100 * (1 + 0.08 * np.sin(5 * x + 0.4) * np.cos(4 * y))
        dx, dy = 40 * np.cos(5 * x + 0.4) * np.cos(4 * y), -32 * np.sin(5 * x + 0.4) * np.sin(4 * y)
    along_x = np.stack([dx * x + d, dx * y, -dx], axis=-1)
    along_y = np.stack([dy * x, dy * y + d, -dy], axis=-1)
    normals = np.cross(along_x, along_y)
    return camera, d, normals / np.linalg.norm(normals, axis=-1, keepdims=True)


@pytest.mark.parametrize(("order", "least", "error"), [(1, 0.9, 0.12), (2, 1.8, 2e-3)])
def test_lamp_at_the_centre_needs_nothing_known(order, least, error):
    light = Led(position=np.zeros(3), axis=np.array([0.1, 0.0, -1.0]), mu=1.5, flux=np.array([4e4]))
    found = []
    for n in (33, 65, 129):
        camera, d, normals = lamp_scene(n, bump=True, skew=0.05)
        image = 0.6 * light.irradiance(camera.points(d), normals)[..., 0] + 0.25
        result = Eikonal(order=order).recover(
            ShadedImage(image=image, light=light, camera=camera, albedo=0.6, ambient=0.25)
        )
        found.append(np.abs(result.depth.depth - d).mean())
    assert result.depth.unit == "mm"
    assert result.normals.outcome is Outcome.SOLVED
    assert angle(result.normals.normals, normals).mean() < (1.0, 0.05)[order - 1]
    assert found[-1] < error
    assert np.log2(found[0] / found[-1]) / 2 > least


@pytest.mark.parametrize("relief", ["convex", "concave"])
def test_sun_on_a_pinhole(relief):
    light = sun((0.2, -0.15, 0.95), 3.0)
    found = []
    for n in (33, 65, 129):
        camera, d, normals = lamp_scene(n, bump=False, skew=0.05)
        cosine = light.irradiance(d, normals)[..., 0]
        image = ShadedImage(image=cosine, light=light, camera=camera, heights=starts(d, cosine / 3, True))
        result = Eikonal(relief=relief).recover(image)
        found.append(np.abs(result.depth.depth - d).mean())
        assert result.normals.outcome is Outcome.SOLVED
    assert result.depth.unit == "relative"
    assert found[-1] < 0.01
    assert np.log2(found[0] / found[-1]) / 2 > 1.5
    assert angle(result.normals.normals, normals).mean() < 0.1


def test_both_reliefs_see_the_same_image():
    z, normals, camera = surface("paraboloid", 41)
    image = ShadedImage(image=normals[..., 2], light=sun((0, 0, 1)), camera=camera)
    convex, concave = (Eikonal(relief=relief).recover(image) for relief in ("convex", "concave"))
    np.testing.assert_allclose(convex.depth.depth, -concave.depth.depth, atol=1e-12)
    assert np.abs(convex.depth.depth - z).max() < 0.01
    sentences = {one.name: one.sentence for one in convex.assumptions}
    assert "falls away" in sentences["relief"]
    assert "1 places face the light" in sentences["singular points"]


def test_strength_and_threads_do_not_matter():
    _, normals, camera = surface("hills", 141)
    cosine = np.maximum(normals @ sun(OBLIQUE).direction, 0)
    noisy = cosine * (1 + 0.05 * np.random.default_rng(1).standard_normal(cosine.shape))
    one = Eikonal().recover(ShadedImage(image=noisy, light=sun(OBLIQUE), camera=camera))
    two = Eikonal(threads=3).recover(ShadedImage(image=4 * noisy, light=sun(OBLIQUE, 4.0), camera=camera))
    np.testing.assert_array_equal(one.depth.depth, two.depth.depth)
    np.testing.assert_array_equal(one.normals.normals, two.normals.normals)
    over = (one.normals.flags & Flag.OVER_BRIGHT) != 0
    np.testing.assert_array_equal(over, noisy > 1 + 1e-9)
    assert over.any()
    assert np.isfinite(one.depth.depth).all()


def test_without_a_place_that_faces_the_light_the_brightest_stands_in():
    image = np.full((20, 24), 0.6)
    image[4, 9] = 0.61
    result = Eikonal().recover(ShadedImage(image=image, light=sun((0, 0, 1))))
    assert result.depth.depth[4, 9] == 0.0
    assert np.nanmax(result.depth.depth) == 0.0
    assert result.normals.outcome is Outcome.SOLVED
    assert "1 components no place faces the light" in {a.name: a.sentence for a in result.assumptions}["start"]


def test_darkness_is_flagged_and_steep():
    _, normals, _ = surface("paraboloid", 31)
    image = normals[..., 2].copy()
    image[3:6, 20:23] = 0.0
    image[10, 10] = -0.2
    result = Eikonal().recover(ShadedImage(image=image, light=sun((0, 0, 1))))
    unlit = (result.normals.flags & Flag.UNLIT) != 0
    np.testing.assert_array_equal(unlit, image < 1e-3)
    assert np.isfinite(result.depth.depth).all()
    assert np.isfinite(result.normals.normals).all()


def test_pieces_holes_and_summits():
    image = np.full((30, 40), 0.8)
    image[6, 6] = image[21, 9] = image[10, 30] = 1.0
    mask = np.ones(image.shape, bool)
    mask[:, 19] = mask[12:15, 3:6] = False
    one = Eikonal().recover(ShadedImage(image=image, light=sun((0, 0, 1)), mask=mask))
    every = Eikonal(summits="all").recover(ShadedImage(image=image, light=sun((0, 0, 1)), mask=mask))
    assert np.isnan(one.depth.depth[~mask]).all()
    assert np.isfinite(one.depth.depth[mask]).all()
    assert set(np.unique(one.depth.components)) == {0, 1, 2}
    np.testing.assert_array_equal(np.argwhere(one.depth.depth == 0.0), [[10, 30], [21, 9]])
    np.testing.assert_array_equal(np.argwhere(every.depth.depth == 0.0), [[6, 6], [10, 30], [21, 9]])
    assert "its only start" in {a.name: a.sentence for a in one.assumptions}["singular points"]
    assert "each of them" in {a.name: a.sentence for a in every.assumptions}["singular points"]


def test_flat_surface_stays_flat_and_steps_of_eight_bits_converge():
    flat = Eikonal().recover(ShadedImage(image=np.ones((25, 30)), light=sun((0, 0, 1))))
    np.testing.assert_allclose(flat.depth.depth, 0.0, atol=1e-12)
    np.testing.assert_allclose(flat.normals.normals[..., 2], 1.0)
    z, normals, camera = surface("paraboloid", 81)
    steps = np.round(255 * normals[..., 2]) / 255
    result = Eikonal().recover(ShadedImage(image=steps, light=sun((0, 0, 1)), camera=camera))
    assert result.normals.outcome is Outcome.SOLVED
    assert np.abs(result.depth.depth - z).mean() < 0.03


def test_grazing_light_leaves_what_no_path_reaches():
    _, normals, camera = surface("hills", 61)
    light = sun((0.97, 0.1, 0.22))
    cosine = np.maximum(normals @ light.direction, 0.0)
    result = Eikonal().recover(ShadedImage(image=cosine, light=light, camera=camera))
    lost = np.isnan(result.depth.depth)
    np.testing.assert_array_equal(lost, (result.normals.flags & Flag.NO_DEPTH) != 0)
    np.testing.assert_array_equal(lost, np.isnan(result.normals.normals).any(axis=-1))
    assert result.normals.outcome in (Outcome.PARTIAL, Outcome.SOLVED)


@pytest.mark.parametrize("shape", [(1, 1), (1, 17), (17, 1), (2, 2)])
def test_small_images(shape):
    image = np.full(shape, 0.7)
    image[0, 0] = 1.0
    result = Eikonal().recover(ShadedImage(image=image, light=sun((0, 0, 1))))
    assert np.isfinite(result.depth.depth).all()
    assert np.isfinite(result.normals.normals).all()
    if max(shape) == 17:
        np.testing.assert_allclose(np.diff(result.depth.depth.ravel()), -np.sqrt(1 / 0.49 - 1), rtol=1e-9)


def test_dark_image_is_refused_and_a_lamp_that_points_away_lights_nothing():
    with pytest.raises(InputError, match="brighter than the ambient"):
        Eikonal().recover(ShadedImage(image=np.zeros((6, 7)), light=sun((0, 0, 1))))
    lamp = Led(position=np.zeros(3), axis=np.array([0, 0, 1.0]), mu=1.0, flux=np.array([1.0]))
    camera = Pinhole(fx=9, fy=9, cx=3, cy=3)
    dark = Eikonal().recover(ShadedImage(image=np.full((6, 7), 0.3), light=lamp, camera=camera))
    assert ((dark.normals.flags & Flag.UNLIT) != 0).all()


def test_refusals():
    image = np.full((5, 6), 0.8)
    for options in ({"order": 3}, {"relief": "flat"}, {"summits": "two"}, {"facing": 1.0}, {"darkest": 0.0},
                    {"tolerance": np.nan}, {"max_sweeps": 0}, {"threads": 0}):  # fmt: skip
        with pytest.raises(OptionError):
            Eikonal(**options)
    lamp = Led(position=np.zeros(3), axis=np.array([0, 0, -1.0]), mu=0.0, flux=np.array([1.0]))
    pinhole = Pinhole(fx=9, fy=9, cx=3, cy=3)
    with pytest.raises(UnsupportedError, match="camera's side"):
        Eikonal().recover(ShadedImage(image=image, light=sun((1, 0, 0.01))))
    with pytest.raises(UnsupportedError, match="optical centre"):
        Eikonal().recover(ShadedImage(image=image, light=lamp))
    with pytest.raises(UnsupportedError, match="nearest points"):
        Eikonal(relief="concave").recover(ShadedImage(image=image, light=lamp, camera=pinhole))
    with pytest.raises(InputError, match="not in front"):
        Eikonal().recover(ShadedImage(image=image, light=lamp, camera=pinhole, heights=-image))
    with pytest.raises(InputError, match="infinite"):
        Eikonal().recover(ShadedImage(image=image, light=sun((0, 0, 1)), heights=image * np.inf))


def test_limit_of_sweeps_is_told():
    _, normals, camera = surface("hills", 60)
    cosine = np.maximum(normals @ sun(OBLIQUE).direction, 0)
    result = Eikonal(max_sweeps=1).recover(ShadedImage(image=cosine, light=sun(OBLIQUE), camera=camera))
    assert result.normals.outcome is Outcome.NOT_CONVERGED
    assert ((result.normals.flags & Flag.NOT_CONVERGED) != 0).all()
    assert result.normals.facts["phase"] == "monotone"
