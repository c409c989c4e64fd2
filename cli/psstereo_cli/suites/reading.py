"""Suite reading: a folder of 16-bit images against decoding its files alone, with the memory taken."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.types import Map, Progress

__all__ = ["reading"]


def reading(
    repeats: int, size: str | None, lights: int, threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Read a folder by the library and by the command, and decode it alone."""
    from psstereo.bench import run_timed
    from psstereo.io import Choices, read_capture
    from psstereo.normals import GATES, LeastSquares, estimate_normals

    width, height = dimensions(size or "612x512")
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
