"""Integration where it is stiff: slopes to 1e4, weights over twelve decades, large grids."""

from functools import partial

import numpy as np

from psstereo.bench.stress import DOUBLE, Answer, Rule, StressCase
from psstereo.camera import Orthographic
from psstereo.depth import INTEGRATORS, Bilateral, Poisson
from psstereo.flags import Flag
from psstereo.types import BoolArray, FloatArray
from psstereo_synth.stress.pixels import eps
from psstereo_synth.stress.shapes import heights

__all__ = ["grid_case", "integration_cases"]

_STOPS = 1e-7
"""What the iteration may leave, beside the height range, where every weight is alike [1]."""
_STIFF = 1e-4
"""The same where weights span decades: a relative residual of 1e-10 says less about what hangs on weak ties [1]."""
_SIDE = 64
_GRIDS = (128, 1024)
"""Sides of the grids that are always integrated [px]."""


def integration_cases() -> list[StressCase]:
    """Return the cases of this family."""
    cases = []
    methods = [name for name, method in INTEGRATORS.items() if method.any_domain]
    told = partial(StressCase, family="integration", rule=Rule.TOLD, remarks=Flag.NO_DEPTH | Flag.NOT_CONVERGED)
    for slope in (1e1, 1e3, 1e4):
        for name in methods:
            steep = partial(told, parameter=f"{slope:.0e}, {name}", limit=20.0)
            cases.append(steep(name="plane of slope", run=partial(_ramp, name, slope)))
    for slope in (1e2, 1e4):
        cases.append(told(name="wall of slope", parameter=f"{slope:.0e}, poisson", run=partial(_wall, slope)))
    for decades in (4, 12):
        for pattern in ("noise", "halves", "a bridge"):
            for name in methods:
                cases.append(
                    told(
                        name=f"weights over {decades} decades",
                        parameter=f"{pattern}, {name}",
                        run=partial(_weighted, name, decades, pattern),
                        limit=20.0,
                    )
                )
    for steepness in (2.0, 100.0, 1e4):
        cases.append(
            told(
                name="bilateral, sides in balance",
                parameter=f"k {steepness:g}, slope 5",
                run=partial(_sides, steepness),
            )
        )
    cases += [grid_case(side, side) for side in _GRIDS]
    return cases


def grid_case(width: int, height: int) -> StressCase:
    """Return the case of a large grid.

    Parameters
    ----------
    width, height : int
        Of the image [px].

    Returns
    -------
    StressCase
        A cap of a sphere over the whole image, by plain integration.
    """
    return StressCase(
        family="integration",
        name="grid",
        parameter=f"{width} × {height}",
        run=partial(_grid, width, height),
        kinds=DOUBLE if width * height > 4_000_000 else ("float64", "float32"),
        limit=max(5.0, 2e-5 * width * height),
        large=width * height > 4_000_000,
    )


def _ramp(name: str, slope: float, kind: str) -> Answer:
    columns = np.indices((24, _SIDE), dtype=np.float64)[1]
    normal = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    found = INTEGRATORS[name]().integrate(np.broadcast_to(normal, (24, _SIDE, 3)).astype(kind), Orthographic())
    everywhere = np.ones(columns.shape, np.bool_)
    return heights(found, slope * columns, everywhere, _STOPS + 8.0 * _SIDE * eps(kind))


def _wall(slope: float, kind: str) -> Answer:
    """Two floors and a wall between them, one column wide; the step from floor to wall is that of the mid normal."""
    normals = np.zeros((48, _SIDE, 3))
    normals[..., 2] = 1.0
    normals[:, 40:42] = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    found = Poisson().integrate(normals.astype(kind), Orthographic())
    middle = normals[0, 39] + normals[0, 40]
    onto = -middle[0] / middle[2]
    truth = np.broadcast_to(
        np.repeat([0.0, onto, onto + slope, 2.0 * onto + slope], [40, 1, 1, _SIDE - 42]), (48, _SIDE)
    )
    return heights(found, truth, np.ones(truth.shape, np.bool_), _STOPS + 8.0 * _SIDE * eps(kind))


def _plane() -> tuple[FloatArray, FloatArray]:
    """Return heights and normals of a plane: exact with every method and whatever the weights."""
    rows, columns = np.indices((_SIDE, _SIDE), dtype=np.float64)
    normal = np.array([-0.6, -0.3, 1.0]) / np.sqrt(1.45)
    return 0.6 * columns - 0.3 * rows, np.broadcast_to(normal, (_SIDE, _SIDE, 3))


def _weighted(name: str, decades: int, pattern: str, kind: str) -> Answer:
    truth, normals = _plane()
    rows, columns = np.arange(_SIDE)[:, None], np.arange(_SIDE)[None, :]
    if pattern == "noise":
        weights = 10.0 ** np.random.default_rng(0).uniform(-decades, 0.0, truth.shape)
    else:
        weights = np.where((columns < _SIDE // 2) & (rows >= 0), 1.0, 10.0**-decades)
    mask = np.ones(truth.shape, np.bool_)
    if pattern == "a bridge":
        mask[:, _SIDE // 2] = rows[:, 0] == 7
        weights = np.where((columns == _SIDE // 2) & (rows >= 0), 10.0**-decades, 1.0)
    found = INTEGRATORS[name]().integrate(normals.astype(kind), Orthographic(), mask=mask, weights=weights)
    return heights(found, truth, mask, (_STOPS if decades < 8 else _STIFF) + 8.0 * _SIDE * eps(kind))


def _sides(steepness: float, kind: str) -> Answer:
    """Steps of five pixels on both sides: squared and times k, an exponent of thousands that must saturate."""
    rows, columns = np.indices((40, 60), dtype=np.float64)
    normal = np.array([-5.0, 0.0, 1.0]) / np.sqrt(26.0)
    found = Bilateral(steepness=steepness).integrate(np.broadcast_to(normal, (40, 60, 3)).astype(kind), Orthographic())
    everywhere: BoolArray = np.ones(rows.shape, np.bool_)
    return heights(found, 5.0 * columns, everywhere, _STOPS + 8.0 * 60 * eps(kind))


def _grid(width: int, height: int, kind: str) -> Answer:
    """Integrate a cap that reaches 56° at the corners, of the chord rule's own kind: exact at every pixel."""
    x = (np.arange(width) - (width - 1) / 2.0)[None, :]
    y = ((height - 1) / 2.0 - np.arange(height))[:, None]
    radius = 0.6 * np.hypot(width, height)
    tall = np.sqrt(radius**2 - x * x - y * y)
    normals = np.zeros((height, width, 3), kind)
    normals[..., 0], normals[..., 1], normals[..., 2] = x / radius, y / radius, tall / radius
    found = Poisson().integrate(normals, Orthographic())
    mask: BoolArray = np.ones(tall.shape, np.bool_)
    return heights(found, tall, mask, _STOPS + 8.0 * eps(kind) * max(width, height))
