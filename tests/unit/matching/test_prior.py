import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.matching import (
    Disparity,
    MatchFlag,
    ViewImages,
    crossover,
    failure_report,
    pair_constancy,
    prior_from_disparity,
    reject_by_surface,
)
from psstereo.matching.noise import Noise


def disparity(values, confidence=0.5):
    d = np.array(values, np.float32)
    return Disparity(
        disparity=d, confidence=np.full(d.shape, confidence, np.float32), flags=np.zeros(d.shape, np.uint16)
    )


def test_scatter_of_depth_follows_from_that_of_disparity():
    found = prior_from_disparity(disparity([[10.0, 20.0, np.nan]]), 400.0, 0.5, unit="m", sigma=0.25)
    np.testing.assert_allclose(found.depth, [[20, 10, np.nan]])
    step = 1e-4  # a small change of the disparity, as a difference
    slope = (200 / (10.0 - step) - 200 / (10.0 + step)) / (2 * step)
    np.testing.assert_allclose(found.sigma[0, 0], 0.25 * slope, rtol=1e-6)
    np.testing.assert_allclose(found.sigma, [[0.5, 0.125, np.nan]])
    assert found.unit == "m"


def test_filled_pixels_are_no_measurement():
    found = disparity([[10.0, 20.0]])
    found.flags[0, 1] = int(MatchFlag.FILLED)
    assert np.isnan(prior_from_disparity(found, 400.0, 0.5, unit="m").depth[0, 1])


def test_doubtful_matches_weigh_less():
    sure, doubtful = (
        prior_from_disparity(disparity([[10.0]], c), 400.0, 0.5, unit="m").sigma[0, 0] for c in (0.9, 0.05)
    )
    assert doubtful == pytest.approx(10 * sure)


def test_crossover_is_where_both_know_as_much():
    wavelength = crossover(0.2, 0.01)
    assert 2 * np.pi * 0.2 / wavelength == pytest.approx(0.01)  # slope of a wave with the depth's scatter as amplitude
    with pytest.raises(InputError):
        crossover(0.0, 1.0)


def test_matches_of_different_normals_or_albedos_are_taken_back():
    found = disparity([[np.nan, 1.0, 1.0, 1.0]])
    up, aside = np.array([0.0, 0, 1]), np.array([0.6, 0.0, 0.8])
    one, two = np.tile(up, (1, 4, 1)), np.tile(up, (1, 4, 1))
    two[0, 1] = aside  # the match of column 2
    kept = reject_by_surface(found, (one, two))
    assert np.isfinite(kept.disparity).tolist() == [[False, True, False, True]]
    assert kept.flags[0, 2] == int(MatchFlag.REJECTED)
    paint = (np.full((1, 4), 0.5), np.array([[0.5, 0.5, 0.2, 0.5]]))
    kept = reject_by_surface(found, (one, two), paint)
    assert np.isfinite(kept.disparity).tolist() == [[False, True, False, False]]
    one[0, 2] = np.nan  # where one end has no normal, nothing is said
    assert np.isfinite(reject_by_surface(found, (one, two)).disparity[0, 2])
    with pytest.raises(InputError):
        reject_by_surface(found, (one[:, :2], two))


def test_priors_that_are_none_are_refused():
    with pytest.raises(InputError):
        prior_from_disparity(disparity([[np.nan]]), 400.0, 0.5, unit="m")
    with pytest.raises(InputError):
        prior_from_disparity(disparity([[3.0]]), -1.0, 0.5, unit="m")


def test_failures_are_named_by_their_cause():
    truth = np.full((40, 60), 0.5)
    truth[:, :20] = 0.01  # in shadow
    left, right = truth.copy(), truth.copy()
    right[:, 19:21] = 0.3  # its edge falls into other pixels
    left[10:14, 40:45] = 0.9  # a highlight
    left[30, 50] = 1.0
    noise = Noise(step=1 / 255)
    one, two = (ViewImages.from_arrays(np.rint(255 * image).astype(np.uint8), noise=noise) for image in (left, right))
    visible = np.ones(truth.shape, bool)
    visible[:, 58:] = False
    found = failure_report(pair_constancy(one, two, np.zeros(truth.shape), visible), one, visible)
    assert found.classes["occluded"].sum() == 80
    assert found.classes["saturated"].sum() == 1
    assert found.classes["specular"][10:14, 40:45].all()
    assert found.classes["shadow-edge"][:, 19:21].all()
    assert found.classes["other"].sum() == 0
    assert sum(found.shares().values()) == pytest.approx((80 + 1 + 20 + 80) / truth.size)
    assert [row[0] for row in found.rows()] == ["occluded", "saturated", "shadow-edge", "specular", "other"]
