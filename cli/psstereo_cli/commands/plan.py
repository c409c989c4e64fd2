"""``psstereo plan``: what a reconstruction would do, what it would leave out, and what is wrong with the capture."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import (
    Binning,
    Crop,
    FlatFrame,
    Format,
    Json,
    LensFile,
    Lights,
    LightsLayout,
    Mask,
    Overwrite,
    Register,
    ResponseCurve,
    RigOption,
    Threads,
)

if TYPE_CHECKING:
    from psstereo.plan.facts import Facts
    from psstereo.plan.plan import Plan

__all__ = ["plan"]


def plan(
    folder: Annotated[Path, typer.Argument(help="Folder with the photographs and a file that says where lights were.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", help="File for the plan, to be edited and run by psstereo reconstruct --plan FILE."
        ),
    ] = None,
    layout: Format = None,
    lights: Lights = None,
    lights_layout: LightsLayout = None,
    rig: RigOption = None,
    mask: Mask = None,
    gray: Annotated[str, typer.Option(help="How channels become one value, as for psstereo reconstruct.")] = "mean",
    ambient: Annotated[
        Path | None, typer.Option(help="Photograph without any of the lights, to subtract; `.npy` holds linear values.")
    ] = None,
    response: ResponseCurve = None,
    flat: FlatFrame = None,
    lens: LensFile = None,
    crop: Crop = None,
    register: Register = None,
    size: Binning = 1,
    normals_only: Annotated[bool, typer.Option("--normals-only", help="Leave depth and mesh out.")] = False,
    everything: Annotated[
        bool, typer.Option("--nothing-left-out", help="Plan every stage that applies, needed or not.")
    ] = False,
    threads: Threads = None,
    max_memory: Annotated[str | None, typer.Option(help="Bound for the arrays of the normals, such as 500MB.")] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Look at a capture, and say what a reconstruction would do and leave out, without solving.

    Example: `psstereo plan photos`

    Edit what it does, and run that: `psstereo plan photos -o plan.json`, then
    `psstereo reconstruct photos -o result --plan plan.json`
    """
    from psstereo.pipeline import plan_capture
    from psstereo.plan.plan_file import plan_record, write_plan
    from psstereo_cli.console import print_json, progress_bars, say
    from psstereo_cli.execution import available_threads, keep_freed_memory, parse_size, threaded
    from psstereo_cli.loading import load_capture
    from psstereo_cli.reading import ReadingOptions
    from psstereo_cli.record import finite

    keep_freed_memory()
    if out is not None:
        _require_place(out, overwrite=overwrite)
    count = threads or available_threads()
    options = _options(
        gray, normals_only=normals_only, everything=everything, memory=parse_size(max_memory), threads=count
    )
    with threaded(count) as over, progress_bars() as progress:
        capture, _ = load_capture(
            folder,
            layout=layout,
            lights=lights,
            lights_layout=lights_layout,
            rig=rig,
            mask=mask,
            ambient=ambient,
            reading=ReadingOptions(response=response, flat=flat, lens=lens, crop=crop, register=register, size=size),
            truth=False,
            over=over,
            progress=progress,
        )
        found = plan_capture(capture, options, over=over, progress=progress)
    if out is not None:
        write_plan(out, found)
    if as_json:
        print_json(finite({"capture": capture.name, **plan_record(found)}))
        return
    for note in capture.notes:
        say(f"note: {note}")
    _print(capture.name, found)
    if out is not None:
        say(f"The plan is in {out}. Next: psstereo reconstruct {folder} -o RESULT --plan {out}")


def _options(gray: str, *, normals_only: bool, everything: bool, memory: int | None, threads: int) -> Any:
    from psstereo.catalogue import choose
    from psstereo.pipeline import Options
    from psstereo.plan.options import AUTO
    from psstereo.stack import COLOUR_CHOICES
    from psstereo_cli.execution import parse_floats

    if "," not in gray:
        choose(dict.fromkeys(COLOUR_CHOICES), gray, "gray value")
    return Options(
        gray=parse_floats(gray, None, "gray") if "," in gray else gray,
        integrator=None if normals_only else AUTO,
        nothing_left_out=everything,
        max_memory=memory,
        workers=threads,
    )


def _require_place(out: Path, *, overwrite: bool) -> None:
    """Refuse a file that cannot be written, before the work."""
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
            needed="A file for the plan, in a folder that exists.",
            remedy="Choose another name with -o.",
        )


def _print(name: str, found: "Plan") -> None:
    from psstereo_cli.console import print_table, say

    print_table(f"{name}: facts", _facts(found.facts))
    print_table("plan", found.explain(), ("stage", "", "figure", "why"))
    for finding in found.facts.findings:
        print_table(
            f"{finding.severity}: {finding.name}",
            [("what", finding.sentence), ("remedy", finding.remedy), ("sure", f"{finding.confidence:.0%}")],
        )
    if found.facts.surveyed and not found.facts.findings:
        say("Nothing wrong with the capture was found.")
    cost = found.prediction
    if cost is None:
        say("Time and memory cannot be predicted: how many rounds lamps take shows only when it is done.")
        return
    parts = ", ".join(f"{part} {getattr(cost, part):.2f}" for part in ("read", "survey", "solve", "depth", "mesh"))
    say(f"Expected: {cost.seconds:.2f} s ({parts}), {cost.memory / 1e6:.0f} MB.")


def _facts(facts: "Facts") -> list[tuple[str, ...]]:
    """Return the facts that are known, as rows."""
    shares = {
        "saturated": facts.saturated,
        "in attached shadow": facts.shadowed,
        "too dark": facts.dark_outliers,
        "too bright": facts.bright_outliers,
    }
    told = ", ".join(f"{share:.2%} {what}" for what, share in shares.items() if share is not None)
    rows: list[tuple[str, str | None]] = [
        ("images", f"{facts.images} of {facts.width} × {facts.height}, {facts.channels} channels, {facts.bits} bit"),
        ("mask", f"{facts.pixels} pixels in {facts.components} pieces"),
        (
            "lights",
            None
            if facts.condition is None
            else f"rank {facts.rank}, condition {facts.condition:.3g}, cone of {facts.cone_deg:.0f}°",
        ),
        ("sample", f"{facts.surveyed} pixels: {told}" if facts.surveyed else None),
        ("noise", None if facts.noise is None else f"{facts.noise:.3%} of the albedo"),
        ("left by least squares", None if facts.residual is None else f"{facts.residual:.3%} of the albedo"),
        ("not Lambert's law", None if facts.misfit is None else f"at {facts.misfit:.1%} of the pixels"),
        (
            "ambient light",
            None
            if facts.ambient is None or facts.ambient_error is None
            else f"{facts.ambient:.2%} ± {facts.ambient_error:.2%} of the albedo",
        ),
        ("colours", None if facts.colour_spread is None else f"chromaticities spread by {facts.colour_spread:.3f}"),
        ("sudden turns", None if facts.turning is None else f"{facts.turning:.2%} of the steps"),
    ]
    return [(what, said) for what, said in rows if said is not None]
