"""``psstereo demo``: from nothing to a scored result in a moment."""

from pathlib import Path
from typing import Annotated, Any

import typer

from psstereo_cli.options import Json, Overwrite, Threads

__all__ = ["demo"]


def demo(
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder for the result; psstereo-demo if free.")
    ] = None,
    size: Annotated[int, typer.Option(min=16, max=4096, help="Width and height of the images [px].")] = 256,
    lights: Annotated[int, typer.Option(min=3, max=500, help="Number of suns.")] = 12,
    noise: Annotated[float, typer.Option(min=0, max=1, help="Noise as a share of full scale.")] = 0.002,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same scene.")] = 0,
    threads: Threads = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Make a synthetic capture of painted hills, reconstruct it, score it, and leave a result folder.

    Example: `psstereo demo --size 512 --lights 24`
    """
    from psstereo.depth import Poisson
    from psstereo.io.atomic import require_free
    from psstereo.io.result_folder import read_result
    from psstereo.pipeline import Options
    from psstereo_cli.commands.evaluate import score
    from psstereo_cli.commands.reconstruct import run_and_save
    from psstereo_cli.console import print_json, progress_bars
    from psstereo_cli.execution import available_threads, threaded
    from psstereo_cli.failure import NOT_CONVERGED
    from psstereo_cli.record import finite
    from psstereo_synth import demo_capture

    folder = out or _free_name(Path("psstereo-demo"))
    require_free(folder, overwrite=overwrite)
    count = threads or available_threads()
    capture, truth = demo_capture(size, lights=lights, noise=noise, seed=seed)
    with threaded(count) as over, progress_bars() as progress:
        options = Options(integrator=Poisson(threads=count))
        result, record = run_and_save(
            capture, options, folder, command="demo", overwrite=overwrite, over=over, progress=progress
        )
    scores = score(read_result(folder), truth, capture.mask)
    if as_json:
        print_json({**record, "scores": finite(scores), "out": str(folder)})
    else:
        _tell(folder, size, lights, scores)
    if not result.converged:
        raise typer.Exit(NOT_CONVERGED)


def _tell(folder: Path, size: int, lights: int, scores: dict[str, Any]) -> None:
    """Print what was made and how well it went."""
    from psstereo_cli.commands.evaluate import angle_rows, height_rows
    from psstereo_cli.console import print_table, say

    say(f"{lights} images of {size} × {size} pixels were made and reconstructed; the truth is known:")
    print_table("angular error of the normals", angle_rows(scores["normals"]))
    print_table("error of the heights", height_rows(scores["depth"]))
    say(f"Look at {folder / 'normals.png'}, {folder / 'depth.png'} and {folder / 'mesh.glb'}.")
    say("Next: psstereo reconstruct FOLDER -o OUT with photographs of your own.")


def _free_name(name: Path) -> Path:
    """Return the name, or the first numbered one that nothing has."""
    number = 1
    candidate = name
    while candidate.exists():
        number += 1
        candidate = name.with_name(f"{name.name}-{number}")
    return candidate
