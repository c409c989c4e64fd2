"""Suite quick: a little of everything, in under a minute: solvers, integrators, one image, a folder."""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.parts import parts_of
from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.types import Map, Progress

__all__ = ["quick"]

_SOLVERS = ("least-squares", "robust", "response-bend")
_SIZE = "128x96"
_LIGHTS = 24
_READ_LIGHTS = 12
_SHADED_SIDE = 64


def quick(
    repeats: int, size: str | None, _lights: int, threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], None, dict[str, Any]]:
    """Measure each part of the toolkit on something small."""
    shape = dimensions(size or _SIZE)
    parts = parts_of(progress, "quick", [3.0, 1.0, 3.0, 1.0])
    records = _normals(shape, repeats, over, next(parts))
    records += _depth(shape, repeats, threads, next(parts))
    records += _shading(min(_SHADED_SIDE, *shape), repeats, threads, next(parts))
    records += _reading(shape, repeats, over, next(parts))
    notes = [
        f"Small images ({shape[0]} × {shape[1]}) show fixed costs more than growth; see the suite scaling for that."
    ]
    return records, None, {"notes": notes}


def _normals(shape: tuple[int, int], repeats: int, over: "Map", progress: "Progress") -> list["Record"]:
    from psstereo.bench import run_solvers
    from psstereo.normals import NORMAL_SOLVERS
    from psstereo_synth.problems import solver_problems

    methods = {name: NORMAL_SOLVERS[name]() for name in _SOLVERS}
    problems = solver_problems(*shape, _LIGHTS)
    return run_solvers("quick", problems, methods, repeats=repeats, over=over, progress=progress)


def _depth(shape: tuple[int, int], repeats: int, threads: int, progress: "Progress") -> list["Record"]:
    from psstereo.bench import run_timed
    from psstereo.camera import Orthographic
    from psstereo.depth import Discontinuity, Poisson
    from psstereo.metrics import height_error
    from psstereo_synth.reliefs import relieved

    surface = relieved("cliff", *shape)

    def score(answer: Any) -> dict[str, float]:
        return {"rmse": float(height_error(answer.depth, surface.height, surface.mask, alignment="offset").rmse)}

    work = {
        method.name: partial(method.integrate, surface.normals, Orthographic(), mask=surface.mask)
        for method in (Poisson(threads=threads), Discontinuity(threads=threads))
    }
    sizes = {"pixels": int(surface.mask.sum())}
    return run_timed("quick", "cliff", work, repeats=repeats, sizes=sizes, score=score, progress=progress)


def _shading(side: int, repeats: int, threads: int, progress: "Progress") -> list["Record"]:
    from psstereo.bench import run_timed
    from psstereo.metrics import summarise_angles
    from psstereo.sfs import SHADING_METHODS
    from psstereo_synth.shading_problems import shaded

    problem = shaded("four hills", side)

    def score(result: Any) -> dict[str, float]:
        found = summarise_angles(result.normals.normals, problem.normals, problem.image.inside)
        return {"mean_deg": float(found.mean_deg)}

    known = {"variational": problem.image, "eikonal": replace(problem.image, heights=problem.summits)}
    work: dict[str, Callable[[], object]] = {
        name: partial(SHADING_METHODS[name](threads=threads).recover, image) for name, image in known.items()
    }
    return run_timed(
        "quick",
        "one image",
        work,
        repeats=repeats,
        sizes={"pixels": int(problem.image.inside.sum())},
        score=score,
        progress=progress,
    )


def _reading(shape: tuple[int, int], repeats: int, over: "Map", progress: "Progress") -> list["Record"]:
    from psstereo.bench import run_timed
    from psstereo.io import Choices, read_capture, write_diligent
    from psstereo.metrics import summarise_angles
    from psstereo.normals import LeastSquares, estimate_normals
    from psstereo.stack.decode import decode_image
    from psstereo_synth import checker, hills, spiral
    from psstereo_synth.capture import lambertian_capture

    width, height = shape
    surface, directions = hills(width, height), spiral(_READ_LIGHTS)
    capture, _ = lambertian_capture(surface, checker((height, width)), directions, noise=0.002)
    with tempfile.TemporaryDirectory(prefix="psstereo-bench-") as temporary:
        folder = Path(temporary) / "capture"
        write_diligent(
            folder,
            images=capture.stack.read(),
            directions=directions,
            intensities=capture.rig.strengths(1).repeat(3, axis=1),
            mask=surface.mask,
        )
        files = sorted(folder.glob("[0-9]*.png"))

        def score(answer: Any) -> dict[str, float]:
            if isinstance(answer, list):
                return {}
            return {"mean_deg": float(summarise_angles(answer.normals, surface.normals, surface.mask).mean_deg)}

        work: dict[str, Callable[[], object]] = {
            "decoding alone": lambda: list(over(decode_image, files)),
            "reading, least-squares": lambda: estimate_normals(
                read_capture(folder, choices=Choices(truth=False))[0], LeastSquares(), over=over
            ),
        }
        sizes = {"lights": _READ_LIGHTS, "width": width, "height": height}
        return run_timed("quick", "folder", work, repeats=repeats, sizes=sizes, score=score, progress=progress)
