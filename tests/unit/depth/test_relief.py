"""Band-pass relief: its transfer function, its borders, its independence of everything coarse."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import relief_from_normals
from psstereo.errors import InputError, OptionError
from psstereo.results import Outcome

PIXEL = 0.1
CAMERA = Orthographic(pixel_size=PIXEL, length_unit="mm")


def transfer(wavelength, shortest, longest):
    """Return what the docstring promises."""

    def s(edge):
        t = 1.0 / (1.0 + (np.asarray(wavelength) / edge) ** 2)
        return 3 * t**2 - 2 * t**3

    return s(longest) * (1.0 - (s(shortest) if shortest else 0.0))


def normals_of(slope_x, slope_y):
    return np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)


def amplitude(heights, phase, margin):
    """Return the sine and cosine parts of a wave of known phase, away from the borders."""
    inner = tuple(slice(margin, size - margin) for size in phase.shape)
    waves = np.stack([np.sin(phase)[inner].ravel(), np.cos(phase)[inner].ravel()], axis=1)
    return np.linalg.lstsq(waves, heights[inner].ravel())[0]


@pytest.mark.parametrize(("shortest", "longest"), [(0.0, 4.8), (1.6, 6.4)])
def test_waves_keep_the_share_that_is_promised(shortest, longest):
    points = CAMERA.points(np.zeros((150, 180)))
    for wavelength in (0.8, 1.6, 3.2, 2 * longest) if shortest else (0.8, longest):
        wave, turn, size = 2 * np.pi / wavelength, 0.5, 1e-3 * wavelength
        phase = wave * (points[..., 0] * math.cos(turn) + points[..., 1] * math.sin(turn))
        slope = size * wave * np.cos(phase)
        normals = normals_of(slope * math.cos(turn), slope * math.sin(turn))
        found = relief_from_normals(normals, CAMERA, shortest=shortest, longest=longest)
        sine, cosine = amplitude(found.heights, phase, 50) / size
        assert sine == pytest.approx(transfer(wavelength, shortest, longest), abs=4e-3)
        assert abs(cosine) < 2e-3
        assert found.outcome is Outcome.SOLVED
        assert found.unit == "mm"


def test_the_finest_waves_lose_what_the_docstring_says():
    for pixels, least, most in ((8, 0.99, 1.0), (5, 0.96, 0.97), (3, 0.74, 0.77)):
        phase = np.broadcast_to(2 * np.pi / pixels * np.arange(120.0), (4, 120))
        slope = 1e-3 * np.cos(phase) * 2 * np.pi / (pixels * PIXEL)
        found = relief_from_normals(normals_of(slope, 0 * slope), CAMERA, longest=8.0)
        inner = found.heights[2:3, 30:-30]
        waves = np.stack([np.sin(phase), np.cos(phase)], axis=-1)[2, 30:-30]
        sine = np.linalg.lstsq(waves, inner.ravel())[0][0] / 1e-3
        assert least < sine < most


def test_a_texture_on_a_slope_equals_its_fourier_band():
    """Any picture, exact slopes and exact band-pass by the discrete Fourier transform."""
    size, shortest, longest = 160, 1.2, 4.0
    rng = np.random.default_rng(7)
    frequency = np.fft.fftfreq(size, PIXEL)
    fx, fy = np.meshgrid(frequency, -frequency)  # y = −row
    radius = np.hypot(fx, fy)
    spectrum = np.fft.fft2(rng.normal(size=(size, size))) * np.exp(-((radius * 0.8) ** 2)) * (radius > 0)
    wavelength = 1.0 / np.where(radius > 0, radius, 1e-9)
    expected = np.fft.ifft2(spectrum * transfer(wavelength, shortest, longest)).real
    slopes = [np.fft.ifft2(spectrum * 2j * np.pi * f).real for f in (fx, fy)]
    scale = 0.05 / np.abs(slopes).max()
    found = relief_from_normals(
        normals_of(0.4 + scale * slopes[0], -0.2 + scale * slopes[1]), CAMERA, shortest=shortest, longest=longest
    )
    inner = (slice(40, -40), slice(40, -40))
    error = (found.heights / scale - expected)[inner]
    assert np.sqrt(np.mean(error**2)) < 0.015 * expected[inner].std()


def test_planes_leave_nothing_whatever_the_mask():
    mask = np.random.default_rng(0).random((50, 60)) > 0.2
    normals = np.broadcast_to(np.array([-0.6, 0.3, 0.74]), (50, 60, 3))
    found = relief_from_normals(normals, CAMERA, longest=3.0, mask=mask)
    np.testing.assert_array_equal(np.isfinite(found.heights), mask)
    assert np.nanmax(np.abs(found.heights)) < 1e-9


def test_a_sphere_leaves_little_at_its_border_and_nothing_inside():
    points = CAMERA.points(np.zeros((200, 200)))
    x, y, radius, longest = points[..., 0] - 10, points[..., 1] + 10, 40.0, 4.0
    heights = relief_from_normals(
        np.stack([x, y, np.sqrt(radius**2 - x * x - y * y)], axis=-1), CAMERA, longest=longest
    ).heights
    rule = longest**2 / (50 * radius)
    assert abs(heights[100, 0]) == pytest.approx(rule, rel=0.1)
    assert np.abs(heights).max() < 2.3 * rule
    assert np.abs(heights[100, 8:-8]).max() < 0.2 * rule
    assert np.abs(heights[8:-8, 8:-8]).max() < 0.4 * rule
    assert np.abs(heights[60:-60, 60:-60]).max() < 0.01 * rule


def test_slow_errors_of_the_normals_stay_out():
    """A groove on a plane, with normals that are wrong by up to 3 degrees over long distances."""
    points = CAMERA.points(np.zeros((100, 200)))
    x, y = points[..., 0] - 10, points[..., 1] + 5
    slope = 0.05 * x / 0.3**2 * np.exp(-(x**2) / (2 * 0.3**2))
    clean = relief_from_normals(normals_of(slope, 0 * slope), CAMERA, longest=4.0).heights
    wrong = normals_of(slope + 0.05 * np.sin(y / 9), 0.05 * np.cos(x / 12))
    found = relief_from_normals(wrong, CAMERA, longest=4.0).heights
    depth, _ = quad(lambda k: np.exp(-0.5 * (0.3 * k) ** 2) * transfer(2 * np.pi / k, 0.0, 4.0), 1e-9, 40.0)
    assert clean[50].min() == pytest.approx(-0.05 * 0.3 * 2 / np.sqrt(2 * np.pi) * depth, abs=1e-4)
    assert np.abs(found - clean)[20:-20, 20:-20].max() < 0.02 * 0.05


def test_central_projection_measures_on_the_surface():
    camera = Pinhole(fx=900.0, fy=720.0, cx=80.0, cy=60.0)
    rays, distance = camera.rays((120, 170)), np.full((120, 170), 120.0)
    wave, turn, size, slope = 2 * np.pi / 2.0, 0.7, 0.002, 0.2

    def surface(x, y):
        phase = wave * (x * math.cos(turn) + y * math.sin(turn))
        rise = size * wave * np.cos(phase)
        return phase, slope * x + size * np.sin(phase), slope + rise * math.cos(turn), rise * math.sin(turn)

    for _ in range(40):
        distance = 120.0 - surface(distance * rays[..., 0], distance * rays[..., 1])[1]
    phase, _, p, q = surface(distance * rays[..., 0], distance * rays[..., 1])
    for longest in (2.0, 4.0):
        found = relief_from_normals(normals_of(p, q), camera, longest=longest, distance=distance, unit="cm")
        sine, cosine = amplitude(found.heights, phase, 35) / size
        assert sine == pytest.approx(transfer(2.0, 0.0, longest), abs=6e-3)
        assert abs(cosine) < 5e-3
        assert found.unit == "cm"


def test_components_and_gaps_are_borders():
    """Both halves come out as if the other were not there."""
    points = CAMERA.points(np.zeros((40, 80)))
    slope = np.where(points[..., 0] < 4, 1.0, -1.0) + 0.05 * np.sin(6 * points[..., 0] + 3 * points[..., 1])
    normals = normals_of(slope, 0.5 * slope)
    parts = np.where(points[..., 0] < 4, 2, 5)
    parts[3, 3] = 0
    both = relief_from_normals(normals, CAMERA, longest=2.0, shortest=0.3, components=parts).heights
    assert np.isnan(both[3, 3])
    for one in (2, 5):
        alone = relief_from_normals(normals, CAMERA, longest=2.0, shortest=0.3, mask=parts == one).heights
        np.testing.assert_allclose(both[parts == one], alone[parts == one], rtol=0, atol=1e-6)
    joined = relief_from_normals(normals, CAMERA, longest=2.0, shortest=0.3).heights
    assert np.nanmax(np.abs(joined - both)) > 0.05


def test_what_is_left_out_is_left_out():
    normals = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (12, 12, 3)).copy()
    normals[2, 3], normals[4, 5] = np.nan, [1.0, 0.0, 0.05]
    found = relief_from_normals(normals, CAMERA, longest=1.0)
    assert np.argwhere(np.isnan(found.heights)).tolist() == [[2, 3], [4, 5]]
    found = relief_from_normals(normals, CAMERA, longest=1.0, steepest=math.radians(88.0))
    assert np.argwhere(np.isnan(found.heights)).tolist() == [[2, 3]]
    done = []
    pinhole = Pinhole(fx=9.0, fy=9.0, cx=5.0, cy=5.0)
    distance = np.full((12, 12), 9.0)
    distance[0, 0] = np.nan
    found = relief_from_normals(
        normals,
        pinhole,
        longest=8.0,
        shortest=2.0,
        distance=distance,
        unit="mm",
        progress=lambda stage, step, total: done.append((stage, step, total)),
    )
    assert np.argwhere(np.isnan(found.heights)).tolist() == [[0, 0], [2, 3], [4, 5]]
    assert done == [("relief", step, 7) for step in range(1, 8)]


def test_scattered_pixels_with_nothing_to_solve_do_not_spoil_the_verdict():
    rng = np.random.default_rng(1)
    normals = 0.1 * rng.normal(size=(60, 60, 3)) + [0.0, 0.0, 1.0]
    found = relief_from_normals(normals, CAMERA, longest=5.0, shortest=0.3, mask=rng.random((60, 60)) > 0.4)
    assert found.outcome is Outcome.SOLVED
    assert 0 < found.residual <= 1e-6
    assert found.iterations > 7


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1)])
def test_narrow_maps_have_a_relief_too(shape):
    rows, columns = np.indices(shape, dtype=np.float64)
    slope = 0.1 * np.cos(0.9 * (rows + columns))
    found = relief_from_normals(normals_of(slope, -slope), Orthographic(), longest=20.0)
    assert np.isfinite(found.heights).all()
    assert np.abs(found.heights).max() == pytest.approx(0.1 / 0.9 if max(shape) > 1 else 0.0, rel=0.35)


NORMALS = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (6, 7, 3))


@pytest.mark.parametrize(
    ("camera", "options", "message"),
    [
        (CAMERA, {"longest": 0.3}, "wavelengths are 0 and 0.3"),
        (CAMERA, {"longest": math.nan}, "wavelengths"),
        (CAMERA, {"longest": math.inf}, "wavelengths"),
        (CAMERA, {"longest": 2.0, "shortest": 0.1}, "wavelengths"),
        (CAMERA, {"longest": 2.0, "shortest": 2.0}, "wavelengths"),
        (CAMERA, {"longest": 2.0, "shortest": -1.0}, "wavelengths"),
        (CAMERA, {"longest": 2.0, "steepest": 0.0}, "inclination is 0.0"),
        (CAMERA, {"longest": 2.0, "steepest": 2.0}, "inclination is 2.0"),
        (CAMERA, {"longest": 2.0, "distance": 3.0, "unit": "mm"}, "orthographic"),
        (CAMERA, {"longest": 2.0, "components": np.zeros((6, 7), int)}, "No pixel"),
        (Pinhole(fx=9.0, fy=9.0, cx=2.0, cy=2.0), {"longest": 2.0}, "no distance is given"),
    ],
)
def test_hostile_options_are_refused(camera, options, message):
    with pytest.raises((InputError, OptionError), match=message):
        relief_from_normals(NORMALS, camera, **options)
