"""``psstereo reconstruct``: photographs to normals, albedo, depth and mesh."""

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
    LightsLayout,
    Mask,
    Overwrite,
    PriorFile,
    PriorSigma,
    PriorUnit,
    Register,
    ResponseCurve,
    RigOption,
    Threads,
)

if TYPE_CHECKING:
    from psstereo.capture import Capture
    from psstereo.normals import NormalSolver
    from psstereo.normals.light_choice import LightChoice
    from psstereo.normals.strength_choice import StrengthChoice
    from psstereo.pipeline import Options, Reconstruction
    from psstereo.plan.plan import Plan

__all__ = ["reconstruct", "run_and_save"]


def reconstruct(
    folder: Annotated[Path, typer.Argument(help="Folder with the photographs and a file that says where lights were.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the result.")],
    layout: Format = None,
    lights: Annotated[
        str | None,
        typer.Option(
            help="File of light directions to use instead of the folder's own (text, .lp, .npy, .mat); or refine: the"
            " folder's own, refined from the images; or unknown: found from the images alone."
        ),
    ] = None,
    lights_layout: LightsLayout = None,
    rig: RigOption = None,
    ambiguity: Annotated[
        str | None,
        typer.Option(
            help="What tells unknown lights apart: maxima (places brightest because they face a light), entropy (few"
            " colours), or strengths (those given are true, equal if none are); maxima if not given."
        ),
    ] = None,
    relief: Annotated[
        str | None,
        typer.Option(
            help="Under unknown lights a relief and its inverse look the same: convex or concave; convex if not given."
        ),
    ] = None,
    light_doubt: Annotated[
        float | None, typer.Option(help="How far lights to be refined may be off, in degrees; 3 if not given.")
    ] = None,
    mask: Mask = None,
    gray: Annotated[
        str,
        typer.Option(
            help="mean, bt601, bt709, r, g, b, or weights such as 0.3,0.6,0.1; chroma (least noise for each pixel's"
            " colour), specular-free (coloured objects, without highlights), or per-channel (coloured albedo)."
        ),
    ] = "mean",
    ambient: Annotated[
        Path | None,
        typer.Option(
            help="Photograph without any of the lights, to subtract; `.npy` holds linear pixel values. Without one,"
            " `--solver ambient` finds the level of each pixel."
        ),
    ] = None,
    response: ResponseCurve = None,
    flat: FlatFrame = None,
    lens: LensFile = None,
    crop: Crop = None,
    register: Register = None,
    size: Binning = 1,
    clip: Annotated[
        float | None, typer.Option(help="Upper bound for brightness over light strength; published baselines use 1.")
    ] = None,
    gate: Annotated[
        str | None, typer.Option(help="Observations left out: none, shadow, saturation, or auto for both.")
    ] = None,
    valid_range: Annotated[
        str | None, typer.Option(help="Shares of full scale such as 0.01,0.98; values outside are left out.")
    ] = None,
    solver: Annotated[
        str | None,
        typer.Option(help="Method for the normals, from `psstereo solvers`; chosen by the images if not given."),
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option(help="Option of the solver, KEY=VALUE, as often as needed; `psstereo solvers NAME` lists them."),
    ] = None,
    strengths: Annotated[
        str,
        typer.Option(
            help="Strengths of the lights: given, checked (given, and compared with what the images tell), equal, or"
            " unknown (found from the images)."
        ),
    ] = "given",
    verdicts: Annotated[
        bool,
        typer.Option(
            "--verdicts",
            help="Write what was made of each observation: verdicts.npz, and pictures to paint in (white used, blue"
            " shadow, yellow highlight, magenta dark outlier, red unusable, gray not needed, black outside).",
        ),
    ] = False,
    observation_mask: Annotated[
        Path | None,
        typer.Option(
            help="Observations to use: verdicts.npz, a .npy file, or the folder of painted verdicts; white and gray"
            " take part."
        ),
    ] = None,
    distance: Annotated[
        float | None,
        typer.Option(help="Under near lamps, where to begin to search for the object's distance, in their unit."),
    ] = None,
    normals_only: Annotated[bool, typer.Option("--normals-only", help="Leave depth and mesh out.")] = False,
    integrator: Annotated[
        str | None, typer.Option(help="Method for the depth; chosen by what the normals show if not given.")
    ] = None,
    plan: Annotated[
        Path | None,
        typer.Option(help="Plan to run, as `psstereo plan` writes it, edited perhaps; it says how everything is done."),
    ] = None,
    prior: PriorFile = None,
    prior_sigma: PriorSigma = None,
    prior_unit: PriorUnit = None,
    threads: Threads = None,
    max_memory: Annotated[
        str | None,
        typer.Option(
            help="Bound for the arrays of the normals, such as 500MB; samples then wait in a temporary file, and two"
            " threads are used unless told otherwise."
        ),
    ] = None,
    no_report: Annotated[
        bool,
        typer.Option("--no-report", help="Leave report.html out."),
    ] = False,
    diagnose: Annotated[
        bool,
        typer.Option(
            "--diagnose", help="Look for what is wrong with the capture too, for the report; psstereo plan always does."
        ),
    ] = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Recover normals, albedo, depth and mesh from photographs under several lights.

    Example: `psstereo reconstruct photos -o result --mask photos/mask.png`

    With a method and its options: `psstereo reconstruct photos -o result --solver least-squares --option gate=none`

    With lamps or exposures of unknown strength: `psstereo reconstruct photos -o result --strengths unknown`

    With lights that were calibrated with another object: `psstereo reconstruct photos -o result --rig rig.toml`

    Without knowing where the lights were: `psstereo reconstruct photos -o result --lights unknown`

    Look at what will be done, change it, and run that: `psstereo plan photos -o plan.json`, then
    `psstereo reconstruct photos -o result --plan plan.json`

    Look at what was left out, paint in it, and use that: `psstereo reconstruct photos -o first --verdicts`, then
    `psstereo reconstruct photos -o second --observation-mask first/verdicts`
    """
    from dataclasses import replace

    from psstereo.io.atomic import require_free
    from psstereo.io.verdict_files import read_observation_mask
    from psstereo.plan.plan_file import read_plan
    from psstereo_cli.console import progress_bars
    from psstereo_cli.execution import available_threads, keep_freed_memory, parse_size, threaded
    from psstereo_cli.known_depth import load_prior
    from psstereo_cli.loading import load_capture
    from psstereo_cli.reading import ReadingOptions
    from psstereo_cli.telling import tell

    keep_freed_memory()
    require_free(out, overwrite=overwrite)  # told before the work, not after it
    memory = parse_size(max_memory)
    # Every thread needs room of its own; where that is short, two are enough unless more are asked for.
    count = threads or (available_threads() if memory is None else min(2, available_threads()))
    planned = None if plan is None else read_plan(plan)
    choice, lights_file = _lights(lights, ambiguity, relief, light_doubt)
    options = _options(gray, clip, gate, valid_range, integrator, memory, count, normals_only=normals_only)
    options = replace(
        options,
        solver=_solver(solver, option or [], gate),
        strengths=_strengths(strengths),
        verdicts=verdicts,
        lights=choice,
        distance=distance,
    )
    with threaded(count) as over, progress_bars() as progress:
        capture, _ = load_capture(
            folder,
            layout=layout,
            lights=lights_file,
            unknown_lights=lights == "unknown" and ambiguity != "strengths",
            lights_layout=lights_layout,
            rig=rig,
            mask=mask,
            ambient=ambient,
            reading=ReadingOptions(response=response, flat=flat, lens=lens, crop=crop, register=register, size=size),
            truth=False,
            over=over,
            progress=progress,
        )
        if observation_mask is not None:
            mask_of_observations = read_observation_mask(observation_mask, capture.stack.shape[:3])
            options = replace(options, observation_mask=mask_of_observations)
        shape = capture.stack.shape[1:3]
        known, notes = load_prior(prior, shape, capture.camera, sigma=prior_sigma, unit=prior_unit)
        options, capture = replace(options, prior=known), replace(capture, notes=(*capture.notes, *notes))
        result, record = run_and_save(
            capture,
            options,
            out,
            command="reconstruct",
            plan=planned,
            report=not no_report,
            diagnose=diagnose,
            overwrite=overwrite,
            over=over,
            progress=progress,
        )
    tell(out, record, result, as_json=as_json)


def _strengths(name: str) -> "StrengthChoice":
    """Look up whose strengths are wanted."""
    from psstereo.catalogue import choose
    from psstereo.normals.strength_choice import StrengthChoice

    return choose({one.value: one for one in StrengthChoice}, name, "choice of strengths")


def _lights(
    lights: str | None, ambiguity: str | None, relief: str | None, doubt: float | None
) -> "tuple[LightChoice, Path | None]":
    """Return whose lights are wanted and the file that was named; an unknown name is told before any image is read."""
    from math import radians

    from psstereo.normals.light_choice import LightChoice, LightSource
    from psstereo.normals.refine_lights import RefineOptions
    from psstereo.normals.uncalibrated import UncalibratedOptions

    named = lights in (LightSource.REFINED.value, LightSource.UNKNOWN.value)
    choice = LightChoice(
        source=LightSource(lights) if named else LightSource.GIVEN,
        ambiguity=ambiguity,
        relief=relief,
        doubt=None if doubt is None else radians(doubt),
    )
    words: Any = {"ambiguity": ambiguity, "relief": relief}
    UncalibratedOptions(**{name: word for name, word in words.items() if word is not None})
    if choice.doubt is not None:
        RefineOptions(doubt=choice.doubt)
    return choice, None if lights is None or named else Path(lights)


def _solver(name: str | None, words: list[str], gate: str | None) -> "NormalSolver[Any] | None":
    """Build the solver that was named; an unknown option is told before any image is read."""
    from psstereo.catalogue import choose
    from psstereo.errors import OptionError
    from psstereo.method_options import configure
    from psstereo.normals import NORMAL_SOLVERS
    from psstereo_cli.settings import parse_settings

    if name is None:
        if words:
            raise OptionError(
                given=f"There is the option {words[0]} and no solver.",
                needed="Each solver has options of its own.",
                remedy="Name it with --solver; psstereo solvers lists them.",
            )
        return None
    kind = choose(NORMAL_SOLVERS, name, "solver")
    settings = parse_settings(words, example="gate=none", remedy=f"psstereo solvers {name} lists the keys.")
    if gate is not None and "gate" in {key.strip() for key in settings}:
        raise OptionError(
            given="The gate was given twice, by --gate and by --option.", needed="One.", remedy="Leave one out."
        )
    return configure(kind, settings)


def _options(
    gray: str,
    clip: float | None,
    gate: str | None,
    valid_range: str | None,
    integrator: str | None,
    max_memory: int | None,
    threads: int,
    *,
    normals_only: bool,
) -> "Options":
    """Look names up; an unknown one is told before any image is read."""
    from psstereo.catalogue import choose
    from psstereo.depth import INTEGRATORS
    from psstereo.errors import OptionError
    from psstereo.normals import GATES
    from psstereo.pipeline import Options
    from psstereo.plan.options import AUTO
    from psstereo.stack import COLOUR_CHOICES
    from psstereo_cli.execution import parse_floats

    if clip is not None and not clip > 0:
        raise OptionError(
            given=f"The clip is {clip:g}.", needed="A number above zero.", remedy="Published baselines use 1."
        )
    if "," not in gray:
        choose(dict.fromkeys(COLOUR_CHOICES), gray, "gray value")
    method = AUTO if integrator is None else choose(INTEGRATORS, integrator, "integrator")(threads=threads)
    low_high = None if valid_range is None else parse_floats(valid_range, 2, "valid range")
    return Options(
        gate=None if gate is None else choose(GATES, gate, "gate"),
        integrator=None if normals_only else method,
        gray=parse_floats(gray, None, "gray") if "," in gray else gray,
        clip=clip,
        valid_range=None if low_high is None else (low_high[0], low_high[1]),
        max_memory=max_memory,
        workers=threads,
    )


def run_and_save(
    capture: "Capture",
    options: "Options",
    out: Path,
    *,
    command: str,
    plan: "Plan | None" = None,
    report: bool = True,
    diagnose: bool = False,
    overwrite: bool,
    over: Any,
    progress: Any,
) -> tuple["Reconstruction", dict[str, Any]]:
    """Reconstruct a capture and write its result folder.

    Parameters
    ----------
    capture : Capture
        What was measured.
    options : Options
        How.
    out : Path
        Where the result goes.
    command : str
        For the record.
    plan : Plan, optional
        What to do, if it is not to be decided.
    report : bool
        Whether to write the report too.
    diagnose : bool
        Whether to look for what is wrong with the capture.
    overwrite : bool
        Whether an earlier result may be replaced.
    over : map-like
        Executes the work.
    progress : callable
        Told how far it is.

    Returns
    -------
    Reconstruction, dict
        The result and its record.
    """
    from dataclasses import replace

    from psstereo.io.result_folder import write_result
    from psstereo.pipeline import reconstruct as run
    from psstereo.plan.plan_file import plan_record
    from psstereo_cli.record import run_record
    from psstereo_cli.reporting import run_report

    options = replace(options, views=report, diagnose=diagnose)
    result = run(capture, options, plan=plan, over=over, progress=progress)
    record = run_record(command, capture, result, {"plan": plan_record(result.plan)})
    page = run_report(capture, result) if report else None
    write_result(
        out, result.normals, depth=result.depth, mesh=result.mesh, record=record, report=page, overwrite=overwrite
    )
    return result, record
