import numpy as np
import pytest

from psstereo.brdf import Ggx, Lambert
from psstereo_synth.lecture import LECTURE
from psstereo_synth.lecture.viewpoints import same_points
from psstereo_synth.shapes import GaussianHills


@pytest.fixture(scope="module")
def rows():
    return LECTURE["viewpoints"]().rows


@pytest.fixture(scope="module")
def matte():
    return same_points(Lambert)


@pytest.fixture(scope="module")
def glossy():
    return same_points(Ggx)


def test_the_matte_patch_is_what_lamberts_law_gives(rows):
    patch = np.array([row[1] for row in rows if row[0].startswith("patch from")])
    assert len(patch) == 9
    assert patch == pytest.approx(0.6 / np.pi * 750 * np.cos(np.deg2rad(40)), rel=1e-13)


def test_the_glossy_patch_is_brightest_in_the_mirror_direction(rows):
    patch = {row[0]: row[2] for row in rows if row[0].startswith("patch from")}
    assert max(patch, key=patch.get).startswith("patch from -40°")
    assert max(patch.values()) > 4 * sorted(patch.values())[-2]


def test_both_cameras_see_what_lamberts_law_gives(matte):
    points, left, right = matte
    assert len(points) >= 30
    x, y, z = points.T
    hills, step = GaussianHills(), 1e-5

    def slope(dx, dy):
        # Central differences of fourth order, of the heights alone.
        heights = [hills.evaluate(x + k * dx, y + k * dy).height for k in (-2, -1, 1, 2)]
        return (heights[0] - 8 * heights[1] + 8 * heights[2] - heights[3]) / (12 * step)

    assert hills.evaluate(x, y).height == pytest.approx(z, abs=1e-12)
    zx, zy = slope(step, 0.0), slope(0.0, step)
    tilt, turn = np.deg2rad([30.0, 75.0])
    light = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
    cosine = np.stack([-zx, -zy, np.ones_like(zx)], axis=-1) @ light / np.sqrt(zx**2 + zy**2 + 1)
    cells = np.stack([x + 1, y + 1]) * 7 / 2
    assert np.abs(cells - np.round(cells)).min() > 1e-6  # no point on an edge of the paint
    albedo = np.where(np.floor(cells).sum(axis=0) % 2 == 0, 0.3, 0.7)
    assert left == pytest.approx(albedo / np.pi * 1000 * cosine, rel=1e-8)
    assert set(albedo) == {0.3, 0.7}
    assert right == pytest.approx(left, rel=1e-12)


def test_a_glossy_landscape_looks_different_from_the_right(glossy):
    points, left, right = glossy
    assert len(points) >= 30
    change = np.abs(right / left - 1)
    assert change.max() > 0.1
    assert np.median(change) > 1e-3


def test_the_table_says_so(rows, matte, glossy):
    last = rows[-1]
    assert last[0].startswith("hills")
    assert last[1] == pytest.approx(np.abs(matte[1] / matte[2] - 1).max(), abs=1e-15)
    assert last[2] == pytest.approx(np.abs(glossy[1] / glossy[2] - 1).max(), rel=1e-12)
