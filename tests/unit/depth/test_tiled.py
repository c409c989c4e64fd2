"""Integration by tiles: what the integrator finds in memory, without seams, in bounded memory, from file to file."""

import pickle
import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import LeastAbsolute, Poisson, Prior
from psstereo.depth.rows import Rows
from psstereo.depth.tile_levels import TileLevels, nodes
from psstereo.depth.tile_plan import plan_tiles
from psstereo.depth.tiled import integrate_tiled
from psstereo.depth.tiles import FileArray, Tile, inside_of, make_tiles
from psstereo.errors import (
    ExistingResultError,
    InputError,
    MissingFileError,
    OptionError,
    UnreadableFileError,
    UnsupportedError,
)
from psstereo.results import Outcome

SHAPE = (100, 130)
ORTHOGRAPHIC = Orthographic(pixel_size=0.5, length_unit="mm")
PINHOLE = Pinhole(fx=200.0, fy=210.0, cx=70.0, cy=45.0, skew=1.0)


def bumpy(shape=SHAPE, noise=0.05, seed=0):
    rng = np.random.default_rng(seed)
    v, u = np.indices(shape) / shape[0]
    across, down = 0.8 * np.cos(5 * u + 3 * v) + 0.4 * np.sin(12 * u * v), 0.7 * np.sin(4 * v - 3 * u)
    normals = np.stack([-across, -down, np.ones(shape)], axis=-1) + rng.normal(0, noise, (*shape, 3))
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def disc(shape=SHAPE):
    v, u = np.indices(shape)
    return (v - shape[0] / 2) ** 2 + (u - shape[1] / 2) ** 2 < (0.49 * min(shape)) ** 2


def tiled(folder, normals, camera=ORTHOGRAPHIC, **options):
    options = {"tile": 48, "tolerance": 1e-8, "components": folder / "components.npy", **options}
    return integrate_tiled(normals, camera, out=folder / "depth.npy", **options)


def agrees(folder, normals, camera=ORTHOGRAPHIC, **options):
    """Hold tiles to what the integrator finds in memory."""
    inputs = {key: options[key] for key in ("mask", "weights", "prior") if key in options}
    whole = options.get("integrator", Poisson()).integrate(normals, camera, **inputs)
    found = tiled(folder, normals, camera, **options)
    used = np.isfinite(whole.depth)
    np.testing.assert_array_equal(np.isfinite(found.depth), used)
    np.testing.assert_array_equal(found.components, whole.components)
    apart = np.abs(found.depth - whole.depth)[used].max()
    assert apart <= 1e-6 * max(np.ptp(whole.depth[used]), 1e-9)
    assert found.outcome is whole.outcome
    assert (found.kind, found.unit) == (whole.kind, whole.unit)
    same = "pixels", "left_out", "components", "largest_component", "single_pixels", "edges", "edges_left_out", "method"
    assert {key: found.facts[key] for key in same} == {key: whole.facts[key] for key in same}
    assert found.residual <= 1e-8
    return found


def test_equals_the_integrator_on_a_disc(tmp_path):
    found = agrees(tmp_path, bumpy(), mask=disc())
    assert found.facts["tiles"] > 4
    assert found.facts["residual_length"] < 1e-7


def test_equals_the_integrator_with_holes_and_missing_normals(tmp_path):
    rng = np.random.default_rng(1)
    normals = bumpy().astype(np.float32)
    normals[20:35, 30:70] = np.nan
    normals[60, :50, 2] *= -1
    found = agrees(tmp_path, normals, mask=disc() & (rng.random(SHAPE) > 0.2))
    assert found.facts["components"] > 10
    assert found.facts["left_out"]["no_normal"] > 0
    assert found.facts["left_out"]["facing_away"] > 0


def test_bridges_across_tiles_hold(tmp_path):
    comb = np.zeros(SHAPE, np.bool_)
    comb[:, ::10] = True
    comb[57] = True  # one bridge for all, off the coarse grid
    found = agrees(tmp_path, bumpy(), mask=comb)
    assert found.facts["components"] == 1


def test_islands_side_by_side_are_numbered_and_settled_alone(tmp_path):
    islands = np.zeros(SHAPE, np.bool_)
    islands[4:47, 5:125] = True
    islands[48:97, 5:125] = True  # a gap of one row, within a tile
    normals = bumpy()
    normals[:47] = 0.0, 0.0, 1.0  # one of them exactly flat
    found = agrees(tmp_path, normals, mask=islands)
    assert found.facts["components"] == 2
    assert (found.depth[:47][islands[:47]] == 0).all()


def test_a_pinhole_with_weights(tmp_path):
    weights = np.random.default_rng(2).uniform(0.0, 3.0, SHAPE)
    weights[30:33, 10:60] = 0.0
    weights[0, 0] = 50.0  # the largest lies outside the mask, and in one tile only
    found = agrees(tmp_path, bumpy(), PINHOLE, mask=disc(), weights=weights)
    assert found.facts["left_out"]["zero_weight"] > 0
    assert found.unit == "relative"


@pytest.mark.parametrize(("camera", "unit"), [(ORTHOGRAPHIC, "mm"), (PINHOLE, "m")])
def test_a_prior_is_fused(tmp_path, camera, unit):
    rng = np.random.default_rng(3)
    depth = np.where(rng.random(SHAPE) < 0.05, 500.0 + rng.normal(size=SHAPE), np.nan)
    depth[:, :40] = np.nan  # none in whole tiles
    prior = Prior(depth=depth, sigma=0.5 + rng.random(SHAPE), unit=unit)
    found = agrees(tmp_path, bumpy(), camera, mask=rng.random(SHAPE) > 0.3, prior=prior)
    assert found.facts["left_out"]["no_prior"] > 0
    assert found.outcome is Outcome.PARTIAL


def test_a_coarser_grid_gives_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr("psstereo.depth.tile_plan._LEVELS", range(4, 5))
    found = agrees(tmp_path, bumpy(), mask=disc())
    assert (found.facts["coarse_spacing"], found.facts["overlap"], found.facts["tile"]) == (16, 31, 64)


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (1, 90)])
def test_small_images(tmp_path, shape):
    agrees(tmp_path, bumpy(shape), PINHOLE)


def test_there_are_no_seams(tmp_path):
    normals = bumpy((96, 96), noise=0.1)
    depth = tiled(tmp_path, normals, tile=32).depth
    for bends in (np.abs(np.diff(depth, 2, axis=0)), np.abs(np.diff(depth, 2, axis=1)).T):
        across = bends.mean(axis=1)  # centred on rows 1, 2, …
        seams = np.zeros(across.size, np.bool_)
        seams[[30, 31, 62, 63]] = True
        assert across[seams].max() < across[~seams].mean() + 4 * across[~seams].std()


def test_iterations_do_not_grow_with_tiles(tmp_path):
    v, u = (np.indices((192, 192)) - 95.5) / 120
    ball = np.stack([u, -v, np.sqrt(1 - np.minimum(u * u + v * v, 0.99))], axis=-1)
    mask = u * u + v * v < 0.6
    found = [tiled(tmp_path, ball, mask=mask, tile=side, overwrite=True) for side in (96, 48)]
    assert [one.facts["tiles"] for one in found] == [4, 16]
    assert found[1].iterations <= found[0].iterations + 1 <= 6


def test_how_tiles_are_worked_on_leaves_no_trace(tmp_path):
    normals = bumpy((60, 90))
    np.save(tmp_path / "normals.npy", normals)
    first = np.array(tiled(tmp_path, normals).depth)
    with ThreadPoolExecutor(2) as pool:
        second = tiled(tmp_path, tmp_path / "normals.npy", over=pool.map, overwrite=True).depth
    np.testing.assert_array_equal(first, second)


def test_memory_stays_within_bounds(tmp_path):
    shape = (800, 800)
    v, u = (np.indices(shape, np.float32) - 399.5) / 440
    bowl = np.stack([u, -v, np.sqrt(np.maximum(1 - u * u - v * v, 0.2))], axis=-1)
    np.save(tmp_path / "normals.npy", bowl)
    np.save(tmp_path / "mask.npy", disc(shape))
    del bowl, v, u
    tiled(tmp_path, bumpy((90, 90)))  # compiled loops are loaded
    allowed = 30_000_000
    tracemalloc.start()
    try:
        found = tiled(
            tmp_path,
            tmp_path / "normals.npy",
            mask=tmp_path / "mask.npy",
            tile=None,
            tolerance=1e-2,
            max_memory=allowed,
            overwrite=True,
        )
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found.outcome is Outcome.SOLVED
    assert 0.2 * allowed < peak < allowed  # a whole image in memory takes twice as much


def test_float32_is_the_same_rounded(tmp_path):
    normals = bumpy((40, 40))
    fine = np.array(tiled(tmp_path, normals).depth)
    coarse = tiled(tmp_path, normals, dtype="float32", overwrite=True).depth
    assert coarse.dtype == np.float32
    np.testing.assert_array_equal(coarse, fine.astype(np.float32))


def test_says_when_it_stops_before_the_tolerance(tmp_path):
    found = tiled(tmp_path, bumpy(), integrator=Poisson(max_iterations=1))
    assert found.outcome is Outcome.NOT_CONVERGED
    assert found.iterations == 1
    assert found.residual > 1e-8


def test_progress_ends_at_the_end(tmp_path):
    told = []
    tiled(tmp_path, bumpy((40, 60)), progress=lambda *parts: told.append(parts))
    assert told[-1] == ("integrate", 100, 100)
    assert all(0 <= done <= 100 for _, done, _ in told)


class Broken:
    """Normals that cannot be read to the end."""

    shape, dtype = (*SHAPE, 3), np.dtype(np.float64)

    def __getitem__(self, window):
        if window[0].start:
            raise OSError("the disc was taken out")
        return bumpy()[window]


def test_a_failure_leaves_nothing_behind(tmp_path):
    with pytest.raises(OSError, match="taken out"):
        tiled(tmp_path, Broken())
    assert list(tmp_path.iterdir()) == []


def test_a_failure_leaves_an_earlier_result_alone(tmp_path):
    (tmp_path / "depth.npy").write_bytes(b"earlier")
    with pytest.raises(OSError, match="taken out"):
        tiled(tmp_path, Broken(), overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["depth.npy"]
    assert (tmp_path / "depth.npy").read_bytes() == b"earlier"


def test_a_result_is_whole_and_alone(tmp_path):
    tiled(tmp_path, bumpy((40, 40)))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["components.npy", "depth.npy"]


def test_files_are_not_replaced_unasked(tmp_path):
    (tmp_path / "components.npy").write_bytes(b"earlier")
    with pytest.raises(ExistingResultError, match="replaced unasked"):
        tiled(tmp_path, bumpy())
    assert [path.name for path in tmp_path.iterdir()] == ["components.npy"]


HOSTILE = [
    ({"normals": np.zeros((4, 5))}, InputError, "shape"),
    ({"normals": np.zeros((4, 5, 3), np.int32)}, InputError, "type int32"),
    ({"normals": np.zeros((0, 5, 3))}, InputError, "shape"),
    ({"normals": np.zeros((*SHAPE, 3))}, InputError, f"{SHAPE[0] * SHAPE[1]} have no normal"),
    ({"mask": np.ones((3, 3), np.bool_)}, InputError, "mask"),
    ({"mask": np.ones(SHAPE)}, InputError, "true or false"),
    ({"mask": np.zeros(SHAPE, np.bool_)}, InputError, "None of 0 pixels"),
    ({"weights": np.full(SHAPE, -1.0)}, InputError, "negative or not finite"),
    ({"weights": np.full(SHAPE, np.nan)}, InputError, "negative or not finite"),
    ({"weights": np.ones(SHAPE, np.complex128)}, InputError, "one real number"),
    ({"prior": Prior(depth=np.ones((2, 2)), sigma=1.0, unit="mm")}, InputError, "prior depth has shape"),
    ({"prior": Prior(depth=np.full(SHAPE, np.nan), sigma=1.0, unit="mm")}, InputError, "No pixel with a normal"),
    ({"prior": Prior(depth=np.ones(SHAPE), sigma=1.0, unit="inch")}, InputError, "one unit"),
    ({"prior": Prior(depth=np.ones(SHAPE), sigma=-1.0, unit="mm")}, InputError, "standard error"),
    ({"max_memory": 0}, OptionError, "positive"),
    ({"max_memory": 1000, "tile": None}, OptionError, "MB are needed"),
    ({"tile": 0}, OptionError, "positive"),
    ({"tolerance": 0.0}, OptionError, "tolerance"),
    ({"tolerance": float("nan")}, OptionError, "tolerance"),
    ({"dtype": "int16"}, OptionError, "float64 or float32"),
    ({"integrator": LeastAbsolute()}, UnsupportedError, "Only poisson"),
]


@pytest.mark.parametrize(("options", "error", "words"), HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_input(tmp_path, options, error, words):
    options = {"normals": bumpy(), **options}
    with pytest.raises(error, match=words):
        tiled(tmp_path, options.pop("normals"), **options)
    assert list(tmp_path.iterdir()) == []


def test_hostile_paths(tmp_path):
    with pytest.raises(MissingFileError, match="There is no file"):
        tiled(tmp_path, tmp_path / "none.npy")
    (tmp_path / "text.npy").write_text("no numbers")
    with pytest.raises(UnreadableFileError, match=r"numpy\.save"):
        tiled(tmp_path, tmp_path / "text.npy")
    with pytest.raises(MissingFileError, match="no folder"):
        integrate_tiled(bumpy(), ORTHOGRAPHIC, out=tmp_path / "none" / "depth.npy")
    with pytest.raises(OptionError, match="one each"):
        integrate_tiled(bumpy(), ORTHOGRAPHIC, out=tmp_path / "depth.tif")
    with pytest.raises(OptionError, match="one each"):
        tiled(tmp_path, bumpy(), components=tmp_path / "depth.npy")


def test_tiles_cover_the_image_once():
    covered = np.zeros((37, 90), np.int64)
    for tile in make_tiles((37, 90), 16):
        covered[tile.core] += 1
        assert covered[tile.grown(8)].size <= 32 * 32
    assert (covered == 1).all()


def test_file_arrays_hold_windows(tmp_path):
    array = FileArray.make(tmp_path / "a.npy", (9, 11), "f4", fill=2.5, npy=True)
    window = slice(2, 5), slice(3, 10)
    array.write(window, np.arange(21.0).reshape(3, 7))
    expected = np.full((9, 11), 2.5, np.float32)
    expected[window] = np.arange(21).reshape(3, 7)
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), expected)
    again = pickle.loads(pickle.dumps(array))
    np.testing.assert_array_equal(again.read((slice(0, 9), slice(2, 4))), expected[:, 2:4])
    with pytest.raises(InputError, match="cannot be written"):
        FileArray.make(tmp_path / "none" / "a", (2, 2), "f8")


def test_coarse_levels_of_tiles_are_those_of_the_image():
    rng = np.random.default_rng(5)
    shape, levels, margin = (70, 94), 3, 16
    weights = [10.0 ** rng.uniform(-3, 0, size) for size in ((70, 93), (69, 94))]
    weights[0][rng.random((70, 93)) < 0.3] = 0.0
    held = np.where(rng.random(shape) < 0.1, rng.random(shape), 0.0)
    residual = rng.normal(size=shape)
    with Rows(1) as rows:

        def hierarchy(right, down, prior):
            return TileLevels(right, down, prior, scale=1.0, rows=rows, compiled=False, depth=levels)

        whole = hierarchy(*weights, held)
        below = whole.down(residual).copy()
        values = rng.normal(size=below.shape).astype(np.float32)
        above = whole.up(values)
        for tile in make_tiles(shape, 24):
            window = tile.grown(margin)
            (top, bottom), (left, right) = ((part.start, part.stop) for part in window)
            part = hierarchy(
                weights[0][top:bottom, left : right - 1], weights[1][top : bottom - 1, left:right], held[window]
            )
            wide, own = ((nodes(one[0], levels), nodes(one[1], levels)) for one in (window, tile.core))
            at = inside_of(own, wide)
            for found, expected in zip(part.stencil(), whole.stencil(), strict=True):
                np.testing.assert_array_equal(found[at], expected[own])
            np.testing.assert_array_equal(part.down(residual[window])[at], below[own])
            np.testing.assert_array_equal(part.up(values[wide])[inside_of(tile.core, window)], above[tile.core])


def test_the_plan_fits_and_the_grid_coarsens_when_memory_is_short():
    wide = plan_tiles((20_000, 20_000), max_memory=4_000_000_000, tile=None, prior=False)
    narrow = plan_tiles((20_000, 20_000), max_memory=300_000_000, tile=None, prior=False)
    assert wide.memory <= 4_000_000_000
    assert narrow.memory <= 300_000_000
    assert narrow.levels > wide.levels == 3
    assert narrow.side >= 2 * narrow.overlap + 2
    assert Tile(core=(slice(0, 8), slice(0, 8)), shape=(9, 9)).grown(1, before=0) == (slice(0, 9), slice(0, 9))
