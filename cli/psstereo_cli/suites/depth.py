"""Suite depth: integrators on smooth surfaces, cliffs and rectangles, over sizes, and on maps with true depth."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.parts import parts_of
from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    import numpy as np

    from psstereo.bench import Record
    from psstereo.depth import Integrator
    from psstereo.results import DepthResult
    from psstereo.types import FloatArray, Map, Progress
    from psstereo_synth.reliefs import Relieved

__all__ = ["depth"]

_GROWTH = (376, 846, 1888, 4684)
"""Side lengths whose discs have about 0.1, 0.4, 2 and 12.6 million pixels, each as many times more [px]."""


def depth(
    repeats: int,
    size: str | None,
    lights: int,
    threads: int,
    over: "Map",
    progress: "Progress",
    folder: Path | None = None,
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Integrate exact normals; with a folder, the normal maps in it that have a true depth as well."""
    del lights, over
    from psstereo.depth import INTEGRATORS, Discontinuity, Poisson
    from psstereo_synth.reliefs import RELIEFS, relieved

    width, height = dimensions(size or "612x512")
    places = [] if folder is None else _places(folder)
    integrators = {name: kind(threads=threads) for name, kind in INTEGRATORS.items() if kind.any_domain}
    records: list[Record] = []
    notes: list[str] = []
    sides = _GROWTH if size is None else ()
    parts = parts_of(progress, "depth", [1.0] * (len(RELIEFS) + 1 + len(sides) + len(places)))
    measure = partial(_measure, repeats=repeats)
    for kind in RELIEFS:
        surface = relieved(kind, width, height)
        methods = {name: partial(_integrate, method, surface) for name, method in integrators.items()}
        records += measure(
            kind, methods | (_others(surface, notes) if kind == "smooth" else {}), surface, progress=next(parts)
        )
    rectangle = relieved("smooth", width, height, whole=True)
    records += measure("rectangle", _on_rectangles(rectangle, threads), rectangle, progress=next(parts))
    for side in sides:
        disc = relieved("smooth", side, side)
        method = {"poisson": partial(_integrate, Poisson(threads=threads), disc)}
        records += _measure(f"disc {side}", method, disc, repeats=min(repeats, 3), progress=next(parts))
    chosen = {"poisson": Poisson(threads=threads), "discontinuity": Discontinuity(threads=threads)}
    for place in places:
        records += _photographed(place, chosen, repeats, next(parts))
    return records, "poisson", {"sizes": {"width": width, "height": height}, "notes": notes, "table": _table(records)}


def _integrate(method: "Integrator", surface: "Relieved") -> "DepthResult":
    from psstereo.camera import Orthographic

    return method.integrate(surface.normals, Orthographic(), mask=surface.mask)


def _others(surface: "Relieved", notes: list[str]) -> dict[str, Callable[[], object]]:
    """Return what others use, as far as it is installed."""
    from importlib.util import find_spec

    from psstereo.bench.depth_baselines import algebraic_multigrid, sparse_direct

    found: dict[str, Callable[[], object]] = {"sparse direct": partial(sparse_direct, surface.normals, surface.mask)}
    if find_spec("pyamg") is None:
        notes.append("Algebraic multigrid was left out: PyAMG is not installed.")
        return found
    return found | {"algebraic multigrid": partial(algebraic_multigrid, surface.normals, surface.mask)}


def _on_rectangles(surface: "Relieved", threads: int) -> dict[str, Callable[[], object]]:
    from psstereo.bench.depth_baselines import bare_transform
    from psstereo.depth import FrankotChellappa, Poisson

    rows, columns = surface.mask.shape
    return {
        "poisson": partial(_integrate, Poisson(threads=threads), surface),
        "poisson, plain": partial(_integrate, Poisson(turn=None, slant_exponent=0.0, threads=threads), surface),
        "frankot-chellappa": partial(_integrate, FrankotChellappa(threads=threads), surface),
        "bare transform": partial(bare_transform, (rows, columns)),
    }


def _measure(
    problem: str,
    methods: Mapping[str, Callable[[], object]],
    surface: "Relieved",
    *,
    repeats: int,
    progress: "Progress",
) -> list["Record"]:
    import numpy as np

    from psstereo.bench import run_timed

    def score(answer: Any) -> dict[str, float]:
        found = np.asarray(getattr(answer, "depth", answer))
        if found.shape != surface.height.shape:
            return {}
        more = {"iterations": float(answer.iterations)} if hasattr(answer, "iterations") else {}
        return _heights_off(found, surface.height, surface.mask) | more

    sizes = {"pixels": int(np.count_nonzero(surface.mask))}
    return run_timed("depth", problem, methods, repeats=repeats, sizes=sizes, score=score, progress=progress)


def _heights_off(found: "FloatArray", truth: "FloatArray", mask: "np.ndarray[Any, Any]") -> dict[str, float]:
    """Return the errors once the free constant is removed [px]."""
    from psstereo.metrics import height_error

    off = height_error(found, truth, mask, alignment="offset")
    middle = height_error(found, truth, mask, alignment="median-offset")
    return {"rmse": float(off.rmse), "median": float(middle.median_abs)}


def _places(folder: Path) -> list[Path]:
    """Return the folders of objects in a folder; there must be one."""
    from psstereo.errors import MissingFileError

    found = sorted(path.parent for path in folder.glob("*/depth_gt.npz"))
    if not found:
        raise MissingFileError(
            given=f"{folder} holds no folder with depth_gt.npz.",
            needed="A folder of normal maps, each in a folder of its own with normal_map.png, mask.png and K.txt.",
            remedy="Name it with --folder.",
        )
    return found


def _photographed(
    place: Path, methods: Mapping[str, "Integrator"], repeats: int, progress: "Progress"
) -> list["Record"]:
    """Integrate the normal map of an object, normal_map.png with mask.png, K.txt and depth_gt.npz."""
    from psstereo.bench import run_timed
    from psstereo.io import read_mask, read_normal_map
    from psstereo.io.camera_file import read_camera
    from psstereo.io.value_map import read_value_map
    from psstereo.metrics import height_error

    given = read_normal_map(place / "normal_map.png")
    shape = given.mask.shape[0], given.mask.shape[1]
    mask, camera = read_mask(place / "mask.png", shape), read_camera(place / "K.txt")
    truth = read_value_map(place / "depth_gt.npz", shape, what="true depth").values

    def score(answer: Any) -> dict[str, float]:
        return {"mean": float(height_error(answer.depth, truth, mask, alignment="scale").mean_abs)}

    work = {name: partial(method.integrate, given.normals, camera, mask=mask) for name, method in methods.items()}
    sizes = {"pixels": int(mask.sum())}
    return run_timed("depth", place.name, work, repeats=repeats, sizes=sizes, score=score, progress=progress)


def _table(records: list["Record"]) -> dict[str, Any]:
    """Return what is printed: errors, and time by pixel."""
    from psstereo.bench import summarise

    pixels = {record.problem: record.sizes["pixels"] for record in records}
    rows = [
        (
            one.problem,
            one.method,
            f"{one.seconds * 1e3:.1f} ms",
            f"{one.ratio:.2f}",
            f"{one.seconds / pixels[one.problem] * 1e9:.0f} ns",
            *(f"{one.error[key]:.3g}" if key in one.error else "" for key in ("rmse", "median", "mean", "iterations")),
        )
        for one in summarise(records, "poisson")
    ]
    columns = ("surface", "method", "time", "to poisson", "a pixel", "rmse", "median", "mean", "iterations")
    return {
        "title": "medians; errors in pixels, those of photographed objects in their unit",
        "rows": rows,
        "columns": columns,
    }
