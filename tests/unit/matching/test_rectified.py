import numpy as np
import pytest

from psstereo.errors import InputError, OptionError
from psstereo.matching import (
    Disparity,
    MatchFlag,
    Noise,
    RectifiedMatcher,
    Smoothing,
    ViewImages,
    count_match_flags,
    disparity_score,
    fill_from_behind,
    visible_in_right,
)
from psstereo.matching.disparity import agree, hidden, without_specks
from tests.unit.matching.pairs import shifted_pair, texture, two_planes, views

NOISE = Noise(read=0.004)


def matcher(**options):
    return RectifiedMatcher.for_linear(**{"first": 0, "count": 16, "specks": 10, "checks": False, **options})


def test_a_plane_is_found_everywhere_it_is_seen():
    left, right = shifted_pair(disparity=5)
    found = matcher().match(*views(left, right, noise=NOISE))
    inside = found.disparity[:, 6:]
    assert np.isfinite(inside).mean() > 0.98
    np.testing.assert_allclose(inside[np.isfinite(inside)], 5, atol=0.5)
    assert np.nanmedian(np.abs(inside - 5)) < 0.05


def test_negative_disparities_are_found():
    left, right = shifted_pair(disparity=-3)
    found = matcher(first=-8, count=14).match(*views(left, right, noise=NOISE))
    assert np.nanmedian(found.disparity) == pytest.approx(-3, abs=0.1)
    assert found.matched[:, :-4].mean() > 0.98


def test_what_is_hidden_is_flagged_and_the_rest_is_right():
    left, right, truth, visible = two_planes()
    found = matcher().match(*views(left, right, noise=NOISE))
    score = disparity_score(found.disparity, truth, visible)
    assert score["bad-1"] < 3
    behind = np.zeros(truth.shape, bool)
    behind[12:28, 21:24] = True
    occluded = (found.flags & int(MatchFlag.OCCLUDED)) > 0
    assert occluded[behind].mean() > 0.8
    assert np.isnan(found.disparity[behind]).mean() > 0.8
    filled = matcher(fill=True).match(*views(left, right, noise=NOISE))
    assert np.median(filled.disparity[behind]) == pytest.approx(4, abs=1)  # from behind, not 9
    assert ((filled.flags & int(MatchFlag.FILLED)) > 0)[np.isnan(found.disparity) & np.isfinite(filled.disparity)].all()
    assert not filled.matched[behind].all()


def test_many_lights_match_what_one_light_cannot():
    rng = np.random.default_rng(5)
    shades = [texture((40, 100), seed, smooth=6) for seed in range(8)]
    noise = Noise(read=0.02)

    def photograph(shade, start):
        return np.clip(shade[:, start : start + 60] + 0.02 * rng.standard_normal((40, 60)), 0, 1)

    left, right = [photograph(s, 20) for s in shades], [photograph(s, 26) for s in shades]
    bad = {}
    for count in (1, 8):
        pair = views(left[:count], right[:count], noise=noise)
        found = matcher().match(*pair)
        truth = np.full((40, 60), 6.0)
        bad[count] = disparity_score(found.disparity, truth, np.indices(truth.shape)[1] > 8)["bad-1"]
    assert bad[8] < 2
    assert bad[1] > 5 * bad[8] + 5


def test_threads_do_not_change_anything():
    from concurrent.futures import ThreadPoolExecutor

    left, right, _, _ = two_planes()
    alone = matcher().match(*views(left, right, noise=NOISE))
    with ThreadPoolExecutor(3) as pool:
        together = matcher().match(*views(left, right, noise=NOISE), over=pool.map)
    np.testing.assert_array_equal(alone.disparity, together.disparity)
    np.testing.assert_array_equal(alone.flags, together.flags)


def test_the_mask_is_kept():
    left, right = shifted_pair(disparity=5)
    mask = np.ones(left.shape, bool)
    mask[:10] = False
    one = ViewImages.from_arrays(left, noise=NOISE, mask=mask)
    found = matcher().match(one, views(left, right, noise=NOISE)[1])
    assert np.isnan(found.disparity[:10]).all()
    assert count_match_flags(found.flags)["OUTSIDE_MASK"] == 10 * left.shape[1]


def test_gain_and_offset_are_found_when_asked_for():
    left, right = shifted_pair((60, 90), disparity=5)
    changed = np.clip(0.6 * right + 0.05, 0, 1)
    one, two = views(left, changed, noise=NOISE)
    found = matcher(exposure="estimate").match(one, two)
    assert found.gain == pytest.approx(1 / 0.6, rel=0.02)
    assert found.offset == pytest.approx(-0.05 / 0.6, abs=0.01)
    assert np.isfinite(found.disparity[:, 6:]).mean() > 0.95
    assert np.nanmedian(found.disparity) == pytest.approx(5, abs=0.1)


def test_a_different_exposure_is_named():
    left, right = shifted_pair((60, 90), disparity=5)
    with pytest.raises(InputError, match=r"exposures differ: left is 1\.6\d? times as bright"):
        matcher(checks=True).match(*views(left, 0.6 * right, noise=NOISE))
    with pytest.raises(InputError, match="right is"):
        matcher(checks=True).match(*views(0.5 * left, right, noise=NOISE))


@pytest.mark.parametrize("rows", [3, -2])
def test_a_pair_that_is_not_rectified_is_named_with_its_offset(rows):
    left, right = shifted_pair((90, 140), disparity=5)
    moved = np.roll(right, rows, axis=0)
    with pytest.raises(InputError, match=f"not rectified.*{abs(rows)}.0 rows {'lower' if rows > 0 else 'higher'}"):
        matcher(checks=True).match(*views(left, moved, noise=NOISE))


def test_a_good_pair_passes_all_checks():
    left, right = shifted_pair((90, 140), disparity=5)
    found = matcher(checks=True).match(*views(left, right, noise=NOISE))
    assert [step.done for step in found.steps] == [True, True]
    assert "0.0" in found.steps[0].reason


def test_views_of_different_things_are_refused():
    left, _ = shifted_pair((90, 140), seed=1)
    with pytest.raises(InputError, match=r"no overlap in this range\. Of .* corners"):
        matcher(checks=True).match(*views(left, shifted_pair((90, 140), seed=9)[1], noise=NOISE))


def test_too_few_corners_are_said_to_be_too_few():
    ramp = np.tile(np.linspace(0.2, 0.8, 60), (40, 1))
    found = matcher(checks=True).match(*views(ramp, ramp, noise=NOISE))
    assert not found.steps[0].done
    assert "corners" in found.steps[0].reason


def test_a_plain_noisy_pair_is_not_taken_for_different_things():
    rng = np.random.default_rng(0)
    shade = texture((60, 140), 3, smooth=12)
    left, right = (shade[:, s : s + 90] + 0.02 * rng.standard_normal((60, 90)) for s in (20, 26))
    found = matcher(checks=True).match(*views(left, right, noise=Noise(read=0.02)))
    assert found.steps[0].name == "rectification"
    assert found.matched.mean() > 0.5


def test_halves_of_a_picture_do_not_overlap():
    wide = texture((60, 200), 4)
    with pytest.raises(InputError, match="no overlap"):
        matcher(checks=True).match(*views(wide[:, :90], wide[:, 110:], noise=NOISE))


def test_sizes_and_lights_that_differ_are_refused():
    left, right = shifted_pair()
    with pytest.raises(InputError, match="60 × 40"):
        matcher().match(*views(left, right[:, :50], noise=NOISE))
    with pytest.raises(InputError, match="same lights"):
        matcher().match(*views([left, left], right, noise=NOISE))
    with pytest.raises(OptionError, match="columns"):
        matcher(first=70).match(*views(left, right, noise=NOISE))


@pytest.mark.parametrize(
    "options", [{"count": 1}, {"median": 4}, {"exposure": "x"}, {"floor": -1.0}, {"tolerance": 0.0}, {"specks": -1}]
)
def test_options_out_of_range_are_refused(options):
    with pytest.raises(OptionError):
        RectifiedMatcher(**options)


@pytest.mark.parametrize("options", [{"small": 0}, {"large": 3}, {"paths": 6}, {"soft": 0.0}])
def test_penalties_out_of_range_are_refused(options):
    with pytest.raises(OptionError):
        Smoothing(**options)


@pytest.mark.parametrize("options", [{"brightness": 0.0, "gradient": 0.0}, {"top": 0.0}, {"brightness": -1.0}])
def test_weights_out_of_range_are_refused(options):
    left, right = shifted_pair()
    with pytest.raises(OptionError):
        matcher(**options).match(*views(left, right, noise=NOISE))


def test_depth_follows_from_disparity():
    found = Disparity(
        disparity=np.array([[10.0, np.nan, -3.0]], np.float32),
        confidence=np.ones((1, 3), np.float32),
        flags=np.zeros((1, 3), np.uint16),
    )
    np.testing.assert_allclose(found.depth(500.0, 0.2), [[10.0, np.nan, np.nan]])
    np.testing.assert_allclose(found.depth(500.0, 0.2, shift=10.0), [[5.0, np.nan, 100 / 7]])


def test_gaps_are_filled_from_behind():
    row = np.array([[np.nan, 5.0, np.nan, np.nan, 2.0, np.nan], [np.nan] * 6])
    np.testing.assert_array_equal(fill_from_behind(row), [[5, 5, 2, 2, 2, 2], [np.nan] * 6])


def test_agreement_looks_at_the_match_and_its_neighbours():
    left, right = np.array([[np.nan, np.nan, 2.0, 2.0]]), np.array([[2.0, 9.0, 9.0, 9.0]])
    assert agree(left, right, 1.0).tolist() == [[False, False, True, True]]
    assert agree(left, np.full((1, 4), 9.0), 1.0).tolist() == [[False] * 4]


def test_what_no_pixel_of_the_other_view_leads_to_is_hidden():
    other = np.array([[1.0, 1.0, 3.0, 3.0, 3.0, np.nan, np.nan, np.nan, np.nan]])
    assert hidden(other).tolist() == [[True, False, False, True, True, False, False, False, True]]


def test_small_patches_are_told():
    values = np.full((12, 12), 3.0)
    values[5, 5] = 9.0
    kept = without_specks(values, 4, 1.0)
    assert not kept[5, 5]
    assert kept.sum() == 143
    assert without_specks(values, 0, 1.0).all()


def test_visible_points_are_those_that_nothing_hides():
    _, _, truth, visible = two_planes()
    assert (visible_in_right(truth) == visible).mean() > 0.99


def test_scores_count_what_is_missing():
    truth = np.full((1, 4), 5.0)
    score = disparity_score(np.array([[5.2, 8.0, np.nan, 5.0]]), truth, np.ones((1, 4), bool))
    assert (score["bad-1"], score["bad-1 filled"], score["missing"]) == (50.0, 25.0, 25.0)
    with pytest.raises(InputError):
        disparity_score(truth, truth, np.zeros((1, 4), bool))
