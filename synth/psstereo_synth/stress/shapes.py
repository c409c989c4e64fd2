"""Images and masks of extreme shape: one pixel, one row, ten thousand pieces."""

from functools import partial

import numpy as np

from psstereo.bench.stress import Answer, Rule, StressCase
from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.capture import Capture
from psstereo.depth import INTEGRATORS, Integrator
from psstereo.errors import InputError, UnsupportedError
from psstereo.flags import Flag
from psstereo.lights import Rig
from psstereo.normals import NORMAL_SOLVERS, estimate_normals
from psstereo.results import DepthResult, Outcome
from psstereo.stack import MemoryStack
from psstereo.types import BoolArray, FloatArray
from psstereo_synth.rigs import spiral
from psstereo_synth.stress.pixels import eps, exact_bound

__all__ = ["heights", "shape_cases"]

_SLOPE = (0.8, -0.5)
"""Slopes of the plane, to the right and up [1]."""
_COUNT = 48
_STOPS = 1e-7
"""What the iteration of an integrator may leave, beside the height range [1]."""


def shape_cases() -> list[StressCase]:
    """Return the cases of this family."""
    cases = [
        StressCase(family="shapes", name=f"normals, {name}", parameter=what, run=partial(_normals, name, what))
        for what in ("one pixel in a mask", "image of one pixel")
        for name in NORMAL_SOLVERS
    ]
    for what in ("one pixel in a mask", "image of one pixel", "1 × 2000", "2000 × 1", "10 201 pieces", "a comb"):
        for name, method in INTEGRATORS.items():
            whole = not method.any_domain
            cases.append(
                StressCase(
                    family="shapes",
                    name=f"depth, {name}",
                    parameter=what,
                    run=partial(_plane, name, what, pinhole=False),
                    rule=Rule.TOLD,
                    refusals=(UnsupportedError, InputError) if whole else (),
                    remarks=Flag.NO_DEPTH,
                    limit=20.0,
                )
            )
    for what in ("1 × 2000", "one pixel in a mask"):
        cases.append(
            StressCase(
                family="shapes",
                name="depth before a pinhole, poisson",
                parameter=what,
                run=partial(_plane, "poisson", what, pinhole=True),
                rule=Rule.TOLD,
                remarks=Flag.NO_DEPTH,
            )
        )
    return cases


def _normals(name: str, what: str, kind: str) -> Answer:
    directions, truth = spiral(_COUNT), np.array([0.2, -0.3, np.sqrt(0.87)])
    side = 1 if what == "image of one pixel" else 5
    images = np.zeros((_COUNT, side, side))
    mask = np.zeros((side, side), np.bool_)
    at = side // 2
    images[:, at, at], mask[at, at] = 0.7 * directions @ truth, True
    capture = Capture(stack=MemoryStack(images.astype(kind)), rig=Rig.distant(directions), mask=mask)
    found = estimate_normals(capture, NORMAL_SOLVERS[name]())
    error = np.linalg.norm(np.asarray(found.normals[at, at], np.float64) - truth)
    rows = np.column_stack([directions, np.ones(_COUNT)]) if NORMAL_SOLVERS[name].unknowns > 3 else directions
    return Answer(error=np.array([error]), bound=exact_bound(rows, kind, iterates=True), flags=found.flags[at, at])


def _mask(what: str) -> BoolArray:
    if what == "one pixel in a mask":
        mask = np.zeros((7, 9), np.bool_)
        mask[3, 4] = True
        return mask
    if what == "10 201 pieces":
        rows, columns = np.indices((404, 404))
        return np.asarray((rows % 4 < 3) & (columns % 4 < 3))
    if what == "a comb":
        mask = np.zeros((200, 201), np.bool_)
        mask[:, ::2] = mask[0] = True
        return mask
    shapes = {"image of one pixel": (1, 1), "1 × 2000": (1, 2000), "2000 × 1": (2000, 1)}
    return np.ones(shapes[what], np.bool_)


def _plane(name: str, what: str, kind: str, *, pinhole: bool) -> Answer:
    """Integrate a tilted plane, which every integrator gets right whatever the outline; a wave if it has to repeat."""
    mask = _mask(what)
    rows, columns = (np.asarray(one) for one in np.indices(mask.shape, dtype=np.float64))
    if not INTEGRATORS[name].any_domain:
        return _wave(name, mask, rows, columns, kind)
    normal = np.array([-_SLOPE[0], -_SLOPE[1], 1.0]) / np.sqrt(1.0 + _SLOPE[0] ** 2 + _SLOPE[1] ** 2)
    camera: Camera = Orthographic()
    truth = _SLOPE[0] * columns - _SLOPE[1] * rows
    if pinhole:
        camera = Pinhole(fx=3000.0, fy=3000.0, cx=0.5 * mask.shape[1], cy=0.5 * mask.shape[0])
        truth = 1.0 / -(camera.rays(mask.shape) @ normal)
    normals = np.broadcast_to(normal, (*mask.shape, 3)).astype(kind)
    found = _integrated(INTEGRATORS[name](), normals, camera, mask)
    reach = float(max(mask.shape))
    return heights(found, truth, mask, _STOPS + 8.0 * reach * eps(kind), distance=pinhole)


def _wave(name: str, mask: BoolArray, rows: FloatArray, columns: FloatArray, kind: str) -> Answer:
    """Integrate five waves along each side of the image, where there is more than a pixel."""
    height, width = mask.shape
    x, y = 10.0 * np.pi * columns / width * (width > 1), 10.0 * np.pi * rows / height * (height > 1)
    truth = width * np.sin(x) / (10.0 * np.pi) + height * np.sin(y) / (10.0 * np.pi)
    right, down = np.cos(x) * (width > 1), np.cos(y) * (height > 1)
    normals = np.stack([-right, down, np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    found = _integrated(INTEGRATORS[name](), normals.astype(kind), Orthographic(), mask)
    return heights(found, truth, mask, _STOPS + 8.0 * max(mask.shape) * eps(kind))


def _integrated(method: Integrator, normals: FloatArray, camera: Camera, mask: BoolArray) -> DepthResult:
    return method.integrate(normals, camera, mask=None if mask.all() else mask)


def heights(found: DepthResult, truth: FloatArray, mask: BoolArray, bound: float, *, distance: bool = False) -> Answer:
    """Return the errors of heights beside their range, each piece up to its constant; distances, up to a factor.

    Parameters
    ----------
    found : DepthResult
        What an integrator gave.
    truth : float64 array (h, w)
        True heights or distances.
    mask : bool array (h, w)
        Pixels that were asked for.
    bound : float
        Of the errors, beside the range [1].
    distance : bool
        Whether they are distances.

    Returns
    -------
    Answer
        Errors under the mask; pixels without depth carry ``NO_DEPTH`` if the result owns up to them, and all carry
        ``NOT_CONVERGED`` if it does.
    """
    depth, real = np.asarray(found.depth, np.float64)[mask], truth[mask]
    depth, real = (np.log(depth), np.log(real)) if distance else (depth, real)
    labels = np.unique(np.asarray(found.components)[mask], return_inverse=True)[1].ravel()
    count = np.maximum(np.bincount(labels), 1)
    known = np.isfinite(depth)
    off = np.where(known, depth - real, 0.0)
    off -= (np.bincount(labels, off) / np.maximum(np.bincount(labels, known), 1))[labels]
    flags = np.zeros(len(off), np.uint16)
    if found.outcome is not Outcome.SOLVED:
        flags[~known] |= np.uint16(Flag.NO_DEPTH)
    if found.outcome is Outcome.NOT_CONVERGED:
        flags |= np.uint16(Flag.NOT_CONVERGED)
    size = max(float(np.ptp(real)) if len(count) else 0.0, 1e-300 if len(real) > 1 else 1.0)
    return Answer(error=np.where(known, np.abs(off) / size, np.nan), bound=bound, flags=flags)
