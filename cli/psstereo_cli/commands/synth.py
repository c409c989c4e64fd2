"""``psstereo synth``: captures with known truth."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from psstereo_cli.options import Json, Overwrite, Threads

if TYPE_CHECKING:
    from collections.abc import Sequence

    from psstereo.io import Writer
    from psstereo.types import Map, Progress
    from psstereo_synth.meshes import Engine
    from psstereo_synth.rendering import Rendering
    from psstereo_synth.scenes import Scene
    from psstereo_synth.scenes.file import Changes

__all__ = ["synth"]


def synth(
    scene: Annotated[str | None, typer.Argument(help="Name of a scene (--list), or a scene file.")] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder to write.")] = None,
    layout: Annotated[
        str, typer.Option("--layout", help="capture, diligent, lp, sdm-unips, luces, near-ps or meshroom.")
    ] = "capture",
    size: Annotated[str | None, typer.Option("--size", help="Size of the images [px], 256 or 612x512.")] = None,
    lights: Annotated[int | None, typer.Option("--lights", min=1, help="Number of lights.")] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="The same seed gives the same bytes.")] = None,
    engine: Annotated[
        str, typer.Option("--engine", help="What finds the visible side of a mesh: auto, opengl or rays.")
    ] = "auto",
    threads: Threads = None,
    overwrite: Overwrite = False,
    listing: Annotated[bool, typer.Option("--list", help="List the named scenes.")] = False,
    template: Annotated[bool, typer.Option("--template", help="Print a commented scene file to start from.")] = False,
    as_json: Json = False,
) -> None:
    """Render a synthetic capture: images, lights, camera and mask, and the truth about them.

    Example: `psstereo synth hills -o hills --size 512 --lights 48 --layout diligent`
    """
    from psstereo.catalogue import choose
    from psstereo.io import WRITERS
    from psstereo_cli.console import print_json

    if template:
        from psstereo_synth.scenes.template import TEMPLATE

        typer.echo(TEMPLATE, nl=False)
        return
    if listing:
        _list(as_json=as_json)
        return
    if scene is None or out is None:
        raise typer.BadParameter("Name a scene and a folder with -o, or use --list or --template.", param_hint="SCENE")
    writer = choose(WRITERS, layout, "layout")
    found = _load(scene, _changes(size, lights, seed))
    record = _make(found, out, writer, engine=engine, threads=threads, overwrite=overwrite)
    if as_json:
        print_json(record)
    else:
        _tell(record)


def _changes(size: str | None, lights: int | None, seed: int | None) -> "Changes":
    from psstereo_cli.execution import parse_image_size
    from psstereo_synth.scenes.file import Changes

    return Changes(size=None if size is None else parse_image_size(size), lights=lights, seed=seed)


def _load(name: str, changes: "Changes") -> "Scene":
    """Return a named scene, or that of a file."""
    from psstereo_synth.gallery import GALLERY, gallery_scene
    from psstereo_synth.scenes.file import read_scene

    path = Path(name)
    if name not in GALLERY and (path.suffix.lower() == ".toml" or path.is_file()):
        return read_scene(path, changes)
    return gallery_scene(name, changes)


def _make(
    scene: "Scene", out: Path, writer: "Writer", *, engine: str, threads: int | None, overwrite: bool
) -> dict[str, Any]:
    """Render, write, and return the record."""
    from time import perf_counter

    from psstereo_cli.console import progress_bars
    from psstereo_cli.execution import available_threads, threaded
    from psstereo_cli.record import finite
    from psstereo_synth.rendering import render

    if not overwrite:  # before the work; what may be replaced is checked once there is something in its place
        _require_empty(out)
    with threaded(threads or available_threads()) as over, progress_bars() as progress:
        started = perf_counter()
        renderings = render(scene, engine=cast("Engine", engine), over=over, progress=progress)
        rendered = perf_counter()
        folders, left_out = _write(renderings, out, writer, overwrite=overwrite, over=over, progress=progress)
        written = perf_counter()
    return dict(
        finite(
            {
                "command": "synth",
                "scene": scene.name,
                "summary": scene.summary,
                "layout": writer.name,
                "out": [str(folder) for folder in folders],
                "images": len(scene.lights),
                "size": [scene.size[1], scene.size[0]],
                "seed": scene.seed,
                "lights_distant": renderings[0].capture.rig.all_distant,
                "seconds": {"render": rendered - started, "write": written - rendered},
                "steps": _steps(renderings[0]),
                "not_written": list(left_out),
            }
        )
    )


def _write(
    renderings: "Sequence[Rendering]",
    out: Path,
    writer: "Writer",
    *,
    overwrite: bool,
    over: "Map",
    progress: "Progress",
) -> tuple[list[Path], tuple[str, ...]]:
    """Write one capture into a folder, several into folders in it, all of them or none; return what was left out."""
    from psstereo.io import write_capture
    from psstereo.io.atomic import new_folder

    def write(rendering: "Rendering", folder: Path, *, replace: bool) -> tuple[str, ...]:
        capture, truth = rendering.capture, rendering.truth
        return write_capture(capture, folder, writer.name, truth=truth, overwrite=replace, over=over, progress=progress)

    if len(renderings) == 1:
        return [out], write(renderings[0], out, replace=overwrite)
    parts = {f"view_{number:02d}": rendering for number, rendering in enumerate(renderings, 1)}
    for rendering in renderings:
        writer.check(rendering.capture, rendering.truth)
    names = {f"{part}/{name}" for part, one in parts.items() for name in writer.file_names(one.capture, one.truth)}
    left_out: tuple[str, ...] = ()
    with new_folder(out, overwrite=overwrite, names=names) as work:
        for part, rendering in parts.items():
            left_out = write(rendering, work / part, replace=False)
    return [out / part for part in parts], left_out


def _require_empty(folder: Path) -> None:
    from psstereo.errors import ExistingResultError

    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise ExistingResultError(
            given=f"{folder} exists already.",
            needed="A new or empty folder, so that nothing of yours is lost.",
            remedy="Choose another name with -o, or add --overwrite to replace an earlier capture of the same files.",
        )


def _steps(rendering: "Rendering") -> list[dict[str, Any]]:
    return [{"name": step.name, "done": step.done, "reason": step.reason} for step in rendering.steps]


def _list(*, as_json: bool) -> None:
    from psstereo_cli.console import print_json, print_table
    from psstereo_synth.gallery import summaries

    found = summaries()
    if as_json:
        print_json(found)
    else:
        print_table("scenes, from easy to cruel", list(found.items()), ("name", "what it tests"))


def _tell(record: dict[str, Any]) -> None:
    """Print what was made and what was left out."""
    from psstereo_cli.console import print_table, say

    seconds = record["seconds"]
    rows = [(step["name"], "done" if step["done"] else "left out", step["reason"]) for step in record["steps"]]
    print_table(f"{record['scene']}: {record['summary']}", rows, ("step", "", "why"))
    width, height = record["size"]
    say(
        f"{record['images']} images of {width} × {height} pixels: {seconds['render']:.2f} s to render, "
        f"{seconds['write']:.2f} s to write."
    )
    for sentence in record["not_written"]:
        say(sentence)
    for folder in record["out"] if record["lights_distant"] else ():
        say(f"Next: psstereo reconstruct {folder} -o RESULT && psstereo evaluate RESULT {folder}")
