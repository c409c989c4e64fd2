"""``psstereo integrate``: a normal map of any origin to depth and mesh."""

from pathlib import Path
from typing import Annotated, Any

import typer

from psstereo_cli.options import Json, Overwrite, PriorFile, PriorSigma, PriorUnit, Threads

__all__ = ["integrate"]


def integrate(
    normals: Annotated[
        Path, typer.Argument(help="Normal map: PNG of 8 or 16 bits, TIFF, EXR, .npy, .npz or .mat, from any program.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the result.")],
    convention: Annotated[
        str, typer.Option(help="Axes of the normal map: opengl (green up), directx, opencv, meshroom, bini.")
    ] = "opengl",
    variable: Annotated[
        str | None, typer.Option(help="Name of the array in .npz and .mat files that hold several.")
    ] = None,
    mask: Annotated[
        str | None,
        typer.Option(
            help="Image that is white where depth is wanted. Without one every pixel is, and those that have no normal"
            " are flagged."
        ),
    ] = None,
    matrix: Annotated[
        str | None,
        typer.Option(
            "--K",
            help="The camera is a pinhole: a file with its 3 × 3 matrix (text, .npy, .npz, .mat), or fx,fy,cx,cy,skew"
            " in pixels, the skew if there is any. Without it the projection is parallel.",
        ),
    ] = None,
    pixel_size: Annotated[
        float | None,
        typer.Option(help="Under parallel projection, length of a pixel on the surface, in mm; heights are then too."),
    ] = None,
    distance: Annotated[
        float | None,
        typer.Option(help="For a pinhole, median distance along the optical axis in mm; distances are then too."),
    ] = None,
    prior: PriorFile = None,
    prior_sigma: PriorSigma = None,
    prior_unit: PriorUnit = None,
    weights: Annotated[
        Path | None,
        typer.Option(
            help="Uncertainty of each normal in degrees, such as the uncertainty.npy of a result; pixels weigh by its"
            " inverse square. Unknown ones count as the worst that is known, infinite ones not at all."
        ),
    ] = None,
    integrator: Annotated[
        str,
        typer.Option(help="Method: poisson, discontinuity (depth jumps), l1, bilateral, or frankot-chellappa."),
    ] = "poisson",
    option: Annotated[
        list[str] | None,
        typer.Option(help="Option of the integrator, KEY=VALUE, as often as needed; an unknown key lists them."),
    ] = None,
    relief: Annotated[
        str | None,
        typer.Option(
            help="Write relief.tif too: heights of wavelengths from SHORTEST to LONGEST, such as 0,5, in the unit of"
            " the depth, straight from the slopes; for inscriptions and tool marks."
        ),
    ] = None,
    curvature: Annotated[
        float | None,
        typer.Option(min=0, help="Write curvature.npz too, smoothed over so many pixels; 0 for none."),
    ] = None,
    max_memory: Annotated[
        str | None,
        typer.Option(
            help="Bound for the arrays, such as 2GB. A normal map that needs more is integrated in tiles from file to"
            " file: an .npy file, integrator poisson; only the depth is written, without a report."
        ),
    ] = None,
    threads: Threads = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Leave report.html out.")] = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Integrate a normal map of any origin to depth and mesh.

    Example: `psstereo integrate normals.png -o result --mask mask.png --pixel-size 0.05`

    For a pinhole camera at half a metre: `psstereo integrate normals.exr -o result --K K.txt --distance 500`

    With a few measured points: `psstereo integrate normals.png -o result --K K.txt --prior points.txt --prior-unit mm`

    An inscription's relief, without the stone's shape: `psstereo integrate normals.png -o result --relief 0,60`

    With depth jumps: `psstereo integrate normals.png -o result --integrator discontinuity --option rounds=5`
    """
    import time

    from psstereo.depth.given_normals import integrate_normals
    from psstereo.io import read_mask, read_normal_map
    from psstereo.io.atomic import new_folder, require_free
    from psstereo.io.result_folder import write_integration
    from psstereo.io.uncertainty_file import read_uncertainty
    from psstereo_cli.cameras import described_camera
    from psstereo_cli.console import progress_bars
    from psstereo_cli.derived import derive
    from psstereo_cli.execution import available_threads, parse_size
    from psstereo_cli.inputs import require_outside
    from psstereo_cli.integration_record import integration_record, warnings_about
    from psstereo_cli.known_depth import load_prior
    from psstereo_cli.large import integrate_large, too_large
    from psstereo_cli.reporting import integration_report
    from psstereo_cli.settings import build_integrator

    require_free(out, overwrite=overwrite)  # told before the work, not after it
    require_outside(out, normals, mask, matrix, prior, weights)
    count = threads or available_threads()
    method = build_integrator(integrator, option or [], threads=count)
    camera = described_camera(matrix, pixel_size)
    bound = parse_size(max_memory)
    if bound is not None and too_large(normals, bound):
        unused = {"--weights": weights, "--prior": prior, "--distance": distance, "--relief": relief}
        unused |= {"--curvature": curvature, "--mask": None if mask == "none" else mask, "--variable": variable}
        unused |= {"--prior-sigma": prior_sigma, "--prior-unit": prior_unit}
        record, converged = integrate_large(
            normals, out, camera, method, convention, bound, unused=unused, overwrite=overwrite
        )
        _tell(out, record, converged=converged, as_json=as_json)
        return
    started = time.perf_counter()
    given = read_normal_map(normals, convention=convention, variable=variable)
    shape = given.mask.shape[0], given.mask.shape[1]
    wanted = None if mask in (None, "none") else read_mask(Path(str(mask)), shape)
    uncertainty = None if weights is None else read_uncertainty(weights, shape)
    known, notes = load_prior(prior, shape, camera, sigma=prior_sigma, unit=prior_unit)
    reading = time.perf_counter() - started
    with progress_bars() as progress:
        result = integrate_normals(
            given.normals,
            camera,
            method,
            mask=wanted,
            uncertainty=uncertainty,
            prior=known,
            distance=distance,
            progress=progress,
        )
        derived = derive(result, camera, relief=relief, curvature=curvature, threads=count, progress=progress)
    record = integration_record(
        result,
        camera,
        name=normals.name,
        convention=convention,
        mask=None if wanted is None else str(mask),
        notes=(*given.notes, *notes),
        warnings=warnings_about(result.normals, camera, convention),
        seconds=reading,
    )
    page = None if no_report else integration_report(result, derived, record)
    with new_folder(out, overwrite=overwrite) as work:  # so that the page is there as soon as the rest is
        write_integration(
            work,
            result.normals,
            result.flags,
            depth=result.depth,
            mesh=result.mesh,
            derived=derived,
            record=record,
        )
        if page is not None:
            (work / "report.html").write_text(page, encoding="utf-8", errors="backslashreplace")
    _tell(out, record, converged=result.depth.outcome.converged, as_json=as_json)


def _tell(out: Path, record: dict[str, Any], *, converged: bool, as_json: bool) -> None:
    """Print what was used and what came out, and leave with 4 if the iteration did not converge."""
    from psstereo_cli.console import print_json, print_table, say
    from psstereo_cli.failure import NOT_CONVERGED

    if as_json:
        print_json({**record, "out": str(out)})
    else:
        for note in record["input"]["notes"]:
            say(f"note: {note}")
        rows = [
            (step["name"], f"{step['seconds']:.2f} s" if step["done"] else "left out", step["reason"])
            for step in record["steps"]
        ]
        print_table(f"{record['input']['name']}: what was done", rows, ("step", "time", "why"))
        print_table("result", _figures(record))
        say(f"The result is in {out}.")
    if not converged:
        raise typer.Exit(NOT_CONVERGED)


def _figures(record: dict[str, Any]) -> list[tuple[str, ...]]:
    depth, flags = record["depth"], record["normals"]["flags"]
    low, high = depth["range"]
    return [
        *(("warning", warning) for warning in record["input"]["warnings"]),
        ("depth", f"{depth['kind']} [{depth['unit']}] from {low:.4g} to {high:.4g}. {depth['outcome_text']}"),
        ("what stays free", depth["free_constants"]["sentence"]),
        *(("left out: " + name.replace("_", " "), f"{count} pixels") for name, count in _left_out(depth)),
        *((f"flag {name}", f"{count} pixels") for name, count in flags.items() if name != "OUTSIDE_MASK"),
    ]


def _left_out(depth: dict[str, Any]) -> list[tuple[str, int]]:
    return [(name, count) for name, count in depth["left_out"].items() if count]
