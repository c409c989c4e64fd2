"""Suite sfs: shape from one image, error and time of every method, over sizes, and under photographs of the user."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.parts import parts_of
from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.sfs import ShadedImage, ShadingMethod, ShadingResult
    from psstereo.types import Map, Progress
    from psstereo_synth.shading_problems import Shaded

__all__ = ["sfs"]

_SIZE = "256x256"
_GROWTH = {"eikonal": (256, 512, 1024, 2048, 4096), "variational": (256, 512, 1024, 2048)}
"""Side lengths over which time by pixel is measured, by method [px]."""
_COARSE = 16
"""Pixels of the image along a side of one of the prior."""
_LARGEST = {"lee-kuo": 256**2}
"""Pixels up to which a method is measured at all: a factorisation grows faster than the image."""


def sfs(
    repeats: int,
    size: str | None,
    lights: int,
    threads: int,
    over: "Map",
    progress: "Progress",
    folder: Path | None = None,
) -> tuple[list["Record"], None, dict[str, Any]]:
    """Recover known surfaces from one image each, under a sun 30° off the view."""
    del lights
    from psstereo.bench import run_timed
    from psstereo.sfs import SHADING_METHODS
    from psstereo_synth.shading_problems import SHADED, shaded

    side = min(dimensions(size or _SIZE))
    growth = [(method, length) for method, sides in _GROWTH.items() if size is None for length in sides]
    parts = parts_of(progress, "sfs", [1.0] * (len(SHADED) + len(growth)) + [4.0] * (folder is not None))
    records: list[Record] = []
    for name in SHADED:
        problem = shaded(name, side)
        pixels = {"pixels": int(problem.image.inside.sum())}
        work: dict[str, Callable[[], object]] = {}
        for kind in SHADING_METHODS.values():
            if side * side <= _LARGEST.get(kind.name, side * side):
                work |= _attempts(kind(threads=threads), problem)
        score = partial(_score, problem)
        records += run_timed("sfs", name, work, repeats=repeats, sizes=pixels, score=score, progress=next(parts))
    for method, length in growth:
        problem = shaded("four hills", length)
        found = _attempts(SHADING_METHODS[method](threads=threads), problem)
        label, attempt = next(iter(found.items()))
        records += run_timed(
            "sfs",
            f"{length} × {length}",
            {label: attempt},
            repeats=min(repeats, 3),
            sizes={"pixels": length * length},
            score=partial(_score, problem),
            progress=next(parts),
        )
    if folder is not None:
        records += _photographs(folder, threads, repeats, over, next(parts))
    notes = ["Heights are scored after the mean is removed, as shares of the surface's range; normals in degrees."]
    return records, None, {"notes": notes, "table": _table(records)}


def _attempts(method: "ShadingMethod", problem: "Shaded") -> dict[str, Callable[[], object]]:
    """Return the method with what it can make use of: heights of the rim and of summits, a coarse prior."""
    image = problem.image
    if not method.any_mask:
        import numpy as np

        # Its place is a full rectangle: what lies outside is taken as facing the camera.
        facing = float(image.light.irradiance(np.zeros(3), np.array([0.0, 0.0, 1.0]))[0])
        image = replace(image, image=np.where(image.inside, image.image, facing), mask=None)
    if not method.takes_heights:
        return {method.name: partial(method.recover, replace(image, heights=None))}
    given = {"summits": problem.summits, "rim": image.heights}
    order = ("summits", "rim") if method.name == "eikonal" else ("rim", "summits")
    found: dict[str, Callable[[], object]] = {
        f"{method.name}, {what}": partial(method.recover, replace(image, heights=given[what])) for what in order
    }
    if method.takes_prior:
        rough = replace(image, prior=_coarse(problem))
        found[f"{method.name}, coarse prior"] = partial(method.recover, rough)
    return found


def _coarse(problem: "Shaded") -> Any:
    """Return the true heights, averaged over blocks and interpolated back, as a prior."""
    from psstereo.depth import Prior
    from psstereo_synth.shading_problems import coarsened

    rough, sigma = coarsened(problem.height, _COARSE)
    # Pixels of a block err together: each counts as one of as many as the block has.
    return Prior(depth=rough, sigma=sigma * _COARSE, unit=problem.image.camera.unit)


def _score(problem: "Shaded", result: "ShadingResult") -> dict[str, float]:
    """Return errors of heights as shares of their range, and of normals in degrees."""
    import numpy as np

    from psstereo.metrics import height_error, summarise_angles

    inside = problem.image.inside
    angles = summarise_angles(result.normals.normals, problem.normals, inside)
    span = float(np.nanmax(problem.height) - np.nanmin(problem.height))
    heights = height_error(result.depth.depth, problem.height, inside, alignment="offset")
    return {
        "mean_height": heights.mean_abs / span,
        "max_height": heights.max_abs / span,
        "mean_deg": float(angles.mean_deg),
        "missing": float(heights.missing),
    }


def _photographs(folder: Path, threads: int, repeats: int, over: "Map", progress: "Progress") -> list["Record"]:
    """Recover each capture of a folder from its most frontal image, against photometric stereo with all of them."""
    from psstereo.bench import run_timed
    from psstereo.errors import MissingFileError
    from psstereo.io import read_capture
    from psstereo.masking import mask_from_brightness
    from psstereo.metrics import summarise_angles
    from psstereo.normals import estimate_normals
    from psstereo.sfs import SHADING_METHODS
    from psstereo.sfs.silhouette import with_silhouette
    from psstereo.sfs.single import image_of_capture, most_frontal

    places = sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    if not places:
        raise MissingFileError(
            given=f"{folder} holds no folder.", needed="A folder of captures.", remedy="Name it with --folder."
        )
    records: list[Record] = []
    for place, part in zip(places, parts_of(progress, "sfs", [1.0] * len(places)), strict=True):
        capture, _ = read_capture(place)
        if capture.mask is None:
            capture = replace(capture, mask=mask_from_brightness(capture.stack, over=over))
        truth = estimate_normals(capture, over=over).normals
        image: ShadedImage = image_of_capture(capture, most_frontal(capture))

        def score(result: Any, truth: Any = truth, inside: Any = image.inside) -> dict[str, float]:
            return {"mean_deg": float(summarise_angles(result.normals.normals, truth, inside).mean_deg)}

        work = {
            name: partial(kind(threads=threads).recover, image)
            for name, kind in SHADING_METHODS.items()
            if kind.any_mask and image.inside.sum() <= _LARGEST.get(name, image.inside.size)
        }
        outlined = with_silhouette(image)
        work |= {
            f"{name}, silhouette": partial(kind(threads=threads).recover, outlined)
            for name, kind in SHADING_METHODS.items()
            if kind.takes_prior
        }
        work["flat"] = partial(_flat, image)
        sizes = {"pixels": int(image.inside.sum())}
        records += run_timed("sfs", place.name, work, repeats=repeats, sizes=sizes, score=score, progress=part)
    return records


def _flat(image: "ShadedImage") -> Any:
    """Return what a guess without looking has: every normal toward the camera."""
    from types import SimpleNamespace

    import numpy as np

    normals = np.where(image.inside[..., None], np.array([0.0, 0.0, 1.0]), np.nan)
    return SimpleNamespace(normals=SimpleNamespace(normals=normals))


def _table(records: list["Record"]) -> dict[str, Any]:
    import statistics

    groups: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        groups.setdefault((record.problem, record.method), []).append(record)
    rows = []
    for (problem, method), group in groups.items():
        seconds = statistics.median(record.seconds["total"] for record in group)
        error = group[-1].error
        shares = [f"{100 * error[key]:.2f} %" if key in error else "" for key in ("mean_height", "max_height")]
        degrees = f"{error['mean_deg']:.2f}°" if "mean_deg" in error else ""
        rows.append(
            (
                problem,
                method,
                f"{seconds:.3f} s",
                f"{seconds / group[0].sizes['pixels'] * 1e9:.0f} ns",
                *shares,
                degrees,
            )
        )
    columns = ("surface", "method", "time", "a pixel", "mean height", "largest", "mean normal")
    return {"title": "medians of the time; errors", "rows": rows, "columns": columns}
