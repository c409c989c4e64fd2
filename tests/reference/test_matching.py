"""Brightness constancy and the matcher against truth, against OpenCV's matcher, and on real pairs."""

from pathlib import Path

import numpy as np
import pytest

from psstereo.matching import (
    Noise,
    PlaneSweep,
    RectifiedMatcher,
    ViewImages,
    compare_values,
    disparity_score,
    inside_box,
    nearest_views,
    pair_constancy,
    prior_from_disparity,
    read_disparity,
    read_view_list,
    reject_by_surface,
    visible_in_right,
)
from psstereo.stack.decode import decode_image
from psstereo_synth.rendering import render
from psstereo_synth.stereo import same_points, true_disparity
from psstereo_synth.stereo_rig import CAMERA, stereo_rig

EXACT = Noise(step=1 / 65535)
CAMERA_NOISE = Noise(step=1 / 4095, electrons=10_000, read=5 / 10_000)
TEMPLE_BOX = np.array([[-0.073568, 0.021728, -0.012445], [0.028855, 0.181892, 0.062736]])


def compared(points, noise=EXACT):
    return compare_values(points.image(points.first), points.image(points.second), points.mask, (noise, noise))


def test_matte_points_are_equal_within_rounding_and_glossy_ones_fail_where_the_highlight_is():
    matte, glossy = (same_points(stereo_rig(64, lights=1, glossy=g)) for g in (False, True))
    assert compared(matte).within_rounding >= 0.999
    found = compared(glossy)
    assert found.within_rounding < 0.95
    assert found.share_explained < 0.95
    # The highlight is what is more than the diffuse part by more than the comparison can tell from rounding.
    lobe = (glossy.radiance - matte.radiance) / (glossy.radiance.max() / 0.9)
    bound = 2.576 * np.sqrt(2) * EXACT.sigma(0.5)
    highlight = np.zeros(glossy.shape, bool)
    highlight[tuple(glossy.pixels.T)] = (np.abs(lobe) > bound).any(axis=(0, 1, 3))
    both, either = highlight & found.failing, highlight | found.failing
    assert both.sum() / either.sum() > 0.9


def test_noise_explains_what_a_camera_shows_of_matte_points():
    points = same_points(stereo_rig(64, lights=4, sensor=CAMERA))
    found = compared(points, CAMERA_NOISE)
    assert found.share_explained == pytest.approx(0.99, abs=0.01)


def match_rig(lights, *, painted):
    scene = stereo_rig(128, lights=8, painted=painted, sensor=CAMERA)
    shots, truth = render(scene), true_disparity(scene)
    matcher = RectifiedMatcher.for_linear(first=6, count=34)
    scores = []
    for count in lights:
        pair = (ViewImages.from_capture(s.capture, noise=CAMERA_NOISE).first_lights(count) for s in shots)
        scores.append(disparity_score(matcher.match(*pair).disparity, truth.disparity, truth.visible)["bad-1"])
    return scores


def test_one_light_is_enough_for_a_painted_surface():
    assert match_rig([1], painted=True)[0] <= 5


def test_eight_lights_match_a_plain_surface_that_one_light_cannot():
    one, eight = match_rig([1, 8], painted=False)
    assert eight <= 1
    assert one > 5 * eight


def test_matched_depth_gives_integration_its_scale_and_normals_give_the_detail():
    from psstereo.depth import Poisson
    from psstereo.normals import LeastSquares, estimate_normals

    scene = stereo_rig(128, lights=8, sensor=CAMERA)
    shots = render(scene)
    views = [ViewImages.from_capture(shot.capture, noise=CAMERA_NOISE) for shot in shots]
    found = RectifiedMatcher.for_linear(first=6, count=34).match(*views)
    solved = [estimate_normals(shot.capture, LeastSquares()) for shot in shots]
    kept = reject_by_surface(found, (solved[0].normals, solved[1].normals), (solved[0].albedo, solved[1].albedo))
    left, right = (viewpoint.camera for viewpoint in scene.viewpoints)
    prior = prior_from_disparity(kept, left.fx, 1.2, unit="mm", shift=right.cx - left.cx)
    fused = Poisson().integrate(solved[0].normals, left, prior=prior)
    assert fused.unit == "mm"
    truth = shots[0].truth.depth
    known = np.isfinite(prior.depth) & np.isfinite(truth)
    stereo, both = (np.sqrt(np.mean((depth - truth)[known] ** 2)) for depth in (prior.depth, fused.depth))
    assert both < stereo / 8
    assert both < 3e-4 * np.median(truth[known])


def opencv_best(left, right, truth, visible, count):
    """Return the least bad-2.0, gaps filled from behind, of OpenCV's matcher over a small grid."""
    import cv2

    best = np.inf
    for block in (3, 5):
        for unique, window in ((0, 0), (5, 0), (10, 100)):
            channels = left.shape[2]
            matcher = cv2.StereoSGBM_create(
                0, count, block, P1=8 * channels * block**2, P2=32 * channels * block**2, disp12MaxDiff=1,
                preFilterCap=31, uniquenessRatio=unique, speckleWindowSize=window, speckleRange=2,
                mode=cv2.STEREO_SGBM_MODE_HH,
            )  # fmt: skip
            found = matcher.compute(left, right) / 16.0
            found[found < 0] = np.nan
            best = min(best, disparity_score(found, truth, visible)["bad-2 filled"])
    return best


def photographs(left, right):
    return ViewImages.from_arrays(left, name="left"), ViewImages.from_arrays(right, name="right")


@pytest.mark.data
def test_cones(data_dir):
    folder = data_dir / "stereo" / "cones"
    left, right = (np.ascontiguousarray(decode_image(folder / name)) for name in ("im2.png", "im6.png"))
    truth = read_disparity(folder / "disp2.pgm", scale=4)
    assert np.isfinite(truth).mean() == pytest.approx(0.968, abs=0.001)
    visible = visible_in_right(truth)
    pair = photographs(left, right)
    everyday = pair[0].noise.with_tolerance(0.02, 0.02)
    constancy = pair_constancy(*(ViewImages.from_arrays(i, noise=everyday) for i in (left, right)), truth)
    assert np.nanmedian(constancy.absolute) * 255 == pytest.approx(5.0, abs=0.05)
    score = disparity_score(RectifiedMatcher(count=64).match(*pair).disparity, truth, visible)
    assert score["bad-2 filled"] <= opencv_best(left, right, truth, visible, 64)
    assert score["bad-2"] < 5


@pytest.mark.slow
def test_motorcycle():
    import skimage
    import skimage.data

    if not (Path(skimage.__file__).parent / "data" / "motorcycle_disp.npz").is_file():
        pytest.skip("scikit-image has stereo_motorcycle only for download here")
    left, right, disparity = skimage.data.stereo_motorcycle()
    truth = np.where(np.isfinite(disparity), disparity, np.nan).astype(np.float64)
    visible = visible_in_right(truth)
    found = RectifiedMatcher(count=80).match(*photographs(left, right))
    score = disparity_score(found.disparity, truth, visible)
    assert score["bad-2 filled"] <= opencv_best(left, right, truth, visible, 80)


@pytest.mark.data
@pytest.mark.slow
def test_temple(data_dir):
    folder = data_dir / "stereo" / "templeSparseRing"
    views = read_view_list(folder / "templeSR_par.txt")
    assert len(views) == 16
    chosen = [5, *nearest_views(views, 5, 4)]
    frames = [np.asarray(decode_image(folder / views[n].name)) for n in chosen]
    images = [ViewImages.from_arrays(frame[..., 1].copy(), mask=frame.max(axis=2) > 60) for frame in frames]
    middle, half = TEMPLE_BOX.mean(axis=0), TEMPLE_BOX[1] - TEMPLE_BOX[0]  # twice the box
    corners = np.stack(np.meshgrid(*np.stack([middle - half, middle + half]).T), axis=-1).reshape(-1, 3)
    reach = views[5].project(corners)[2]
    found = PlaneSweep(planes=48).depth(images, [views[n] for n in chosen], reach.min(), reach.max())
    known = np.isfinite(found.depth)
    assert known[images[0].mask].mean() > 0.85
    assert inside_box(views[5].points(found.depth.astype(np.float64)), *TEMPLE_BOX)[known].mean() > 0.9
