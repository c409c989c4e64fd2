"""``psstereo bench``: error against run time, and what reading costs."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import Json, Overwrite, Threads

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.types import Map, Progress

__all__ = ["bench"]


def bench(
    suite: Annotated[
        str,
        typer.Argument(
            help="accuracy: error and time of the gates on scenes with known truth; reading: a folder of 16-bit images"
            " against decoding its files alone, with the memory taken."
        ),
    ] = "accuracy",
    repeats: Annotated[int, typer.Option(min=1, max=100, help="Rounds; medians are reported.")] = 5,
    size: Annotated[
        str | None, typer.Option(help="Size of the images, WIDTHxHEIGHT; 256x256 for accuracy, 612x512 for reading.")
    ] = None,
    lights: Annotated[int, typer.Option(min=3, max=500, help="Images of the suite reading.")] = 96,
    threads: Threads = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="File for the records, one JSON object a line.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Measure, and print medians and ratios within this one run.

    Example: `psstereo bench reading --repeats 7`
    """
    from psstereo.bench import summarise, write_records
    from psstereo.catalogue import choose
    from psstereo_cli.console import print_json, progress_bars
    from psstereo_cli.execution import available_threads, threaded

    run = choose({"accuracy": _accuracy, "reading": _reading}, suite, "suite")
    if out is not None:
        _require_place(out, overwrite=overwrite)
    count = threads or available_threads()
    with threaded(count) as over, progress_bars() as progress:
        records, baseline, facts = run(repeats, size, lights, count, over, progress)
    summaries = summarise(records, baseline)
    if out is not None:
        write_records(out, records)
    if as_json:
        rows = [
            {"problem": s.problem, "method": s.method, "seconds": s.seconds, "ratio": s.ratio, "error": dict(s.error)}
            for s in summaries
        ]
        print_json({"suite": suite, "baseline": baseline, "threads": count, "repeats": repeats, "rows": rows, **facts})
        return
    _print(suite, baseline, summaries, facts, count, repeats)


def _require_place(out: Path, *, overwrite: bool) -> None:
    """Refuse a file that cannot be written, before anything is measured."""
    from psstereo.errors import ExistingResultError, MissingFileError

    if out.is_file() and not overwrite:
        raise ExistingResultError(
            given=f"{out} exists.",
            needed="It is not replaced without being asked for.",
            remedy="Add --overwrite, or choose another name with -o.",
        )

    if out.is_dir() or not out.absolute().parent.is_dir():
        raise MissingFileError(
            given=f"{out} {'is a folder' if out.is_dir() else 'lies in a folder that does not exist'}.",
            needed="A file for the records, in a folder that exists.",
            remedy="Choose another name with -o.",
        )


def _accuracy(
    repeats: int, size: str | None, _lights: int, _threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    from psstereo.bench import run_solvers
    from psstereo.errors import OptionError
    from psstereo.normals import GATES, LeastSquares
    from psstereo_synth.problems import lambertian_problems

    width, height = _parse_dimensions(size or "256x256")
    if width != height:
        raise OptionError(
            given=f"The size is {size!r}.", needed="The scenes of accuracy are squares.", remedy=f"Say {width}x{width}."
        )
    methods = {f"least-squares, {name}": LeastSquares(gate=GATES[name]) for name in ("none", "auto")}
    problems = lambertian_problems(width)
    records = run_solvers("accuracy", problems, methods, repeats=repeats, over=over, progress=progress)
    return records, "least-squares, none", {}


def _reading(
    repeats: int, size: str | None, lights: int, threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    from psstereo.bench import run_timed
    from psstereo.io import Choices, read_capture
    from psstereo.normals import GATES, LeastSquares, estimate_normals

    width, height = _parse_dimensions(size or "612x512")
    with tempfile.TemporaryDirectory(prefix="psstereo-bench-") as temporary:
        folder = Path(temporary) / "capture"
        _write_folder(folder, width, height, lights, progress)
        images = Choices(truth=False)
        files = sorted(folder.glob("[0-9]*.png"))

        def estimate(gate: str) -> object:
            return estimate_normals(read_capture(folder, choices=images)[0], LeastSquares(gate=GATES[gate]), over=over)

        methods: dict[str, Callable[[], object]] = {
            "decoding alone": partial(_decode, files, over),
            "library, gate none": partial(estimate, "none"),
            "library, gate auto": partial(estimate, "auto"),
            "command, normals only": partial(_command, folder, Path(temporary) / "n", threads, "--normals-only"),
            "command, with depth and mesh": partial(_command, folder, Path(temporary) / "d", threads),
        }
        pixels = int(read_capture(folder)[0].effective_mask.sum())
        sizes = {"lights": lights, "width": width, "height": height, "pixels": pixels, "threads": threads}
        records = run_timed("reading", "folder", methods, repeats=repeats, sizes=sizes, progress=progress)
        memory = {"in memory": _growth(folder, threads), "in 30 MB": _growth(folder, threads, 30_000_000)}
    return records, "decoding alone", {"sizes": sizes, "memory": memory}


def _write_folder(folder: Path, width: int, height: int, lights: int, progress: "Progress") -> None:
    """Write 16-bit colour images of noisy painted hills, so that they compress about as photographs do."""
    import numpy as np

    from psstereo.forward import lambertian_images
    from psstereo.io import write_diligent
    from psstereo.lights import Rig
    from psstereo_synth import checker, expose, hills, spiral

    surface, directions = hills(width, height), spiral(lights)
    albedo = checker((height, width), tint=True) * 0.8
    strengths = np.random.default_rng(0).uniform(0.8, 1.2, (lights, 3))

    def frames() -> Any:
        for i in range(lights):
            rig = Rig.distant(directions[i : i + 1], strengths[i : i + 1])
            image = lambertian_images(surface.normals, albedo, rig) * surface.mask[..., None]
            progress("writing images", i + 1, lights)
            yield expose(image, bits=16, noise=0.002, seed=i)[0]

    write_diligent(
        folder,
        images=frames(),
        directions=directions,
        intensities=strengths,
        mask=surface.mask,
        normals=surface.normals,
    )


def _decode(files: list[Path], over: "Map") -> None:
    """Read and decode files as the simplest of scripts would."""
    import cv2
    import numpy as np

    for _ in over(lambda path: cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED) is not None, files):
        pass


def _command(folder: Path, out: Path, threads: int, *options: str) -> None:
    words = ["reconstruct", str(folder), "-o", str(out), "--threads", str(threads), "--overwrite", *options]
    _run_python("psstereo_cli", *words)


def _growth(folder: Path, threads: int, bound: int | None = None) -> dict[str, Any]:
    words = [str(folder), str(threads), *([] if bound is None else [str(bound)])]
    measured: dict[str, Any] = json.loads(_run_python("psstereo.bench.growth", *words))
    grown = measured["grown"]
    return {**measured, "grown_over_samples": None if grown is None else grown / measured["samples"]}


def _run_python(module: str, *words: str) -> str:
    """Run a module in a process of its own and return what it prints; a failure is told with its last words."""
    from psstereo.errors import InputError

    done = subprocess.run([sys.executable, "-m", module, *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError(
            given=f"The measured process ended with {done.returncode}: {done.stderr.strip().splitlines()[-1:]}.",
            needed="It must run through.",
            remedy="Try other sizes, or run the command by hand to see more.",
        )
    return done.stdout


def _parse_dimensions(text: str) -> tuple[int, int]:
    from psstereo.errors import OptionError

    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and 8 <= int(part) <= 20000 for part in parts):
        raise OptionError(
            given=f"The size is {text!r}.",
            needed="WIDTHxHEIGHT in pixels, from 8 to 20000 each.",
            remedy="Write, for example, 612x512.",
        )
    return int(parts[0]), int(parts[1])


def _print(suite: str, baseline: str, summaries: Any, facts: dict[str, Any], threads: int, repeats: int) -> None:
    from psstereo_cli.console import print_table, say

    errors = ("mean_deg", "median_deg", "max_deg")
    rows = [
        (
            s.problem,
            s.method,
            f"{s.seconds * 1e3:.1f} ms",
            f"{s.ratio:.3f}",
            *(f"{s.error[k]:.3g}°" for k in errors if s.error),
        )
        for s in summaries
    ]
    with_error = any(s.error for s in summaries)
    columns = ("problem", "method", "time", "ratio", *(("mean", "median", "largest") if with_error else ()))
    print_table(f"suite {suite}: medians of {repeats} rounds on {threads} threads", rows, columns)
    say(f"The ratio is the time over that of «{baseline}» in the same round.")
    times = {s.method: s.seconds for s in summaries}
    for method in ("command, normals only", "command, with depth and mesh"):
        if method in times:
            say(f"{method}: decoding + {times[method] - times[baseline]:.2f} s")
    for name, grown in facts.get("memory", {}).items():
        if grown["grown"] is not None:
            say(
                f"memory grown, samples {name}: {grown['grown'] / 1e6:.0f} MB,"
                f" {grown['grown_over_samples']:.2f} of the masked stack as float32"
            )
