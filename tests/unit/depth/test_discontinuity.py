"""Cliffs, hinges and outlines with known heights, and the parts that the method is made of."""

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import Poisson
from psstereo.depth.discontinuity import Discontinuity
from psstereo.depth.discontinuity_evidence import bridged, edge_ends, medians, pixel_pitch, plane_steps, turning
from psstereo.depth.discontinuity_parts import pieces_of
from psstereo.depth.discontinuity_solve import Task, solve_apart
from psstereo.depth.domain import make_domain
from psstereo.depth.edges import EdgeSteps
from psstereo.depth.prior import Prior
from psstereo.errors import OptionError
from psstereo.results import Outcome

SIZE = 120
CAMERA = Orthographic()


def disc(size=SIZE):
    """x right, y up from the middle, and a round mask."""
    rows, columns = np.indices((size, size), dtype=float)
    x, y = columns - (size - 1) / 2, (size - 1) / 2 - rows
    return x, y, x**2 + y**2 < (0.46 * size) ** 2


def base(x, y):
    """A bumpy dome with its slopes, radius of curvature about 150 px."""
    height = -(x**2 + y**2) / 300 + 4 * np.sin(x / 17) * np.cos(y / 13)
    along_x = -x / 150 + 4 / 17 * np.cos(x / 17) * np.cos(y / 13)
    along_y = -y / 150 - 4 / 13 * np.sin(x / 17) * np.sin(y / 13)
    return height, along_x, along_y


def half_hill(x, y, jump, width, middle=(0.0, 4.0)):
    """A Gaussian hill cut by a vertical plane: a cliff that fades along its length."""
    hill = np.where(x < middle[0], jump * np.exp(-((x - middle[0]) ** 2 + (y - middle[1]) ** 2) / (2 * width**2)), 0)
    return hill, -hill * (x - middle[0]) / width**2, -hill * (y - middle[1]) / width**2


def plate(x, y, half=25, slope=1.2):
    """A square plate hinged on its left side."""
    on = (np.abs(x) < half) & (np.abs(y) < half)
    return np.where(on, slope * (x + half), 0.0), np.where(on, slope, 0.0), np.zeros_like(x)


def surface(part=None, size=SIZE, **shape):
    x, y, mask = disc(size)
    layers = [base(x, y)] if part is None else [base(x, y), part(x, y, **shape)]
    height, along_x, along_y = (sum(values) for values in zip(*layers, strict=True))
    normals = np.dstack([-along_x, -along_y, np.ones_like(x)])
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True), height, mask


def errors(result, truth, mask):
    """Root mean square about the mean, and median magnitude about the median [px]."""
    error = (result.depth - truth)[mask]
    return np.std(error), np.median(np.abs(error - np.median(error)))


def both(normals, truth, mask, camera=CAMERA):
    return tuple(errors(m.integrate(normals, camera, mask=mask), truth, mask) for m in (Discontinuity(), Poisson()))


def test_a_cliff_that_fades_at_both_ends():
    (rms, median), (plain, _) = both(*surface(half_hill, jump=20.0, width=8.0))
    assert plain > 0.4
    assert rms < 0.03
    assert median < 0.03


def test_a_gentle_cliff_from_rim_to_rim():
    (rms, median), (plain, _) = both(*surface(half_hill, jump=14.0, width=22.0))
    assert plain > 2.5
    assert rms < 0.3 * plain
    assert median < 0.5


def test_a_cliff_that_fades_evenly_from_its_middle_to_the_rim():
    """Both sides in front would mean equal jumps on the whole; only the ends tell."""
    x, y, _ = disc()
    reach = np.cos(np.clip(y / 56, -1, 1) * np.pi / 2)
    left = x < 2

    def part(*_):
        height = np.where(left, 14 * reach**2, 0)
        slope = -14 * np.pi / 56 * reach * np.sin(np.clip(y / 56, -1, 1) * np.pi / 2)
        return height, np.zeros_like(x), np.where(left, slope, 0)

    (rms, _), (plain, _) = both(*surface(part))
    assert plain > 2.0
    assert rms < 0.3 * plain


def test_a_hinged_plate_keeps_its_hinge():
    (rms, median), (plain, _) = both(*surface(plate))
    assert plain > 5.0
    assert rms < 0.5
    assert median < 0.1


def test_a_crease_is_no_cliff():
    x, _, mask = disc()
    normals = np.dstack([np.where(x < 0, -1.0, 0.7), np.full_like(x, 0.2), np.ones_like(x)])
    truth = np.where(x < 0, x, -0.7 * x) - 0.2 * disc()[1]
    result = Discontinuity().integrate(normals, CAMERA, mask=mask)
    assert errors(result, truth, mask)[0] < 0.2
    assert result.facts["pieces_seated"] <= 1


def test_nothing_is_lost_on_a_smooth_surface():
    normals, truth, mask = surface()
    found = Discontinuity().integrate(normals, CAMERA, mask=mask)
    plain = Poisson().integrate(normals, CAMERA, mask=mask)
    assert found.facts["edges_turning"] == 0
    assert found.facts["edges_released"] == 0
    assert errors(found, truth, mask)[0] < 1.2 * errors(plain, truth, mask)[0] < 0.01


@pytest.mark.parametrize("degrees", [0.5, 1.0])
def test_noise_does_not_hide_a_cliff(degrees):
    normals, truth, mask = surface(half_hill, jump=20.0, width=8.0)
    rng = np.random.default_rng(3)
    (rms, _), (plain, _) = both(normals + rng.normal(0, np.radians(degrees), normals.shape), truth, mask)
    assert rms < 0.5 * plain


def test_noise_alone_costs_little():
    normals, truth, mask = surface()
    rng = np.random.default_rng(4)
    (rms, _), (plain, _) = both(normals + rng.normal(0, np.radians(1.0), normals.shape), truth, mask)
    assert rms < 1.5 * plain


def test_a_ball_on_a_wall():
    """The wall is seen all around, parted from the ball by its outline: as far behind as `behind` says."""
    x, y, mask = disc()
    radius = 30.0
    ball = x**2 + y**2 < (radius - 0.3) ** 2
    z = np.sqrt(np.where(ball, radius**2 - x**2 - y**2, 1.0))
    normals = np.where(ball[..., None], np.dstack([x, y, z]) / radius, [0.0, 0.0, 1.0])
    for share in (0.0, 1.0):
        depth = Discontinuity(behind=share).integrate(normals, CAMERA, mask=mask).depth
        gap = np.median((depth - z)[ball & (x**2 + y**2 < (0.8 * radius) ** 2)]) - np.median(depth[mask & ~ball])
        assert gap == pytest.approx(share * radius, abs=0.12 * radius)


def test_a_cliff_in_central_projection():
    camera = Pinhole(fx=500.0, fy=480.0, cx=58.0, cy=61.0)
    x, y, mask = disc()
    hill, along_x, along_y = half_hill(x, y, jump=0.1, width=9.0)
    logarithm, u, v = x / 2000 - hill, (1 / 2000 - along_x)[..., None], along_y[..., None]  # rows run down
    rays = camera.rays((SIZE, SIZE))
    right, down = rays * u + [1 / 500.0, 0, 0], rays * v + [0, -1 / 480.0, 0]
    normals = np.cross(down, right)
    truth = np.exp(logarithm)
    results = [m.integrate(normals, camera, mask=mask) for m in (Discontinuity(), Poisson())]
    assert all(result.outcome is Outcome.SOLVED for result in results)
    error = [np.std(np.log(result.depth / truth)[mask]) for result in results]
    assert error[1] > 0.001
    assert error[0] < 0.05 * error[1]


@pytest.mark.parametrize(
    "options",
    [
        {"scale": 0.0},
        {"scale": np.inf},
        {"behind": -1.0},
        {"rounds": -1},
        {"tolerance": 0.0},
        {"round_tolerance": 1.0},
        {"slant_exponent": 5.0},
        {"max_iterations": 0},
        {"threads": 0},
        {"behind": np.nan},
    ],
)
def test_options_that_mean_nothing_are_refused(options):
    with pytest.raises(OptionError) as caught:
        Discontinuity(**options)
    assert caught.value.remedy


def test_turning_is_one_on_smooth_surfaces_and_far_above_at_a_break():
    normals, _, mask = surface(plate)
    domain = make_domain(normals, CAMERA, mask, None)
    right, down = turning(domain, domain.inside.astype(np.int32))
    x, y, _ = disc()
    x, y = x[domain.window], y[domain.window]
    hinge = (np.abs(x[:, :-1] + 25) == 0.5) & (x[:, :-1] < -25) & (np.abs(y[:, :-1]) < 22)
    assert hinge.sum() > 40
    assert (right[hinge] > 6).all()
    away = (np.abs(np.abs(x[:, :-1]) - 25) > 4) & (np.abs(np.abs(y[:, :-1]) - 25) > 4)
    assert right[away].max() < 1.2
    assert down.shape == (domain.inside.shape[0] - 1, domain.inside.shape[1])


@pytest.mark.parametrize("slope", [0.0, 0.5, -1.0])
@pytest.mark.parametrize(("gap", "filled"), [(8, True), (30, False)])
def test_gaps_between_long_runs_are_bridged(slope, gap, filled):
    rows = np.arange(60)
    columns = 70 + np.rint(slope * rows).astype(int)
    outlier = np.zeros((60, 140), bool)
    outlier[rows, columns] = True
    missing = (rows >= 22) & (rows < 22 + gap)
    outlier[rows[missing], columns[missing]] = False
    found = bridged(outlier)
    assert found[rows[missing], columns[missing]].all() == filled
    assert not (found & outlier).any()
    assert found.sum() == (gap if filled else 0)


def test_single_outliers_are_not_joined():
    rng = np.random.default_rng(0)
    assert bridged(rng.random((80, 80)) < 0.02).sum() == 0


def test_medians_are_those_of_each_component():
    rng = np.random.default_rng(1)
    values, labels = rng.normal(size=501), rng.integers(1, 6, 501)
    labels[labels == 3] = 2
    found = medians(values, labels, 5)
    for label in (1, 2, 4, 5):
        assert found[label] == np.quantile(values[labels == label], 0.5, method="lower")
    assert found[0] == found[3] == 0
    assert medians(values, np.ones(501, int), 1)[1] == np.median(values)


@pytest.mark.parametrize("camera", [Orthographic(pixel_size=0.2, length_unit="mm"), Pinhole(fx=90, fy=80, cx=5, cy=6)])
def test_planes_predict_their_own_steps_from_both_ends(camera):
    normal = np.array([0.3, -0.4, 1.0])
    domain = make_domain(np.broadcast_to(normal, (9, 8, 3)).copy(), camera, None, None)
    rays = camera.rays((9, 8))
    if isinstance(camera, Pinhole):
        truth = -np.log(-(rays @ normal))
    else:
        truth = -(camera.points(np.zeros((9, 8)))[..., :2] @ normal[:2])
    for a, b in edge_ends():
        for step in plane_steps(domain, (a, b)):
            np.testing.assert_allclose(step, truth[b] - truth[a], rtol=0, atol=1e-14)
    expected = (1 / 90 / 80) ** 0.5 if isinstance(camera, Pinhole) else 0.2
    assert pixel_pitch(domain) == pytest.approx(expected, rel=1e-12)


def leaning_ellipsoid(size=SIZE):
    """An ellipsoid that leans out of a wall: a seam at its foot, an outline around its upper end."""
    x, y, mask = disc(size)
    turn = np.radians(35.0)
    axes = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    form = axes.T @ np.diag([1 / 38.0**2, 1 / 13.0**2, 1 / 13.0**2]) @ axes
    flat = np.stack([x, y], axis=-1)
    linear, constant = flat @ form[:2, 2], np.einsum("...i,ij,...j->...", flat, form[:2, :2], flat) - 1
    root = linear**2 - form[2, 2] * constant
    up = (-linear + np.sqrt(np.where(root > 0, root, np.nan))) / form[2, 2]
    front = np.nan_to_num(up, nan=-99.0) > -12.0
    normals = np.where(front[..., None], np.dstack([flat, up]) @ form, [0.0, 0.0, 1.0])
    return normals, np.where(front, up, -12.0), mask


def test_what_leans_out_of_a_wall_touches_it_at_its_seam():
    (rms, median), (plain, _) = both(*leaning_ellipsoid())
    assert plain > 3.0
    assert rms < 0.5
    assert median < 0.1


def ball_on_a_wall(radius=30.0):
    x, y, mask = disc()
    ball = x**2 + y**2 < (radius - 0.3) ** 2
    z = np.sqrt(np.where(ball, radius**2 - x**2 - y**2, 1.0))
    normals = np.where(ball[..., None], np.dstack([x, y, z]) / radius, [0.0, 0.0, 1.0])
    return normals, np.where(ball, z, -7.0), mask, ball


@pytest.mark.parametrize("known", ["both", "ball", "wall"])
def test_a_prior_seats_what_floats(known):
    """A known point on each places both exactly; one alone fixes its own piece, and the other goes by plausibility."""
    normals, truth, mask, ball = ball_on_a_wall()
    depth = np.full(truth.shape, np.nan)
    if known != "wall":
        depth[60, 62] = truth[60, 62]
    if known != "ball":
        depth[20, 50] = truth[20, 50]
    prior = Prior(depth=depth, sigma=0.5, unit="px")
    found = Discontinuity().integrate(normals, CAMERA, mask=mask, prior=prior)
    error = np.abs(found.depth - truth)
    inner = ball & (np.hypot(*disc()[:2]) < 25)
    behind = mask & (np.hypot(*disc()[:2]) > 35)
    assert error[inner].max() < 0.1 or known == "wall"
    assert error[behind].max() < 0.1 or known == "ball"
    if known != "both":
        free = Discontinuity().integrate(normals, CAMERA, mask=mask).depth
        gap = np.median(found.depth[inner]) - np.median(found.depth[behind])
        assert gap == pytest.approx(np.median(free[inner]) - np.median(free[behind]), abs=0.1)


def test_a_prior_mends_a_common_tilt():
    normals, truth, mask = surface(half_hill, jump=20.0, width=8.0)
    tilted = normals + np.array([0.02, 0.01, 0.0])
    coarse = np.where(mask, truth + np.random.default_rng(2).normal(0, 0.5, truth.shape), np.nan)
    alone = Discontinuity().integrate(tilted, CAMERA, mask=mask)
    fused = Discontinuity().integrate(
        tilted, CAMERA, mask=mask, prior=Prior(depth=coarse, sigma=0.5, unit="px", angle=0.03)
    )
    assert errors(alone, truth, mask)[0] > 0.5
    assert errors(fused, truth, mask)[0] < 0.3 * errors(alone, truth, mask)[0]
    assert abs(np.mean((fused.depth - truth)[mask])) < 0.02


@pytest.mark.parametrize(("gap", "count"), [(0, 2), (3, 2), (40, 1)])
def test_a_crack_with_a_small_gap_parts_the_surface(gap, count):
    shape = (100, 60)
    inside = np.ones(shape, bool)
    right, down = np.ones((100, 59)), np.ones((99, 60))
    plain = EdgeSteps(
        right=np.zeros_like(right), down=np.zeros_like(down), right_weight=right, down_weight=down, left_out=0
    )
    kept = np.ones_like(right)
    kept[:, 30] = 1e-5
    kept[50 : 50 + gap, 30] = 1.0
    pieces = pieces_of(inside, plain, (kept, np.ones_like(down)))
    assert pieces.max() + 1 == count
    if count == 2:
        assert (pieces[:, :31] == pieces[0, 0]).all()
        assert (pieces[:, 31:] == pieces[0, -1]).all()


def test_scattered_breaks_part_nothing():
    rng = np.random.default_rng(0)
    inside = np.ones((60, 60), bool)
    right, down = np.ones((60, 59)), np.ones((59, 60))
    plain = EdgeSteps(
        right=np.zeros_like(right), down=np.zeros_like(down), right_weight=right, down_weight=down, left_out=0
    )
    factor = tuple(np.where(rng.random(part.shape) < 0.2, 1e-6, 1.0) for part in (right, down))
    assert pieces_of(inside, plain, factor).max() == 0


@pytest.mark.parametrize("with_prior", [False, True])
def test_solving_parts_first_is_solving_all_at_once(with_prior):
    """Against dense least squares, with a block that weights of 10⁻⁶ hold and a crack with loose ends."""
    rng = np.random.default_rng(7)
    shape = (9, 11)
    size, index = 99, np.arange(99).reshape(9, 11)
    factor = [rng.uniform(0.2, 1.0, (9, 10)), rng.uniform(0.2, 1.0, (8, 11))]
    factor[0][:5, 4] = factor[1][4, :5] = 1e-6 * rng.uniform(0.5, 2.0, 5)
    factor[0][6:, 7] = 1e-6
    step = [rng.normal(size=part.shape) for part in factor]
    ones = [np.ones_like(part) for part in factor]
    plain = EdgeSteps(right=step[0], down=step[1], right_weight=ones[0], down_weight=ones[1], left_out=0)
    prior, weight = (
        (rng.normal(size=shape), np.where(rng.random(shape) < 0.1, 0.01, 0.0)) if with_prior else (None, None)
    )
    task = Task(
        inside=np.ones(shape, bool),
        plain=plain,
        components=np.ones(shape, np.int32),
        prior=prior,
        prior_weight=weight,
        max_iterations=500,
        threads=1,
        solves=1,
    )
    found = solve_apart(task, (factor[0], factor[1]), start=None, tolerance=1e-12).values
    start = np.concatenate([index[:, :-1].ravel(), index[:-1].ravel()])
    stop = np.concatenate([index[:, 1:].ravel(), index[1:].ravel()])
    root = np.sqrt(np.concatenate([part.ravel() for part in factor]))
    matrix = root[:, None] * (np.eye(size)[stop] - np.eye(size)[start])
    wanted = root * np.concatenate([part.ravel() for part in step])
    if with_prior:
        matrix = np.concatenate([matrix, np.diag(np.sqrt(weight.ravel()))])
        wanted = np.concatenate([wanted, np.sqrt(weight.ravel()) * prior.ravel()])
    dense = np.linalg.lstsq(matrix, wanted, rcond=1e-14)[0].reshape(shape)
    difference = found - dense
    np.testing.assert_allclose(difference - (0.0 if with_prior else difference.mean()), 0.0, atol=2e-3)
