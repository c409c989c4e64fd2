import numpy as np
import pytest

from psstereo.brdf import Brdf, Lambert
from psstereo.errors import InputError
from psstereo_synth.lecture import LECTURE
from psstereo_synth.lecture.dome import dome, measure, photograph

N = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def rows():
    return LECTURE["laboratory"]().rows


class OneWay(Brdf):
    name = "one-way"
    channels = 1

    def evaluate(self, normals, to_light, to_eye):
        cosine = np.einsum("...i,...i->...", normals, to_light)[..., None]
        return cosine / np.pi + 0.0 * np.asarray(to_eye)[..., :1]


def angles(text):
    return [float(part) for part in text.split("/")]


def oren_nayar(lamp, eye, albedo, sigma):
    # In angles, as it was published.
    (tl, pl), (tv, pv) = np.deg2rad(lamp), np.deg2rad(eye)
    a = 1 - 0.5 * sigma**2 / (sigma**2 + 0.33)
    b = 0.45 * sigma**2 / (sigma**2 + 0.09)
    return albedo / np.pi * (a + b * max(0, np.cos(pl - pv)) * np.sin(max(tl, tv)) * np.tan(min(tl, tv)))


def ggx(lamp, eye, albedo, f0, roughness):
    i, o = dome(*lamp), dome(*eye)
    h = (i + o) / np.linalg.norm(i + o)
    square = roughness**4

    def fresnel(x):
        return f0 + (1 - f0) * (1 - x) ** 5

    def tail(w):
        return (-1 + np.sqrt(1 + square * (1 - w[2] ** 2) / w[2] ** 2)) / 2

    d = square / (np.pi * (h[2] ** 2 * (square - 1) + 1) ** 2)
    mirrors = d * fresnel(i @ h) / (1 + tail(i) + tail(o)) / (4 * i[2] * o[2])
    return mirrors + (1 - fresnel(i[2])) * (1 - fresnel(o[2])) * albedo / np.pi


EXPECTED = {
    "matte": lambda lamp, eye: 0.6 / np.pi,
    "rough": lambda lamp, eye: oren_nayar(lamp, eye, 0.6, 0.5),
    "glossy": lambda lamp, eye: ggx(lamp, eye, 0.3, 0.05, 0.3),
}


@pytest.mark.parametrize("sample", EXPECTED)
def test_reflectance_is_that_of_the_textbook(rows, sample):
    mine = [row for row in rows if row[0] == sample]
    assert len(mine) == 10
    for _, lamp, eye, measured, exchanged, model in mine:
        expected = EXPECTED[sample](angles(lamp), angles(eye))
        assert measured == pytest.approx(expected, rel=1e-12)
        assert exchanged == pytest.approx(expected, rel=1e-12)
        assert model == pytest.approx(expected, rel=1e-12)


def test_places_cover_a_highlight_and_a_retroreflection(rows):
    glossy = [row[3] for row in rows if row[0] == "glossy"]
    assert max(glossy) > 10 * np.median(glossy)
    rough = {(row[1], row[2]): row[3] for row in rows if row[0] == "rough"}
    assert rough["80 / 100", "80 / 100"] > 2 * rough["0 / 0", "0 / 0"]


def test_the_laboratory_would_notice_a_model_that_is_not_reciprocal():
    ways = [dome(0.0, 0.0), dome(70.0, 20.0)]
    found = measure(OneWay(), ways, ways)
    # The model's value is the light's cosine over pi.
    assert found * np.pi == pytest.approx(np.array([[1.0, 1.0], [1.0, 1.0]]) * [[1.0], [np.cos(np.deg2rad(70))]])


def test_radiances_themselves_are_not_reciprocal():
    ways = [dome(0.0, 0.0), dome(60.0, 0.0)]
    seen = photograph(Lambert(albedo=np.array([0.6])), ways, ways)
    assert seen[0, 1] / seen[1, 0] == pytest.approx(2.0, rel=1e-14)


def test_grazing_light_and_eye():
    ways = [dome(89.0, 10.0), dome(85.0, 200.0)]
    assert measure(Lambert(albedo=np.array([1.0])), ways, ways) * np.pi == pytest.approx(np.ones((2, 2)), rel=1e-12)


@pytest.mark.parametrize("tilt", [91.0, 180.0, np.nan])
def test_light_below_the_sample_is_refused(tilt):
    with pytest.raises(InputError, match="above"):
        measure(Lambert(albedo=np.array([0.5])), [dome(tilt, 0.0)], [N])


def test_a_camera_below_the_sample_is_refused():
    with pytest.raises(InputError):
        measure(Lambert(albedo=np.array([0.5])), [N], [dome(120.0, 0.0)])
