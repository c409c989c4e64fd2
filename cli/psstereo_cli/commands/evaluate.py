"""``psstereo evaluate``: how far a result is from the truth."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import Format, Json

if TYPE_CHECKING:
    from psstereo.capture import Truth
    from psstereo.io.result_folder import SavedResult
    from psstereo.types import BoolArray

__all__ = ["angle_rows", "evaluate", "height_rows", "score"]


def evaluate(
    out: Annotated[Path, typer.Argument(help="Result folder, or a normal map (png, exr, tif, npy, mat).")],
    truth: Annotated[Path, typer.Argument(help="Capture folder that holds the truth, or a normal map.")],
    layout: Format = None,
    convention: Annotated[
        str, typer.Option(help="Axes of a normal map given as truth: opengl, directx, opencv, meshroom, bini.")
    ] = "opengl",
    short_truth: Annotated[
        str,
        typer.Option(help="Masked pixels without a true normal: skip, or count-90 as DiLiGenT's own scorer does."),
    ] = "skip",
    align: Annotated[
        str | None,
        typer.Option(
            help="How depth is aligned first: none, offset, median-offset, scale, affine. Unless told, offset for"
            " heights and scale for distances."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Compare normals, and depth where it is known, with the truth.

    Example: `psstereo evaluate result photos --json`
    """
    from psstereo.catalogue import choose
    from psstereo.io import CONVENTIONS
    from psstereo.metrics.height import ALIGNMENTS
    from psstereo_cli.console import print_json, print_table
    from psstereo_cli.record import finite

    # Unknown names are told even where what they choose does not come to pass.
    choose(CONVENTIONS, convention, "convention")
    choose({"skip": None, "count-90": None}, short_truth, "rule for short truth")
    if align is not None:
        choose(ALIGNMENTS, align, "alignment")
    saved = _estimate(out)
    known, mask = _truth(truth, layout, convention)
    scores = score(saved, known, mask, short_truth=short_truth, align=align)
    if as_json:
        print_json(finite(scores))
        return
    if scores["normals"] is not None:
        print_table("angular error", angle_rows(scores["normals"]))
    if scores["depth"] is not None:
        print_table("depth error", height_rows(scores["depth"]))


def score(
    saved: "SavedResult",
    truth: "Truth",
    mask: "BoolArray | None",
    *,
    short_truth: str = "skip",
    align: str | None = None,
) -> dict[str, Any]:
    """Score what both sides know.

    Parameters
    ----------
    saved : SavedResult
        The result.
    truth : Truth
        The truth.
    mask : bool array (h, w) or None
        Pixels that count; those with truth if absent.
    short_truth, align : str
        As on the command line.

    Returns
    -------
    dict
        ``normals`` [deg] and ``depth`` [unit], each None where it cannot be scored.
    """
    import numpy as np

    from psstereo.errors import InputError
    from psstereo.metrics import height_error, summarise_angles

    scores: dict[str, Any] = {"normals": None, "depth": None}
    if truth.normals is not None:
        _same_size(saved.normals.shape[:2], truth.normals.shape[:2])
        rule: Any = short_truth
        # Readers make NaN of a missing normal; the rule asks about short ones, so it gets zeros.
        known = np.nan_to_num(truth.normals) if short_truth == "count-90" else truth.normals
        scores["normals"] = asdict(summarise_angles(saved.normals, known, mask, short_truth=rule))
    depth_record = saved.record.get("depth") or {}
    if truth.depth is not None and saved.depth is not None:
        _same_size(saved.depth.shape, truth.depth.shape)
        alignment = align or ("scale" if depth_record.get("kind") == "distance" else "offset")
        # Scaled to the truth, the result is in the truth's unit, which no file states.
        scaled = alignment in ("scale", "affine")
        unit = "(unit of the truth)" if scaled else str(depth_record.get("unit", "px"))
        error = height_error(saved.depth, truth.depth, mask, alignment=alignment, unit=unit)
        scores["depth"] = asdict(error)
    if scores["normals"] is None and scores["depth"] is None:
        raise InputError(
            given="The truth holds nothing that the result holds too.",
            needed="True normals, or true depth and a result with depth.",
            remedy="Name a capture folder with truth, or a normal map.",
        )
    return scores


def _estimate(path: Path) -> "SavedResult":
    """Read a result folder, or a normal map of any origin."""
    from psstereo.io import read_normal_map
    from psstereo.io.result_folder import SavedResult, read_result

    if path.is_file():
        return SavedResult(normals=read_normal_map(path).normals, albedo=None, depth=None, record={})
    return read_result(path)


def _truth(path: Path, layout: str | None, convention: str) -> tuple["Truth", "BoolArray | None"]:
    from psstereo.capture import Truth
    from psstereo.errors import InputError, OptionError
    from psstereo.io import green_convention, read_capture, read_normal_map, recognise
    from psstereo_cli.console import say

    if path.is_dir() or layout is not None or recognise(path):
        capture, known = read_capture(path, layout=layout)
        if known is None:
            raise InputError(
                given=f"{path} is a capture without truth.",
                needed="True normals or depth beside the images, such as Normal_gt.mat.",
                remedy="Name the file of a normal map instead.",
            )
        if convention != "opengl":
            raise OptionError(
                given=f"The convention {convention!r} is given with the capture {path}.",
                needed="It says how a normal map given as truth is read; a capture says that itself.",
                remedy="Leave --convention out, or name the file of the normal map.",
            )
        return known, capture.mask
    found = read_normal_map(path, convention=convention)
    if convention == "opengl" and green_convention(found.normals).verdict == "directx":
        say(f"note: green seems to be down in {path.name}; if so, say --convention directx.")
    return Truth(normals=found.normals, source=path.name), None


def _same_size(result: tuple[int, ...], truth: tuple[int, ...]) -> None:
    from psstereo.errors import InputError

    if tuple(result) != tuple(truth):
        raise InputError(
            given=f"The result is {result[1]} × {result[0]} pixels; the truth, {truth[1]} × {truth[0]}.",
            needed="They must show the same pixels.",
            remedy="Use the truth that belongs to these images, cropped alike.",
        )


def angle_rows(angles: dict[str, Any]) -> list[tuple[str, ...]]:
    """Return the rows of a table of angular errors."""
    rows = [
        (name, f"{angles[key]:.4g}°")
        for name, key in (
            ("mean", "mean_deg"),
            ("median", "median_deg"),
            ("root mean square", "rmse_deg"),
            ("25 % below", "p25_deg"),
            ("75 % below", "p75_deg"),
            ("95 % below", "p95_deg"),
            ("99 % below", "p99_deg"),
            ("largest", "max_deg"),
        )
    ]
    rows += [(f"within {limit}°", f"{angles[f'share_under_{limit}_deg']:.2%}") for limit in (5, 10, 20)]
    pixels = f"{angles['count']} scored, {angles['missing']} without an answer, {angles['short_truth']} without truth"
    return [*rows, ("pixels", pixels)]


def height_rows(depth: dict[str, Any]) -> list[tuple[str, ...]]:
    """Return the rows of a table of depth errors."""
    unit = depth["unit"]
    return [
        ("alignment", f"{depth['alignment']} (scale {depth['scale']:.6g}, offset {depth['offset']:.6g})"),
        ("root mean square", f"{depth['rmse']:.4g} {unit}"),
        ("mean absolute", f"{depth['mean_abs']:.4g} {unit}"),
        ("median absolute", f"{depth['median_abs']:.4g} {unit}"),
        ("largest", f"{depth['max_abs']:.4g} {unit}"),
        ("pixels", f"{depth['count']} scored, {depth['missing']} without an answer"),
    ]
