"""Files of RTI viewers: readers written from the formats' descriptions find the library's own pictures in them."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from psstereo.capture import Capture
from psstereo.errors import ExistingResultError, InputError, MissingFileError, OptionError, RigError, UnsupportedError
from psstereo.forward.polynomial_maps import basis_values, fit_polynomial_maps, relit_picture
from psstereo.io.ptm_file import write_ptm
from psstereo.io.rti_file import write_rti
from psstereo.io.rti_planes import TERMS, quantised_planes
from psstereo.lights import Led, Rig
from psstereo.stack import MemoryStack

HEIGHT, WIDTH = 5, 7


def lights(count=30, seed=3):
    """Directions over the hemisphere, none near the rim."""
    random = np.random.default_rng(seed)
    tilt, azimuth = np.arccos(random.uniform(0.3, 1.0, count)), random.uniform(0, 2 * np.pi, count)
    return np.stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)], axis=1)


def capture_of(values, directions, strengths=None):
    return Capture(stack=MemoryStack(values), rig=Rig.distant(directions, strengths))


def painted(channels=3, seed=1, count=30):
    """A capture whose brightness is a polynomial of each pixel and channel, within 0 and 1, with one pixel apart."""
    random = np.random.default_rng(seed)
    directions = lights(count)
    coefficients = 0.07 * random.standard_normal((6, HEIGHT, WIDTH, channels))
    coefficients[5] = random.uniform(0.3, 0.7, (HEIGHT, WIDTH, channels))
    coefficients[:, 0, 0] = 0.0
    coefficients[5, 0, 0] = 1.0  # top left is white: rows cannot be mixed up
    values = np.einsum("mt,thwc->mhwc", basis_values("ptm", directions), coefficients)
    assert values.min() > 0
    assert values.max() <= 1 + 1e-12
    return capture_of(np.minimum(values, 1.0), directions), coefficients


def read_ptm(path):
    """Return a function of (u, v) that draws the picture; from the description of PTM 1.2 alone."""
    data = path.read_bytes()
    lines, rest = [], data
    for _ in range(6):
        line, rest = rest.split(b"\n", 1)
        lines.append(line.decode("ascii"))
    assert lines[0] == "PTM_1.2"
    width, height = int(lines[2]), int(lines[3])
    scales = [float(word) for word in lines[4].split()]
    biases = [int(word) for word in lines[5].split()]
    assert len(scales) == len(biases) == 6
    assert all(0 <= bias <= 255 for bias in biases)
    count = width * height

    def value(block, pixel, u, v):
        a = [(block[6 * pixel + k] - biases[k]) * scales[k] for k in range(6)]
        return a[0] * u * u + a[1] * v * v + a[2] * u * v + a[3] * u + a[4] * v + a[5]

    def draw(u, v):
        picture = np.zeros((height, width, 3), np.uint8)
        for pixel in range(count):
            row, column = height - 1 - pixel // width, pixel % width  # bottom to top
            for c in range(3):
                if lines[1] == "PTM_FORMAT_LRGB":
                    colour = rest[6 * count + 3 * pixel + c]
                    shown = value(rest[: 6 * count], pixel, u, v) * colour / 255
                else:
                    shown = value(rest[6 * count * c : 6 * count * (c + 1)], pixel, u, v)
                picture[row, column, c] = int(min(max(shown, 0), 255) + 0.5)
        return picture

    assert len(rest) == count * (9 if lines[1] == "PTM_FORMAT_LRGB" else 18)
    return lines[1], draw


def read_rti(path):
    """The same for universal files with hemispherical harmonics, their terms written with angles."""
    rest = path.read_bytes()
    assert rest.startswith(b"#HSH1.2\n")
    while rest.startswith(b"#"):
        rest = rest.split(b"\n", 1)[1]
    kind, size, layout, rest = rest.split(b"\n", 3)
    width, height, channels = (int(word) for word in size.split())
    terms, colour, element = (int(word) for word in layout.split())
    assert (int(kind), channels, colour, element) == (3, 3, 2, 1)
    numbers = np.frombuffer(rest, "<f4", 2 * terms).astype(float)
    body = rest[8 * terms :]
    assert len(body) == width * height * 3 * terms

    def draw(x, y):
        theta, phi = np.arccos(np.sqrt(1 - x * x - y * y)), np.arctan2(y, x)
        cos, root = np.cos(theta), np.sqrt(np.cos(theta) - np.cos(theta) ** 2)
        pi = np.pi
        basis = [
            1 / np.sqrt(2 * pi),
            np.sqrt(6 / pi) * np.cos(phi) * root,
            np.sqrt(3 / (2 * pi)) * (2 * cos - 1),
            np.sqrt(6 / pi) * np.sin(phi) * root,
            np.sqrt(30 / pi) * np.cos(2 * phi) * (cos**2 - cos),
            np.sqrt(30 / pi) * np.cos(phi) * (2 * cos - 1) * root,
            np.sqrt(5 / (2 * pi)) * (1 - 6 * cos + 6 * cos**2),
            np.sqrt(30 / pi) * np.sin(phi) * (2 * cos - 1) * root,
            np.sqrt(30 / pi) * np.sin(2 * phi) * (cos**2 - cos),
        ]
        picture = np.zeros((height, width, 3), np.uint8)
        for place, byte in enumerate(np.ndindex(height, width, 3)):  # top to bottom
            codes = body[terms * place : terms * (place + 1)]
            total = sum((codes[t] / 255 * numbers[t] + numbers[terms + t]) * basis[t] for t in range(terms))
            picture[byte] = int(min(max(255 * total, 0), 255) + 0.5)
        return picture

    return terms, draw


VIEWS = [(0.0, 0.0), (0.6, -0.1), (-0.3, 0.7)]


@pytest.mark.parametrize("colour", ["rgb", "lrgb"])
@pytest.mark.parametrize("channels", [1, 3])
def test_a_ptm_file_holds_the_library_s_pictures(colour, channels, tmp_path):
    capture, _ = painted(channels)
    maps = fit_polynomial_maps(capture, colour=colour, curve="linear")
    write_ptm(tmp_path / "a.ptm", maps.planes)
    kind, draw = read_ptm(tmp_path / "a.ptm")
    assert kind == f"PTM_FORMAT_{colour.upper()}"
    for u, v in VIEWS:
        expected = relit_picture(maps.planes, (u, v, np.sqrt(1 - u * u - v * v)))
        np.testing.assert_array_equal(draw(u, v), np.broadcast_to(expected, (HEIGHT, WIDTH, 3)))
        assert draw(u, v)[0, 0].min() > 250


@pytest.mark.parametrize("basis", ["hsh4", "hsh9"])
def test_an_rti_file_holds_the_library_s_pictures(basis, tmp_path):
    capture, _ = painted()
    maps = fit_polynomial_maps(capture, basis=basis, colour="rgb", curve="linear")
    write_rti(tmp_path / "a.rti", maps.planes)
    terms, draw = read_rti(tmp_path / "a.rti")
    assert terms == TERMS[basis]
    for u, v in VIEWS:
        expected = relit_picture(maps.planes, (u, v, np.sqrt(1 - u * u - v * v)))
        np.testing.assert_array_equal(draw(u, v), expected)


def test_the_fit_finds_a_polynomial_and_bytes_are_within_half_a_step():
    capture, truth = painted()
    maps = fit_polynomial_maps(capture, colour="rgb", curve="linear")
    np.testing.assert_allclose(maps.coefficients, truth, atol=1e-12)
    assert maps.residual < 1e-7
    planes = maps.planes
    decoded = (planes.codes - planes.bias[:, None, None, None]) * planes.scale[:, None, None, None] / 255
    assert (np.abs(decoded - truth) <= 0.5001 * planes.scale[:, None, None, None] / 255).all()


def test_the_residual_is_that_of_the_pictures():
    random = np.random.default_rng(2)
    directions = lights(20)
    values = random.uniform(0, 1, (20, 3, 4, 1))
    maps = fit_polynomial_maps(capture_of(values, directions), basis="hsh4", colour="rgb", curve="linear")
    shown = np.einsum("mt,thwc->mhwc", basis_values("hsh4", directions), maps.coefficients)
    assert maps.residual == pytest.approx(np.sqrt(np.mean((shown - values) ** 2)), rel=1e-9)


def test_strengths_exposure_curve_and_lights_from_behind():
    capture, truth = painted()
    strengths = np.random.default_rng(4).uniform(0.3, 3.0, (30, 3))
    raw = capture.stack.read() * (strengths / strengths.mean())[:, None, None] / 4  # four times underexposed
    directions = np.concatenate([capture.rig.directions, [[0.6, 0.0, -0.8]]])
    both = capture_of(
        np.concatenate([raw, np.ones((1, HEIGHT, WIDTH, 3))]), directions, np.concatenate([strengths, np.ones((1, 3))])
    )
    maps = fit_polynomial_maps(
        both, colour="rgb", curve="linear", exposure=4 * strengths.mean() / both.rig.strengths(3).mean()
    )
    np.testing.assert_allclose(maps.coefficients, truth, atol=1e-12)
    assert "1 images" in maps.notes[0]
    even = capture_of(np.full((30, 2, 2, 1), 0.2), lights())
    shown = relit_picture(fit_polynomial_maps(even, colour="rgb").planes, (0, 0, 1))
    np.testing.assert_array_equal(shown, np.full((2, 2, 1), round(255 * (1.055 * 0.2 ** (1 / 2.4) - 0.055))))


def test_whole_numbers_and_floats_give_the_same():
    random = np.random.default_rng(9)
    codes = random.integers(0, 65536, (12, 4, 5, 3)).astype(np.uint16)
    strengths = random.uniform(0.5, 2.0, (12, 3))
    for curve in ("srgb", "linear"):
        one = fit_polynomial_maps(capture_of(codes, lights(12), strengths), curve=curve, exposure=1.7)
        two = fit_polynomial_maps(capture_of(codes / 65535.0, lights(12), strengths), curve=curve, exposure=1.7)
        np.testing.assert_allclose(one.coefficients, two.coefficients, atol=1e-12)


def test_lrgb_keeps_colours_that_do_not_change():
    random = np.random.default_rng(6)
    gray, _ = painted(1)
    paint = random.uniform(0.2, 1.0, (HEIGHT, WIDTH, 3))
    capture = capture_of(gray.stack.read() * paint, gray.rig.directions)
    maps = fit_polynomial_maps(capture, colour="lrgb", curve="linear")
    light = np.array([0.3, 0.2, np.sqrt(1 - 0.13)])
    exact = 255 * np.einsum("t,thwc->hwc", basis_values("ptm", light), maps.coefficients)
    assert np.abs(relit_picture(maps.planes, light).astype(float) - exact).max() < 3.0


def test_the_harmonics_are_orthonormal_over_the_hemisphere():
    def product(i, j):
        def at(phi, z):
            r = np.sqrt(1 - z * z)
            values = basis_values("hsh9", np.array([r * np.cos(phi), r * np.sin(phi), z]))
            return values[i] * values[j]

        return dblquad(at, 0, 1, 0, 2 * np.pi, epsabs=1e-7)[0]

    for i, j in [(0, 0), (1, 1), (4, 4), (5, 5), (6, 6), (8, 8), (1, 5), (2, 6), (0, 2)]:
        assert product(i, j) == pytest.approx(float(i == j), abs=1e-6)


def test_what_cannot_be_is_refused(tmp_path):
    capture, _ = painted()
    for words, error in [
        ({"basis": "ptn"}, OptionError),
        ({"colour": "hsv"}, OptionError),
        ({"curve": "log"}, OptionError),
        ({"exposure": 0.0}, OptionError),
        ({"exposure": float("nan")}, OptionError),
        ({"basis": "hsh4", "colour": "lrgb"}, OptionError),
    ]:
        with pytest.raises(error):
            fit_polynomial_maps(capture, **words)
    few = capture_of(np.full((5, 2, 2), 0.5), lights(5))
    with pytest.raises(RigError, match="5 lights"):
        fit_polynomial_maps(few)
    turn = np.arange(12) * (2 * np.pi / 12)
    ring = np.stack([0.8 * np.cos(turn), 0.8 * np.sin(turn), np.full(12, 0.6)], axis=1)
    with pytest.raises(RigError, match="one ring"):
        fit_polynomial_maps(capture_of(np.full((12, 2, 2), 0.5), ring))
    lamp = Led(position=np.array([0.0, 0.0, 9.0]), axis=np.array([0.0, 0.0, -1.0]), mu=1.0, flux=np.ones(1))
    with pytest.raises(UnsupportedError, match="distant"):
        fit_polynomial_maps(Capture(stack=MemoryStack(np.full((7, 2, 2), 0.5)), rig=Rig((lamp,) * 7)))
    planes = fit_polynomial_maps(capture).planes
    with pytest.raises(RigError, match="behind"):
        relit_picture(planes, (0.6, 0.0, -0.8))
    with pytest.raises(UnsupportedError, match="hemispherical"):
        write_rti(tmp_path / "a.rti", planes)
    hsh = fit_polynomial_maps(capture, basis="hsh4", colour="rgb").planes
    with pytest.raises(UnsupportedError, match="polynomials"):
        write_ptm(tmp_path / "a.ptm", hsh)
    with pytest.raises(MissingFileError):
        write_ptm(tmp_path / "none" / "a.ptm", planes)
    with pytest.raises(InputError, match="not finite"):
        quantised_planes(np.full((6, 1, 1, 1), np.nan), "ptm")
    with pytest.raises(InputError, match="terms"):
        quantised_planes(np.zeros((4, 1, 1, 1)), "ptm")
    write_ptm(tmp_path / "a.ptm", planes)
    before = (tmp_path / "a.ptm").read_bytes()
    with pytest.raises(ExistingResultError, match="overwrite"):
        write_ptm(tmp_path / "a.ptm", planes)
    write_ptm(tmp_path / "a.ptm", planes, overwrite=True)
    assert (tmp_path / "a.ptm").read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.ptm"]


def test_flat_pictures_and_huge_ranges_survive_rounding():
    for basis in TERMS:
        still = quantised_planes(np.full((TERMS[basis], 1, 2, 1), -0.25), basis)
        assert np.isfinite(still.levels()).all()
        wild = np.zeros((TERMS[basis], 1, 2, 1))
        wild[:, 0, 0] = 1e6
        assert (np.diff(quantised_planes(wild, basis).levels(), axis=1) > 0).all()
