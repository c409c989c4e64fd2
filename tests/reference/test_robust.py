"""The robust solver on the field's own terms: shadows, noise, highlights, and the benchmark's photographs."""

import numpy as np
import pytest

from psstereo.io import read_capture
from psstereo.lights import Rig
from psstereo.metrics import summarise_angles
from psstereo.normals import estimate_normals
from psstereo.normals.robust import Robust
from psstereo.normals.solver import Samples
from psstereo_synth import spiral


def common_work(case, count=3000, lights=96, seed=0):
    """96 suns to 60°, albedo 0.1 to 0.9, attached shadows, 16 bit; noise of 1 %, or a Blinn–Phong lobe of 60."""
    rng = np.random.default_rng(seed)
    directions = spiral(lights)
    slopes = rng.normal(0, 0.45, (count, 2))
    normals = np.column_stack([-slopes, np.ones(count)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shading = np.maximum(directions @ normals.T, 0)
    values = shading * rng.uniform(0.1, 0.9, count)
    if case == "highlights":
        half = directions + np.array([0.0, 0.0, 1.0])
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        values += 0.5 * np.maximum(half @ normals.T, 0) ** 60 * (shading > 0)
    values *= 0.6
    if case == "noise":
        values += rng.normal(0, 0.01 / np.sqrt(3), values.shape)  # of three channels, each with 1 %
    return directions, normals, np.rint(np.clip(values, 0, 1) * 65535) / 65535


def mean_angle(found, normals):
    return np.degrees(
        np.arctan2(np.linalg.norm(np.cross(found, normals), axis=1), (found * normals).sum(axis=1))
    ).mean()


@pytest.mark.parametrize(("case", "bound"), [("lambert", 0.001), ("noise", 0.5), ("highlights", 0.25)])
@pytest.mark.parametrize("pixels", [None, 1_000_000])
def test_shadows_noise_and_highlights_with_one_default(case, bound, pixels):
    directions, normals, values = common_work(case)
    solver = Robust()
    found = solver.solve(solver.prepare(Rig.distant(directions), pixels), Samples(values)).scaled
    assert mean_angle(found / np.linalg.norm(found, axis=1, keepdims=True), normals) < bound


def test_noise_is_near_what_the_lit_observations_hold():
    """Within 8 % of least squares told which observations are lit."""
    directions, normals, values = common_work("noise")
    lit = directions @ normals.T > 0
    told = np.stack([np.linalg.lstsq(directions[u], v[u], rcond=None)[0] for u, v in zip(lit.T, values.T, strict=True)])
    solver = Robust()
    found = solver.solve(solver.prepare(Rig.distant(directions)), Samples(values)).scaled
    best = mean_angle(told / np.linalg.norm(told, axis=1, keepdims=True), normals)
    assert mean_angle(found / np.linalg.norm(found, axis=1, keepdims=True), normals) < 1.08 * best


@pytest.mark.data
@pytest.mark.slow
@pytest.mark.parametrize(("name", "bound"), [("ballPNG", 1.85), ("catPNG", 6.6)])
def test_photographs_of_the_benchmark(data_dir, name, bound):
    capture, truth = read_capture(data_dir / "diligent" / name)
    found = estimate_normals(capture, Robust())
    assert summarise_angles(found.normals, truth.normals, capture.mask).mean_deg < bound


@pytest.mark.data
@pytest.mark.slow
@pytest.mark.parametrize(("name", "bound"), [("spot-lambert", 2.3), ("teapot-plastic", 7.0)])
def test_path_traced_captures(data_dir, name, bound):
    """Least squares with shadows left out: 2.24° and 7.7°."""
    capture, truth = read_capture(data_dir / "rendered" / name)
    found = estimate_normals(capture, Robust())
    assert summarise_angles(found.normals, truth.normals, capture.mask).mean_deg < bound
