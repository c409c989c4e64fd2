"""Suite forward: rendering against writing the same images as PNG, and against Mitsuba where it is installed."""

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.capture import Capture
    from psstereo.types import Map, Progress
    from psstereo_synth.scenes import Scene

__all__ = ["forward"]


def forward(
    repeats: int, size: str | None, lights: int, threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Render a height field in colour, 16 bit, with attached and cast shadows."""
    from psstereo.bench import run_timed
    from psstereo.errors import UnsupportedError
    from psstereo_synth.mitsuba_twin import MitsubaTwin
    from psstereo_synth.rendering import render

    width, height = dimensions(size or "612x512")
    scene = _scene(width, height, lights)
    capture = render(scene)[0].capture
    notes = []
    with tempfile.TemporaryDirectory(prefix="psstereo-bench-") as temporary:
        methods: dict[str, Callable[[], object]] = {
            "writing PNG, 1 thread": partial(_write, capture, Path(temporary)),
            "render, 1 thread": partial(render, scene),
        }
        if threads > 1:
            methods[f"render, {threads} threads"] = partial(render, scene, over=over)
        try:
            twin = MitsubaTwin(scene, fineness=1.0)
        except UnsupportedError as error:
            notes.append(f"Mitsuba was left out: {error}")
        else:
            twin.use_threads(threads)
            methods[f"Mitsuba direct, 1 sample, {threads} threads"] = partial(_twin_images, twin, scene)
        sizes = {"lights": lights, "width": width, "height": height, "threads": threads}
        records = run_timed("forward", "hills", methods, repeats=repeats, sizes=sizes, progress=progress)
    return records, "writing PNG, 1 thread", {"sizes": sizes, "notes": notes}


def _scene(width: int, height: int, lights: int) -> "Scene":
    from psstereo.lights import Directional
    from psstereo_synth.patterns import Constant
    from psstereo_synth.rigs import spiral
    from psstereo_synth.scenes import Material, Scene, Viewpoint
    from psstereo_synth.shapes import GaussianHills
    from psstereo_synth.view import centred_orthographic

    camera, pose = centred_orthographic((height, width))
    return Scene(
        name="bench",
        surface=GaussianHills(steepness=2.0),
        material=Material(albedo=Constant(albedo=(0.7, 0.6, 0.5))),
        viewpoints=(Viewpoint(camera=camera, pose=pose),),
        size=(height, width),
        lights=tuple(Directional.sun(d, radiance=2.0e7, solid_angle=6.8e-5) for d in spiral(lights)),
    )


def _write(capture: "Capture", folder: Path) -> None:
    """Write the images as the writers do, and nothing else."""
    from psstereo.io.pictures import write_png

    for i in range(len(capture.stack)):
        write_png(folder / f"{i}.png", capture.stack.frame(i))


def _twin_images(twin: Any, scene: "Scene") -> None:
    for light in scene.lights:
        twin.render(light, samples=1)
