"""Radiometry against closed forms and quadrature at 50 digits, which share nothing with the library's formulas."""

import mpmath as mp
import numpy as np
import pytest

from psstereo.radiometry import (
    cap_half_angle,
    cap_solid_angle,
    disc_etendue,
    disc_solid_angle,
    polygon_solid_angle,
    sphere_irradiance,
    sphere_solid_angle,
    spherical_polygon_solid_angle,
    triangle_solid_angle,
    tube_solid_angle,
)


@pytest.fixture(autouse=True)
def fifty_digits():
    with mp.workdps(50):
        yield


def relative_error(got, want):
    return float(abs(mp.mpf(float(got)) / want - 1))


# ---- caps, spheres -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [1e-150, 1e-9, 1.8e-8, 5.6e-7, 4.65e-3, 0.5, 1.5707963, 1.5707964, 3.1, 3.14159265])
def test_cap(angle):
    with mp.workdps(400):
        assert relative_error(cap_solid_angle(angle), 2 * mp.pi * (1 - mp.cos(mp.mpf(angle)))) < 1e-15


@pytest.mark.parametrize("solid", [1e-300, 1e-15, 1e-12, 6.8e-5, 1.0, 6.28, 6.29, 12.0])
def test_half_angle_of_a_cap(solid):
    with mp.workdps(400):
        assert relative_error(cap_half_angle(solid), mp.acos(1 - mp.mpf(solid) / (2 * mp.pi))) < 1e-14


@pytest.mark.parametrize("distance", [1 + 2.0**-52, 1 + 1e-12, 1.0001, 1.5, 10.0, 215.0, 1.784e6, 5.6e7, 1e12])
def test_sphere(distance):
    want = 2 * mp.pi * (1 - mp.sqrt(1 - 1 / mp.mpf(distance) ** 2))
    assert relative_error(sphere_solid_angle(1.0, distance), want) < 1e-15


@pytest.mark.parametrize("length", [0.0, 1e-8, 0.3, 1.0, 100.0, 1e6, 5.6e7])
def test_far_end_of_a_tube(length):
    want = 2 * mp.pi * (1 - mp.mpf(length) / mp.sqrt(1 + mp.mpf(length) ** 2))
    assert relative_error(tube_solid_angle(1.0, length), want) < 1e-15


def sphere_quadrature(sine, cosine):
    """Return ∫ max(0, n·l) dΩ over the cap about z; the integral over the azimuth is elementary."""
    s, c = mp.mpf(sine), mp.mpf(cosine)
    n = mp.sqrt(1 - c * c)

    def ring(polar):
        along, across = c * mp.cos(polar), n * mp.sin(polar)
        if abs(along) >= across:
            return 2 * mp.pi * max(along, mp.mpf(0)) * mp.sin(polar)
        lit = mp.acos(-along / across)
        return 2 * (along * lit + across * mp.sin(lit)) * mp.sin(polar)

    edge = mp.asin(s)
    kink = abs(mp.pi / 2 - mp.acos(c))
    return mp.quad(ring, [0, kink, edge] if 0 < kink < edge else [0, edge])


@pytest.mark.parametrize("sine", [0.99, 0.6, 0.25, 0.2, 4.65e-3, 5.6e-7, 1e-10])
@pytest.mark.parametrize("share", [-0.9, -0.5, -1e-3, 0.0, 0.3, 0.95, 1.0])
def test_irradiance_from_a_sphere_on_the_horizon(sine, share):
    distance = 1 / sine
    with mp.workdps(60):
        exact_sine = 1 / mp.mpf(distance)
        want = sphere_quadrature(exact_sine, mp.mpf(share * sine))
        # The cosine is given relative to the sine; near −sine the result is a small difference by nature.
        assert relative_error(sphere_irradiance(1.0, 1.0, distance, share * sine), want) < (
            1e-12 if share > -0.6 else 1e-11
        )


@pytest.mark.parametrize(("sine", "cosine"), [(0.5, 1.0), (0.5, 0.7), (0.9, 0.95), (1e-3, 0.3)])
def test_irradiance_from_a_sphere_above_the_horizon(sine, cosine):
    with mp.workdps(30):
        want = sphere_quadrature(1 / mp.mpf(1 / sine), cosine)
        assert relative_error(sphere_irradiance(1.0, 1.0, 1 / sine, cosine), want) < 1e-14


# ---- discs ---------------------------------------------------------------------------------------------------------


def disc_closed_form(a, h, p):
    """Paxton 1959 with the complete elliptic integrals of the first and third kind."""
    a, h, p = map(mp.mpf, (a, h, p))
    reach = mp.sqrt(h * h + (a + p) ** 2)
    modulus = 4 * a * p / reach**2
    if p == a:
        return mp.pi - 2 * h / reach * mp.ellipk(modulus)
    third = (a - p) / (a + p) * mp.ellippi(4 * a * p / (a + p) ** 2, modulus)
    return (2 * mp.pi if p < a else 0) - 2 * h / reach * (mp.ellipk(modulus) + third)


def test_closed_form_of_a_disc_is_the_integral():
    with mp.workdps(15):
        h, p = mp.mpf("0.4"), mp.mpf("0.7")

        def ring(r):
            return 2 * r * h * mp.quad(lambda f: (r * r + p * p - 2 * r * p * mp.cos(f) + h * h) ** -1.5, [0, mp.pi])

        assert mp.quad(ring, [0, p, 1]) == pytest.approx(disc_closed_form(1, h, p), rel=1e-9)


def test_disc_from_above_inside_outside_and_at_the_rim():
    rng = np.random.default_rng(1959)
    heights = 10 ** rng.uniform(-14, 8, 400)
    near = 10 ** rng.uniform(-15, 0, 400)
    offsets = np.select(
        [np.arange(400) % 4 == k for k in range(4)], [10 ** rng.uniform(-8, 8, 400), 1 + near, 1 - near, np.ones(400)]
    )
    got = disc_solid_angle(1.0, heights, offsets)
    with mp.workdps(120):
        errors = [relative_error(g, disc_closed_form(1, h, p)) for g, h, p in zip(got, heights, offsets, strict=True)]
    assert max(errors) < 1e-14


@pytest.mark.parametrize("solid", [1e-12, 1e-15, 1e-30])
@pytest.mark.parametrize("tilt", [0.0, 0.5, 1.5])
def test_tiny_disc(solid, tilt):
    distance = float(np.sqrt(np.pi * np.cos(tilt) / solid))
    height, offset = distance * float(np.cos(tilt)), distance * float(np.sin(tilt))
    with mp.workdps(120):
        want = disc_closed_form(1, height, offset)
        assert float(want) == pytest.approx(solid, rel=1e-3, abs=0.0)
        assert relative_error(disc_solid_angle(1.0, height, offset), want) < 1e-14


@pytest.mark.parametrize(("a", "b", "d"), [(1.0, 1.0, 1.0), (0.2, 3.0, 0.5), (1.0, 1.0, 1e-6), (1e-3, 2e-3, 1e4)])
def test_etendue_of_two_discs(a, b, d):
    x = mp.mpf(a) ** 2 + mp.mpf(b) ** 2 + mp.mpf(d) ** 2
    want = mp.pi**2 / 2 * (x - mp.sqrt(x**2 - 4 * mp.mpf(a) ** 2 * mp.mpf(b) ** 2))
    assert relative_error(disc_etendue(a, b, d), want) < 1e-14


def test_etendue_of_two_discs_by_quadrature():
    """∬ dA dA' cos²θ / r² over both discs, by Gauss-Legendre in the radii and the trapezoidal rule in the angle."""
    a, b, d = 0.4, 0.7, 0.9
    nodes, weights = np.polynomial.legendre.leggauss(24)
    near, far = (nodes + 1) * a / 2, (nodes + 1) * b / 2
    angle = 2 * np.pi * np.arange(64) / 64
    r, s, f = np.meshgrid(near, far, angle, indexing="ij")
    kernel = (d * d / (d * d + r * r + s * s - 2 * r * s * np.cos(f)) ** 2).mean(axis=2)
    got = (2 * np.pi) ** 2 * np.einsum("i,j,ij->", weights * a / 2 * near, weights * b / 2 * far, kernel)
    assert disc_etendue(a, b, d) == pytest.approx(got, rel=1e-13)


# ---- triangles, polygons -------------------------------------------------------------------------------------------


def triangle_closed_form(corners, observer=(0, 0, 0)):
    """L'Huilier's theorem from the three sides; always positive."""
    arms = [[mp.mpf(float(x)) - mp.mpf(float(o)) for x, o in zip(c, observer, strict=True)] for c in corners]
    units = [[x / mp.norm(arm) for x in arm] for arm in arms]

    def side(u, v):
        return 2 * mp.asin(mp.norm([x - y for x, y in zip(u, v, strict=True)]) / 2)

    a, b, c = side(units[0], units[1]), side(units[1], units[2]), side(units[2], units[0])
    s = (a + b + c) / 2
    return 4 * mp.atan(mp.sqrt(mp.tan(s / 2) * mp.tan((s - a) / 2) * mp.tan((s - b) / 2) * mp.tan((s - c) / 2)))


@pytest.mark.parametrize("edge", [1.0, 1e-3, 1.5e-6, 4.5e-8, 1e-10, 1e-13])
def test_triangles_down_to_nothing(edge):
    """Corners near a common direction: 1e-12 sr, 1e-15 sr and far below, with the corners as float64 holds them."""
    rng = np.random.default_rng(1983)
    centres = rng.normal(size=(60, 3))
    centres /= np.linalg.norm(centres, axis=1, keepdims=True)
    frames = np.linalg.qr(np.stack([centres, *rng.normal(size=(2, 60, 3))], axis=-1))[0][:, :, 1:]
    shape = np.array([[1.0, 0.0], [-0.5, 0.8], [-0.6, -0.7]])
    corners = centres[:, None] + edge * np.einsum("nij,kj->nki", frames, shape)
    with mp.workdps(80):
        errors = [
            relative_error(abs(got), triangle_closed_form(c))
            for got, c in zip(triangle_solid_angle(corners), corners, strict=True)
        ]
    assert max(errors) < 2e-14


def test_tiny_triangle_far_from_the_origin_seen_from_nearby():
    observer = np.array([1e3, -2e3, 5e2])
    corners = observer + np.array([[0.0, 0.0, 1.0], [1e-6, 0.0, 1.0], [0.0, 1e-6, 1.0]])
    with mp.workdps(80):
        want = triangle_closed_form(corners, observer)
    assert relative_error(abs(triangle_solid_angle(corners, observer)), want) < 1e-14


@pytest.mark.parametrize("height", [1e-1, 1e-4, 1e-8, 1e-12])
def test_triangle_that_nearly_fills_the_hemisphere(height):
    corners = np.array([[3.0, 0.1, height], [-1.0, 2.0, height], [-1.2, -2.0, height]])
    with mp.workdps(80):
        assert relative_error(triangle_solid_angle(corners), triangle_closed_form(corners)) < 1e-15


def test_observer_close_to_a_corner_of_a_large_triangle():
    corners = np.array([[1e-7, 2e-7, 3e-7], [10.0, 0.5, 0.2], [-0.3, 8.0, 1.0]])
    with mp.workdps(80):
        assert relative_error(triangle_solid_angle(corners), triangle_closed_form(corners)) < 1e-14


def test_faces_of_a_cube_from_inside_sum_to_the_sphere():
    square = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]], float)
    turns = [np.roll(np.eye(3), k, axis=0) for k in range(3)]
    faces = np.array([square @ t for t in turns] + [-square[::-1] @ t for t in turns])
    observers = np.array([[0.0, 0.0, 0.0], [0.3, -0.9, 0.5], [0.999999, 0.0, -0.2], [4.0, 1.0, 0.0]])
    sums = polygon_solid_angle(faces, observers[:, None]).sum(axis=-1)
    np.testing.assert_allclose(sums, [4 * np.pi] * 3 + [0.0], rtol=1e-15, atol=2e-15)


@pytest.mark.parametrize("size", [1e2, 1.0, 1e-3, 5e-7, 1.5e-8, 1e-12])
def test_rectangle(size):
    """A rectangle on axis: 4 asin(ab / √((a² + d²)(b² + d²))), a and b its half sides."""
    a, b = 1.0 * size, 0.6 * size
    corners = [[a, b, 1.0], [-a, b, 1.0], [-a, -b, 1.0], [a, -b, 1.0]]
    a, b = mp.mpf(a), mp.mpf(b)
    want = 4 * mp.asin(a * b / mp.sqrt((a * a + 1) * (b * b + 1)))
    assert relative_error(polygon_solid_angle(corners), want) < 1e-14


@pytest.mark.parametrize("polar", [1e-8, 1e-3, 0.7, 1.5, 1.6, 2.5, 3.1, 3.14])
@pytest.mark.parametrize("count", [3, 8, 101])
def test_regular_spherical_polygon(polar, count):
    """Bounded by great circles around a circle of latitude: 2π − 2n asin(...) from its n isosceles triangles."""
    azimuth = 2 * np.pi * np.arange(count) / count
    sine, cosine = np.sin(polar), np.cos(polar)
    corners = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.full(count, cosine)], axis=-1)
    tangent = mp.tan(mp.mpf(polar) / 2) ** 2
    wedge = 2 * mp.pi / count
    want = 2 * count * mp.atan2(tangent * mp.sin(wedge), 1 + tangent * mp.cos(wedge))
    assert relative_error(spherical_polygon_solid_angle(corners), want) < 1e-12


def test_polygon_of_many_sides_tends_to_its_disc():
    count = 2000
    azimuth = 2 * np.pi * np.arange(count) / count
    corners = np.stack([0.5 * np.cos(azimuth), 0.5 * np.sin(azimuth), np.zeros(count)], axis=-1)
    for observer in ([0.1, 0.0, -0.3], [0.9, 0.0, -0.2], [0.3, 0.4, -2.0]):
        disc = disc_solid_angle(0.5, observer[2], np.hypot(observer[0], observer[1]))
        assert polygon_solid_angle(corners, observer) == pytest.approx(disc, rel=1e-5)
