"""Near lamps: a path-traced sphere, this package's own rendering and a real face, by positions alone."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.camera import Pinhole
from psstereo.io import read_capture
from psstereo.kernels.near import lamp_vectors
from psstereo.lights import Rig
from psstereo.metrics import angular_error
from psstereo.near import NearOptions, solve_near
from psstereo.near.lamps import lamp_array
from psstereo.normals import GATES, LeastSquares, estimate_normals
from psstereo.stack import MemoryStack
from psstereo_synth.gallery import gallery_scene
from psstereo_synth.rendering import render
from psstereo_synth.scenes.file import Changes


def degrees(found, truth):
    angle = np.degrees(angular_error(np.asarray(found, np.float64), truth))
    return angle[np.isfinite(angle)]


def test_own_rendering_of_leds_comes_back():
    rendering = render(gallery_scene("near-leds", Changes(size=(128, 128))))[0]
    found = solve_near(rendering.capture)
    assert degrees(found.normals.normals, rendering.truth.normals).mean() < 0.01
    error = found.depth.depth / rendering.truth.depth - 1
    assert np.nanmax(np.abs(error)) < 1e-4
    assert found.converged


@pytest.fixture(scope="module")
def sphere(data_dir):
    """The path-traced sphere with its lamps in the camera's frame."""
    folder = data_dir / "rendered" / "sphere-near24"
    capture, truth = read_capture(folder, layout="near-led")
    lamps = tuple(lamp.moved(np.eye(3), np.array([0.0, 0.0, -5.0])) for lamp in capture.rig.lights)
    camera = Pinhole(fx=800, fy=800, cx=159.5, cy=159.5)
    depth = 5.0 - np.load(folder / "depth_gt.npy")
    return replace(capture, rig=Rig(lamps), camera=camera), truth.normals, depth


@pytest.mark.data
@pytest.mark.slow
def test_a_path_traced_sphere_comes_back_metric(sphere):
    capture, normals, depth = sphere
    found = solve_near(capture)
    angle = degrees(found.normals.normals, normals)
    assert angle.mean() < 0.25  # 0.18 with the true depth: the truth itself was sampled at a random place of each pixel
    assert angle.size == np.count_nonzero(capture.mask)
    error = (found.depth.depth / depth - 1)[capture.mask]
    assert np.sqrt(np.nanmean(error**2)) < 1e-3
    assert abs(np.nanmedian(error)) < 2e-4
    assert found.converged


@pytest.mark.data
def test_the_same_sphere_as_distant_lights_is_eighteen_degrees_wrong(sphere, data_dir):
    capture, normals, _ = sphere
    distant, _ = read_capture(data_dir / "rendered" / "sphere-near24")
    found = estimate_normals(replace(distant, mask=capture.mask), LeastSquares(gate=GATES["none"]))
    assert degrees(found.normals, normals).mean() == pytest.approx(18.0, abs=0.3)


@pytest.mark.data
@pytest.mark.slow
@pytest.mark.parametrize("guess", [3.5, 6.5])
def test_a_wrong_guess_does_not_matter(sphere, guess):
    capture, normals, depth = sphere
    found = solve_near(capture, NearOptions(distance=guess))
    assert degrees(found.normals.normals, normals).mean() < 0.25
    assert np.nanmedian(found.depth.depth) == pytest.approx(np.nanmedian(depth[capture.mask]), rel=1e-3)


def gray_samples(capture):
    """Return the mean of the channels (m, p), the lamps' mean fluxes (m,) and the viewing rays (p, 3)."""
    mask = capture.mask
    values = np.stack([(capture.stack.frame(i) - capture.dark)[mask].mean(axis=1) for i in range(len(capture.rig))])
    flux = np.array([lamp.flux.mean() for lamp in capture.rig.lights])
    return values, flux, capture.camera.rays(mask.shape)[mask]


def matte_residual(samples, lamps, depth, *, shadows):
    """Return |I − model| / |I| of the least-squares fit at given distances (p,), all samples counted."""
    values, flux, rays = samples
    points = rays * depth[:, None]
    vectors, _ = lamp_vectors(points, points, lamps)
    a = np.moveaxis(vectors * flux[None, :, None], 2, 0).transpose(0, 2, 1)  # (p, m, 3)
    y = values.T
    lit = np.ones(y.shape, np.bool_)
    best = np.full(len(y), np.inf)
    for _ in range(15 if shadows else 1):
        gram = np.einsum("pmi,pm,pmj->pij", a, lit, a)
        gram += 1e-12 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        b = np.linalg.solve(gram, np.einsum("pmi,pm->pi", a, lit * y)[..., None])[..., 0]
        predicted = np.einsum("pmi,pi->pm", a, b)
        shown = np.maximum(predicted, 0.0) if shadows else predicted
        best = np.minimum(best, ((y - shown) ** 2).sum(axis=1))
        lit = predicted > 0
        lit |= (lit.sum(axis=1) < 3)[:, None]
    return float(np.sqrt(best.sum() / (y * y).sum()))


def every_second_pixel(capture):
    """Return a capture of a quarter of the pixels, each as it was."""
    part = (slice(None, None, 2), slice(None, None, 2))
    at = capture.camera
    camera = Pinhole(fx=at.fx / 2, fy=at.fy / 2, cx=at.cx / 2, cy=at.cy / 2)
    stack = MemoryStack(capture.stack.read()[:, *part])
    return replace(capture, stack=stack, mask=capture.mask[part], dark=capture.dark[part], camera=camera)


@pytest.mark.data
@pytest.mark.slow
def test_a_real_face_is_found_where_it_was(data_dir):
    """All pixels for what was published, a quarter of them for our own answer; the next test solves for all again."""
    capture, _ = read_capture(data_dir / "near_face")
    count = int(np.count_nonzero(capture.mask))
    published = {620: 0.156, 660: 0.112, 700: 0.103, 740: 0.106, 800: 0.115, 860: 0.124}  # flat faces, no shadows
    samples, lamps = gray_samples(capture), lamp_array(capture.rig)
    for distance, residual in published.items():
        flat = np.full(count, float(distance))
        assert matte_residual(samples, lamps, flat, shadows=False) == pytest.approx(residual, abs=1e-3)
    capture = every_second_pixel(capture)
    count = int(np.count_nonzero(capture.mask))
    found = solve_near(capture)
    assert found.converged
    assert found.depth.unit == "mm"
    depth = found.depth.depth[capture.mask]
    assert np.nanmedian(depth) == pytest.approx(700.0, rel=0.02)
    low, high = np.nanquantile(depth, [0.01, 0.99])
    assert 30 < high - low < 90  # a face is some 5 cm deep
    assert np.isfinite(depth).mean() > 0.98
    filled = np.where(np.isfinite(depth), depth, np.nanmedian(depth))
    samples = gray_samples(capture)
    residual = matte_residual(samples, lamps, filled, shadows=True)
    assert residual < 0.093
    assert residual < matte_residual(samples, lamps, np.full(count, 700.0), shadows=True) - 0.0005
    assert found.normals.facts["relative_residual"] < 0.06  # of the observations that the fit believes
    assert (found.normals.normals[capture.mask][:, 2] > 0).mean() > 0.97


@pytest.mark.data
@pytest.mark.slow
@pytest.mark.parametrize("guess", [600.0, 800.0])
def test_the_face_is_found_from_a_wrong_guess(data_dir, guess):
    capture, _ = read_capture(data_dir / "near_face")
    found = solve_near(capture, NearOptions(distance=guess, tolerance=1e-3))
    assert np.nanmedian(found.depth.depth) == pytest.approx(697.6, rel=0.01)
