"""What every integrator promises; a new one is tested by being listed in the catalogue."""

import pickle
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import INTEGRATORS
from psstereo.errors import InputError
from psstereo.results import DepthKind, Outcome

ORTHOGRAPHIC = Orthographic(pixel_size=0.25, length_unit="mm")
PINHOLE = Pinhole(fx=300.0, fy=280.0, cx=20.0, cy=17.0, skew=4.0)


@pytest.fixture(scope="module", params=sorted(name for name, kind in INTEGRATORS.items() if kind.any_domain))
def integrator(request):
    return INTEGRATORS[request.param]()


def normal_of(vector, shape):
    vector = np.asarray(vector, float)
    return np.broadcast_to(vector / np.linalg.norm(vector), (*shape, 3)).copy()


def blob(shape):
    """A mask with a bay, a hole and a bridge one pixel wide."""
    rows, columns = np.indices(shape)
    mask = (rows - shape[0] / 2) ** 2 + (columns - shape[1] / 2) ** 2 < (0.45 * min(shape)) ** 2
    mask[shape[0] // 2, : shape[1] // 3] = False
    mask[5:9, shape[1] // 2 :] = False
    mask[7, shape[1] // 2 :] = True
    return mask


def sphere_orthographic(shape, camera, radius, centre):
    places = camera.points(np.zeros(shape))
    offset = places[..., :2] - np.asarray(centre)
    inside = (offset**2).sum(-1) < (0.995 * radius) ** 2
    height = np.sqrt(np.where(inside, radius**2 - (offset**2).sum(-1), np.nan))
    return height, np.dstack([offset, height]) / radius, inside


def sphere_pinhole(shape, camera, radius, centre):
    rays = camera.rays(shape)
    a, b, c = (rays**2).sum(-1), rays @ np.asarray(centre), float(np.dot(centre, centre)) - radius**2
    inside = b**2 - a * c > 1e-4 * b**2 * (radius / np.linalg.norm(centre)) ** 2
    distance = (b - np.sqrt(np.where(inside, b**2 - a * c, np.nan))) / a
    return distance, (rays * distance[..., None] - np.asarray(centre)) / radius, inside


def height_error(depth, truth):
    difference = depth - truth
    return float(np.nanmax(np.abs(difference - np.nanmean(difference))) / np.nanmax(np.abs(truth - np.nanmean(truth))))


def distance_error(depth, truth):
    ratio = np.log(depth / truth)
    return float(
        np.nanmax(np.abs(ratio - np.nanmean(ratio))) / max(np.nanmax(np.log(truth)) - np.nanmin(np.log(truth)), 1e-12)
    )


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("normal", [(0.3, -0.2, 1.0), (-9.0, 4.0, 0.1), (0.0, 1e4, 1.0)])
def test_a_plane_is_exact_in_parallel_projection(integrator, normal, masked):
    shape = (34, 41)
    mask = blob(shape) if masked else None
    result = integrator.integrate(normal_of(normal, shape), ORTHOGRAPHIC, mask=mask)
    places = ORTHOGRAPHIC.points(np.zeros(shape))
    truth = -(normal[0] * places[..., 0] + normal[1] * places[..., 1]) / normal[2]
    if masked:
        truth = np.where(mask, truth, np.nan)
    assert height_error(result.depth, truth) < 1e-9
    assert result.kind is DepthKind.HEIGHT
    assert result.unit == "mm"
    assert result.outcome is Outcome.SOLVED
    assert abs(np.nanmean(result.depth)) < 1e-9 * np.nanmax(np.abs(truth))


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("normal", [(0.3, -0.2, 1.0), (4.0, -2.0, 0.7), (0.0, 0.0, 1.0)])
def test_a_plane_is_exact_in_central_projection(integrator, normal, masked):
    shape = (34, 41)
    mask = blob(shape) if masked else None
    normals = normal_of(normal, shape)
    result = integrator.integrate(normals, PINHOLE, mask=mask)
    truth = -1.0 / np.sum(normals * PINHOLE.rays(shape), axis=-1)
    assert (truth > 0).all()
    if masked:
        truth = np.where(mask, truth, np.nan)
    assert distance_error(result.depth, truth) < 1e-9 or np.ptp(truth[np.isfinite(truth)]) < 1e-12
    assert result.kind is DepthKind.DISTANCE
    assert result.unit == "relative"
    assert abs(np.nanmean(np.log(result.depth))) < 1e-12


def test_a_sphere_is_exact_in_parallel_projection(integrator):
    if not integrator.exact_on_spheres:
        pytest.skip("its slopes are one-sided")
    truth, normals, inside = sphere_orthographic((40, 44), ORTHOGRAPHIC, 4.6, (5.2, -4.8))
    result = integrator.integrate(normals, ORTHOGRAPHIC, mask=inside)
    assert height_error(result.depth, truth) < 1e-9


def test_a_sphere_is_exact_in_central_projection(integrator):
    if not integrator.exact_on_spheres:
        pytest.skip("its slopes are one-sided")
    truth, normals, inside = sphere_pinhole((40, 44), PINHOLE, 0.06, (0.004, -0.002, -1.0))
    assert inside.sum() > 700
    result = integrator.integrate(normals, PINHOLE, mask=inside)
    assert distance_error(result.depth, truth) < 1e-8


def smooth_normals(shape, seed=0):
    rows, columns = np.indices(shape) / 9.0
    return np.dstack([np.sin(rows + seed), np.cos(columns * 1.3), np.full(shape, 1.2)])


@cache
def solved(integrator, camera, shape=(30, 31)):
    """Return what comes of smooth normals under a mask, for all tests that look at it."""
    return integrator.integrate(smooth_normals(shape), camera, mask=blob(shape))


@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PINHOLE], ids=lambda camera: camera.name)
class TestCommon:
    def test_disconnected_components_are_independent(self, integrator, camera):
        shape = (20, 34)
        left, right = np.zeros(shape, bool), np.zeros(shape, bool)
        left[2:17, 1:13] = True
        left[7, 4:8] = False
        right[4:20, 15:34] = True
        normals = smooth_normals(shape)
        normals[right, :2] *= 40.0 if camera is ORTHOGRAPHIC else 4.0
        both = integrator.integrate(normals, camera, mask=left | right)
        assert both.components.max() == 2
        for part in (left, right):
            alone = integrator.integrate(normals, camera, mask=part)
            relative = np.abs(both.depth[part] - alone.depth[part]).max() / np.abs(alone.depth[part]).max()
            assert relative < 1e-9

    def test_the_mask_is_respected(self, integrator, camera):
        mask, result = blob((30, 31)), solved(integrator, camera)
        np.testing.assert_array_equal(np.isfinite(result.depth), mask)
        np.testing.assert_array_equal(result.components > 0, mask)
        assert result.depth.dtype == np.float64
        assert result.depth.shape == mask.shape

    def test_what_lies_outside_the_mask_is_never_read(self, integrator, camera):
        mask = blob((30, 31))
        normals = smooth_normals(mask.shape)
        dirty = np.where(mask[..., None], normals, np.nan)
        clean = solved(integrator, camera)
        assert clean.depth.tobytes() == integrator.integrate(dirty, camera, mask=mask).depth.tobytes()

    def test_equal_input_gives_equal_bytes(self, integrator, camera):
        mask = blob((60, 61))
        first, second = (integrator.integrate(smooth_normals(mask.shape), camera, mask=mask) for _ in range(2))
        assert first.depth.tobytes() == second.depth.tobytes()

    def test_single_precision_is_accepted_and_worked_on_in_double(self, integrator, camera):
        normals = smooth_normals((20, 25)).astype(np.float32)
        result = integrator.integrate(normals, camera)
        exact = integrator.integrate(normals.astype(np.float64), camera)
        assert result.depth.tobytes() == exact.depth.tobytes()

    def test_the_input_is_left_alone(self, integrator, camera):
        normals, mask = smooth_normals((12, 13)), blob((12, 13))
        weights = np.ones(mask.shape)
        for array in (normals, mask, weights):
            array.setflags(write=False)
        integrator.integrate(normals, camera, mask=mask, weights=weights)

    def test_length_of_normals_does_not_matter(self, integrator, camera):
        normals = smooth_normals((12, 13))
        long = integrator.integrate(normals * 1e200, camera)
        short = integrator.integrate(normals * 1e-200, camera)
        np.testing.assert_allclose(long.depth, short.depth, rtol=0, atol=1e-9)

    def test_holes_and_unusable_normals_are_left_out_and_counted(self, integrator, camera):
        mask = np.ones((16, 18), bool)
        mask[0] = False
        normals = smooth_normals(mask.shape)
        normals[3:5, 3:5] = np.nan
        normals[7, 7] = 0.0
        normals[8, 8] = np.inf
        normals[10, 2:5, 2] = -1.0
        weights = np.ones(mask.shape)
        weights[12, 12] = 0.0
        weights[0] = np.nan  # outside the mask nobody asks
        weights[3:5, 3:5] = np.nan  # nor where there is no normal
        result = integrator.integrate(normals, camera, mask=mask, weights=weights)
        assert result.facts["left_out"] == {"no_normal": 6, "facing_away": 3, "zero_weight": 1, "beyond_range": 0}
        assert np.count_nonzero(np.isfinite(result.depth)) == mask.sum() - 10
        assert result.outcome is Outcome.PARTIAL
        assert np.isnan(result.depth[[3, 7, 8, 10, 12], [3, 7, 8, 3, 12]]).all()

    def test_without_a_mask_the_background_is_not_missing(self, integrator, camera):
        normals = smooth_normals((16, 18))
        normals[:4] = 0.0
        assert integrator.integrate(normals, camera).outcome is Outcome.SOLVED

    @pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
    def test_weights_that_mean_nothing_are_refused(self, integrator, camera, bad):
        weights = np.ones((6, 7))
        weights[2, 3] = bad
        with pytest.raises(InputError, match=r"1 pixels .* weight"):
            integrator.integrate(smooth_normals((6, 7)), camera, weights=weights)

    def test_a_common_factor_of_the_weights_changes_nothing(self, integrator, camera):
        weights = np.random.default_rng(3).uniform(0.1, 1.0, (14, 15))
        first = integrator.integrate(smooth_normals((14, 15)), camera, weights=weights)
        second = integrator.integrate(smooth_normals((14, 15)), camera, weights=1024.0 * weights)
        np.testing.assert_allclose(first.depth, second.depth, rtol=0, atol=1e-9)

    @pytest.mark.parametrize(
        ("normals", "mask", "weights"),
        [
            (np.zeros((5, 6, 3)), None, None),
            (np.full((5, 6, 3), np.nan), None, None),
            (np.zeros((0, 6, 3)), None, None),
            (smooth_normals((5, 6)), np.zeros((5, 6), bool), None),
            (smooth_normals((5, 6)), np.ones((6, 5), bool), None),
            (smooth_normals((5, 6)), np.ones((5, 6), np.uint8), None),
            (smooth_normals((5, 6)), None, np.ones((6, 5))),
            (smooth_normals((5, 6)), None, np.zeros((5, 6))),
            (np.zeros((5, 6)), None, None),
            (np.ones((5, 6, 3), np.uint8), None, None),
            (smooth_normals((5, 6)) * [1, 1, -9], None, None),
        ],
    )
    def test_input_that_cannot_be_used_is_refused_in_three_parts(self, integrator, camera, normals, mask, weights):
        with pytest.raises(InputError) as caught:
            integrator.integrate(normals, camera, mask=mask, weights=weights)
        assert caught.value.given
        assert caught.value.needed
        assert caught.value.remedy

    @pytest.mark.parametrize("shape", [(1, 1), (1, 2), (1, 9), (9, 1), (2, 2)])
    def test_tiny_images(self, integrator, camera, shape):
        normals = normal_of((0.5, 0.25, 1.0), shape)
        result = integrator.integrate(normals, camera)
        assert np.isfinite(result.depth).all()
        assert result.outcome is Outcome.SOLVED
        if shape == (1, 1):
            assert result.depth[0, 0] == (0.0 if result.kind is DepthKind.HEIGHT else 1.0)

    def test_islands_of_one_pixel(self, integrator, camera):
        shape = (142, 142)
        mask = np.indices(shape).sum(axis=0) % 2 == 0
        result = integrator.integrate(smooth_normals(shape), camera, mask=mask)
        assert result.facts["components"] == result.facts["single_pixels"] == mask.sum() > 10_000
        assert (result.depth[mask] == (0.0 if result.kind is DepthKind.HEIGHT else 1.0)).all()

    def test_many_islands(self, integrator, camera):
        mask = np.ones((150, 150), bool)
        mask[::3] = False
        mask[:, ::3] = False
        result = integrator.integrate(smooth_normals(mask.shape), camera, mask=mask)
        assert result.outcome is Outcome.SOLVED
        assert result.facts["components"] == 50 * 50
        first = mask & (result.components == 1)
        alone = integrator.integrate(smooth_normals(mask.shape), camera, mask=first)
        np.testing.assert_allclose(
            alone.depth[first], result.depth[first], rtol=integrator.round_off, atol=integrator.round_off
        )

    def test_components_are_numbered_in_the_order_of_their_first_pixel(self, integrator, camera):
        mask = np.random.default_rng(1).random((40, 40)) < 0.5
        components = integrator.integrate(smooth_normals(mask.shape), camera, mask=mask).components
        labels = components[mask]
        first = np.unique(labels, return_index=True)[1]
        assert (np.diff(first) > 0).all()

    def test_grazing_normals_do_no_harm(self, integrator, camera):
        shape = (40, 40)
        normals = smooth_normals(shape)
        normals[20, 5:35] = (1.0, 0.0, 1e-4)
        normals[10, 10] = (0.0, 1.0, 1e-12)
        result = integrator.integrate(normals, camera)
        assert result.outcome in {Outcome.SOLVED, Outcome.PARTIAL}
        if camera is ORTHOGRAPHIC:
            assert np.isfinite(result.depth).all()

    def test_pickles(self, integrator, camera):
        assert pickle.loads(pickle.dumps(integrator)) == integrator
        result = integrator.integrate(smooth_normals((6, 7)), camera)
        assert pickle.loads(pickle.dumps(result)).depth.tobytes() == result.depth.tobytes()

    def test_progress_rises_to_the_end(self, integrator, camera):
        seen = []
        mask = blob((40, 40))
        integrator.integrate(
            smooth_normals(mask.shape),
            camera,
            mask=mask,
            progress=lambda _stage, done, total: seen.append(done / total),
        )
        assert seen[-1] == 1.0
        assert min(seen) >= 0.0

    @settings(max_examples=12)
    @given(data=st.data())
    def test_any_mask_is_solved(self, integrator, camera, data):
        shape = data.draw(st.tuples(st.integers(1, 16), st.integers(1, 16)))
        rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
        mask = rng.random(shape) < data.draw(st.floats(0.05, 1.0))
        weights = 10.0 ** rng.uniform(-data.draw(st.integers(0, 6)), 0, shape)
        normals = rng.normal(size=(*shape, 3))
        normals[..., 2] = np.abs(normals[..., 2]) + 0.1
        certain = rng.integers(shape[0]), rng.integers(shape[1])  # in the mask, and facing every camera used here
        mask[certain] = True
        normals[certain] = 0.0, 0.0, 1.0
        result = integrator.integrate(normals, camera, mask=mask, weights=weights)
        assert result.outcome is not Outcome.NOT_CONVERGED
        used = np.isfinite(result.depth)
        assert not (used & ~mask).any()
        labels, values = result.components[used], result.depth[used]
        if result.kind is DepthKind.DISTANCE:
            values = np.log(values)
        means = np.bincount(labels, values) / np.maximum(np.bincount(labels), 1)
        assert np.abs(means).max() <= 1e-12 * max(np.abs(values).max(), 1.0)


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_turning_the_image_turns_the_depth(integrator, turns):
    mask = blob((36, 45))
    normals = smooth_normals(mask.shape)
    result = solved(integrator, ORTHOGRAPHIC, mask.shape)
    turned = np.rot90(normals, turns).copy()
    for _ in range(turns):  # rows run down and y up: a counter-clockwise turn of the picture turns vectors likewise
        turned = np.stack([-turned[..., 1], turned[..., 0], turned[..., 2]], axis=-1)
    other = integrator.integrate(turned, ORTHOGRAPHIC, mask=np.rot90(mask, turns).copy())
    np.testing.assert_allclose(other.depth, np.rot90(result.depth, turns), rtol=0, atol=1e-8)


@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PINHOLE], ids=lambda camera: camera.name)
def test_transposing_the_image_transposes_the_depth(integrator, camera):
    mask = blob((36, 45))
    normals = smooth_normals(mask.shape)
    if isinstance(camera, Pinhole):
        camera = Pinhole(fx=300.0, fy=280.0, cx=20.0, cy=17.0)
        mirrored = Pinhole(fx=280.0, fy=300.0, cx=17.0, cy=20.0)
    else:
        mirrored = camera
    result = solved(integrator, camera, mask.shape)
    swapped = np.transpose(normals, (1, 0, 2))[..., [1, 0, 2]] * [-1.0, -1.0, 1.0]
    other = integrator.integrate(swapped, mirrored, mask=mask.T.copy())
    np.testing.assert_allclose(other.depth, result.depth.T, rtol=0, atol=1e-8)
