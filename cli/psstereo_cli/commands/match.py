"""``psstereo match``: disparity of a pair, or depth of calibrated views, from equal brightness."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import Json, Overwrite, Threads

if TYPE_CHECKING:
    from psstereo.matching import CalibratedView, Disparity, RectifiedMatcher, ViewImages
    from psstereo.types import Array, FloatArray

__all__ = ["match"]


def match(
    left: Annotated[
        Path, typer.Argument(help="Left image or capture folder; or a list of cameras such as templeSR_par.txt.")
    ],
    right: Annotated[Path | None, typer.Argument(help="Right image or capture folder.")] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder for the result.")] = None,
    disparities: Annotated[
        str | None, typer.Option(help="First and last disparity to try, such as 0,63 [px]; or from --calibration.")
    ] = None,
    exposure: Annotated[str, typer.Option(help="same (checked), or estimate: find gain and offset first.")] = "same",
    lights: Annotated[int | None, typer.Option(min=1, help="Use only the first images of captures.")] = None,
    response: Annotated[
        str, typer.Option(help="Tone curve of image files: linear, srgb, or the exponent of a gamma curve.")
    ] = "linear",
    cost: Annotated[
        str,
        typer.Option(
            help="linear: brightness alone, in units of noise; photographs: with slopes, and room for what cameras do;"
            " auto: linear for captures, photographs for image files."
        ),
    ] = "auto",
    fill: Annotated[bool, typer.Option("--fill", help="Fill gaps from behind, and flag them.")] = False,
    unchecked: Annotated[
        bool, typer.Option("--unchecked", help="Do not check rows, exposure and overlap of the pair.")
    ] = False,
    calibration: Annotated[Path | None, typer.Option(help="Middlebury's calib.txt, for depth.")] = None,
    baseline: Annotated[
        float | None, typer.Option(help="Distance of the cameras, for depth of captures with a pinhole camera.")
    ] = None,
    truth: Annotated[Path | None, typer.Option(help="True disparity (pgm, pfm, npy, png) to score against.")] = None,
    truth_scale: Annotated[float, typer.Option(help="Its numbers are disparities times this.")] = 1.0,
    box: Annotated[
        str | None, typer.Option(help="Six numbers x0,y0,z0,x1,y1,z1 that hold the object; views are swept through it.")
    ] = None,
    view: Annotated[int, typer.Option(min=1, help="Which view of a list to find the depth of, from 1.")] = 1,
    others: Annotated[int, typer.Option(min=1, help="Neighbouring views to use.")] = 4,
    planes: Annotated[int, typer.Option(min=3, max=4096, help="Planes to sweep.")] = 128,
    dark: Annotated[
        float | None,
        typer.Option(help="Share of full scale up to which a view of a list shows background; found if not given."),
    ] = None,
    threads: Threads = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Find what belongs together in several views, since a matte point is equally bright in all of them.

    Example: `psstereo match im2.png im6.png -o result --disparities 0,63 --truth disp2.pgm --truth-scale 4`

    Captures under many lights: `psstereo match view_01 view_02 -o result --disparities 40,110 --baseline 0.8`

    Many views: `psstereo match templeSR_par.txt -o result --box=-0.08,0.02,-0.02,0.03,0.19,0.07`
    """
    from psstereo.catalogue import choose
    from psstereo.io.atomic import require_free
    from psstereo_cli.console import print_json, progress_bars
    from psstereo_cli.execution import available_threads, threaded

    if out is None:
        raise typer.BadParameter("Name a folder for the result with -o.", param_hint="--out")
    choose({"auto": None, "linear": None, "photographs": None}, cost, "cost")
    choose({"same": None, "estimate": None}, exposure, "exposure")
    if right is None and box is None:
        raise typer.BadParameter("Name the right view, or give --box for a list of cameras.", param_hint="RIGHT")
    depth = right is None or calibration is not None or baseline is not None
    require_free(out, overwrite=overwrite, names=_names(pair=right is not None, depth=depth))
    with threaded(threads or available_threads()) as over, progress_bars() as progress:
        if right is None:
            files, record = _sweep(left, view - 1, str(box), others, planes, response, dark, over, progress)
        else:
            one, two = _view_images(left, response, lights), _view_images(right, response, lights)
            linear = cost == "linear" or (cost == "auto" and left.is_dir())
            matcher = _matcher(disparities, calibration, exposure, linear=linear, fill=fill, checks=not unchecked)
            found = matcher.match(one, two, over=over, progress=progress)
            files, record = _pair_files(found, _lengths(left, right, calibration, baseline))
            record["cost"] = "linear" if linear else "photographs"
            _score(files, record, found, one, two, truth, truth_scale)
    record = _save(out, files, record, overwrite=overwrite)
    if as_json:
        print_json({**record, "out": str(out)})
    else:
        _tell(record, out)


def _names(*, pair: bool, depth: bool) -> set[str]:
    """Return the files of the result, so that what is in the way is told before the work."""
    names = {"run.json", "confidence.npy", "flags.npy"}
    names |= {"disparity.npy", "disparity.png", "constancy.png"} if pair else set()
    return names | ({"depth.npy", "depth.png"} if depth else set())


def _view_images(path: Path, response: str, lights: int | None) -> "ViewImages":
    """Read an image file, or a capture folder."""
    from psstereo.errors import MissingFileError
    from psstereo.matching import ViewImages
    from psstereo.stack import FileStack

    if not path.exists():
        raise MissingFileError(given=f"{path} is not there.", needed="An image or a folder.", remedy="Check the name.")
    if path.is_dir():
        from psstereo.io import read_capture

        capture = read_capture(path)[0]
        return ViewImages.from_capture(capture, lights=None if lights is None else range(lights))
    frame = FileStack((path,)).frame(0)
    return ViewImages.from_arrays(frame, response=_response(response), name=path.name)


def _response(text: str) -> Any:
    from psstereo.stack import Response
    from psstereo_cli.execution import parse_floats

    if text in ("linear", "srgb"):
        return Response(text)
    return Response("gamma", parse_floats(text, 1, "response")[0])


def _matcher(
    disparities: str | None, calibration: Path | None, exposure: str, *, linear: bool, fill: bool, checks: bool
) -> "RectifiedMatcher":
    from psstereo.errors import OptionError
    from psstereo.matching import RectifiedMatcher, read_pair_calibration
    from psstereo_cli.execution import parse_floats

    first, last = 0, 63
    if disparities is not None:
        pair = parse_floats(disparities, 2, "range of disparities")
        if any(number != int(number) for number in pair) or pair[1] <= pair[0]:
            raise OptionError(
                given=f"The range of disparities is {disparities!r}.",
                needed="Two whole numbers, the smaller one first, such as 0,63.",
                remedy="Write it so; negative ones as --disparities=-8,40.",
            )
        first, last = int(pair[0]), int(pair[1])
    elif calibration is not None:
        last = (read_pair_calibration(calibration).disparities or 64) - 1
    options: dict[str, Any] = {
        "first": first, "count": last - first + 1, "exposure": exposure, "fill": fill, "checks": checks
    }  # fmt: skip
    return RectifiedMatcher.for_linear(**options) if linear else RectifiedMatcher(**options)


def _lengths(
    left: Path, right: Path, calibration: Path | None, baseline: float | None
) -> tuple[float, float, float] | None:
    """Return focal length, baseline and shift of the principal points, None if depth cannot be told."""
    from psstereo.camera import Pinhole
    from psstereo.errors import InputError
    from psstereo.io import read_capture
    from psstereo.matching import read_pair_calibration

    if calibration is not None:
        known = read_pair_calibration(calibration)
        return known.camera.fx, known.baseline, known.shift
    if baseline is None:
        return None
    cameras = [read_capture(path)[0].camera if path.is_dir() else None for path in (left, right)]
    one, two = cameras
    if not (isinstance(one, Pinhole) and isinstance(two, Pinhole) and baseline > 0):
        raise InputError(
            given=f"A baseline of {baseline:g} is given, and no pinhole camera for both views.",
            needed="A positive length, and captures whose camera is known.",
            remedy="Describe the camera in capture.toml, or give --calibration.",
        )
    return one.fx, baseline, two.cx - one.cx


def _pair_files(
    found: "Disparity", lengths: tuple[float, float, float] | None
) -> tuple[dict[str, "Array"], dict[str, Any]]:
    from psstereo.io.pictures import depth_picture
    from psstereo.matching import count_match_flags

    files: dict[str, Array] = {
        "disparity.npy": found.disparity,
        "disparity.png": depth_picture(found.disparity, near_is_small=False),
        "confidence.npy": found.confidence,
        "flags.npy": found.flags,
    }
    if lengths is not None:
        depth = found.depth(lengths[0], lengths[1], shift=lengths[2])
        files |= {"depth.npy": depth, "depth.png": depth_picture(depth, near_is_small=True)}
    record = {
        "mode": "pair",
        **found.facts,
        "gain": found.gain,
        "offset": found.offset,
        "flags": count_match_flags(found.flags),
        "steps": [{"name": s.name, "done": s.done, "reason": s.reason} for s in found.steps],
    }
    return files, record


def _score(
    files: dict[str, "Array"],
    record: dict[str, Any],
    found: "Disparity",
    left: "ViewImages",
    right: "ViewImages",
    truth: Path | None,
    scale: float,
) -> None:
    """Add how far disparities are from the truth, and where brightness is not the same at the matches, and why."""
    from dataclasses import replace

    import numpy as np

    from psstereo.matching import (
        MatchFlag,
        disparity_score,
        failure_report,
        fill_from_behind,
        pair_constancy,
        visible_in_right,
    )

    # What a photograph's noise is nobody knows here: two hundredths of full scale and of the signal.
    noise = left.noise if record["cost"] == "linear" else left.noise.with_tolerance(0.02, 0.02)
    one, two = replace(left, noise=noise), replace(right.corrected(found.gain, found.offset), noise=noise)
    if truth is None:
        known = fill_from_behind(found.disparity)
        visible = (found.flags & np.uint16(MatchFlag.OCCLUDED)) == 0
    else:
        known = _truth(truth, scale, left)
        visible = visible_in_right(known)
        record["score"] = disparity_score(found.disparity, known, visible)
    constancy = pair_constancy(one, two, known, visible)
    record["constancy"] = dict(constancy.rows())
    record["constancy_at"] = "the matches found" if truth is None else "the true matches"
    failures = failure_report(constancy, one, visible)
    record["failures"] = failures.shares()
    record["failures_told"] = [list(row) for row in failures.rows()]
    files["constancy.png"] = constancy.picture()


def _truth(truth: Path, scale: float, left: "ViewImages") -> "FloatArray":
    from psstereo.errors import InputError
    from psstereo.matching import read_disparity

    known = read_disparity(truth, scale=scale)
    if known.shape != left.size:
        raise InputError(
            given=f"{truth.name} is {known.shape[1]} × {known.shape[0]} pixels; {left.name}, "
            f"{left.size[1]} × {left.size[0]}.",
            needed="The true disparity of the left view.",
            remedy="Name the map that belongs to the left image.",
        )
    return known


def _sweep(
    path: Path,
    view: int,
    box: str,
    others: int,
    planes: int,
    response: str,
    dark: float | None,
    over: Any,
    progress: Any,
) -> tuple[dict[str, "Array"], dict[str, Any]]:
    import numpy as np

    from psstereo.errors import OptionError
    from psstereo.io.pictures import depth_picture
    from psstereo.matching import PlaneSweep, count_match_flags, inside_box, nearest_views, read_view_list
    from psstereo_cli.execution import parse_floats

    views = read_view_list(path)
    corners = np.array(parse_floats(box, 6, "box")).reshape(2, 3)
    if view >= len(views) or not (corners[0] < corners[1]).all():
        raise OptionError(
            given=f"View {view + 1} of {len(views)}, and a box from {corners[0].tolist()} to {corners[1].tolist()}.",
            needed="A view of the list, and the box's lower corner before its upper one.",
            remedy="Count views from 1, and write --box=x0,y0,z0,x1,y1,z1.",
        )
    chosen = [view, *nearest_views(views, view, others)]
    images = [_masked(path.parent / views[number].name, response, dark) for number in chosen]
    near, far = _range(views[view], corners)
    found = PlaneSweep(planes=planes).depth(
        images, [views[number] for number in chosen], near, far, over=over, progress=progress
    )
    known = np.isfinite(found.depth)
    points = views[view].points(np.asarray(found.depth, np.float64))
    files: dict[str, Array] = {
        "depth.npy": found.depth,
        "depth.png": depth_picture(found.depth, near_is_small=True),
        "confidence.npy": found.confidence,
        "flags.npy": found.flags,
    }
    record = {
        "mode": "sweep",
        "used": [views[number].name for number in chosen],
        "inside_box": float(inside_box(points, corners[0], corners[1])[known].mean()) if known.any() else None,
        **found.facts,
        "flags": count_match_flags(found.flags),
        "steps": [],
    }
    return files, record


def _masked(path: Path, response: str, dark: float | None) -> "ViewImages":
    """Read a view and part the object from a dark background."""
    import numpy as np

    from psstereo.masking import mask_from_brightness
    from psstereo.matching import ViewImages
    from psstereo.stack import FileStack, MemoryStack
    from psstereo.stack.stack import full_scale

    frame = FileStack((path,)).frame(0)
    if dark is None:
        mask = mask_from_brightness(MemoryStack(frame[None]))
    else:
        mask = np.asarray(frame.max(axis=2) > dark * full_scale(frame.dtype))
    return ViewImages.from_arrays(frame, response=_response(response), mask=mask, name=path.name)


def _range(view: "CalibratedView", corners: "FloatArray") -> tuple[float, float]:
    """Return the nearest and farthest distance of a box's corners."""
    import numpy as np

    from psstereo.errors import InputError

    every = np.stack(np.meshgrid(*corners.T), axis=-1).reshape(-1, 3)
    distance = view.project(every)[2]
    if not np.isfinite(distance).all():
        raise InputError(
            given=f"The box reaches behind the camera of {view.name}.",
            needed="A box in front of the camera.",
            remedy="Check the frame and unit of the box.",
        )
    return float(distance.min()), float(distance.max())


def _save(out: Path, files: dict[str, "Array"], record: dict[str, Any], *, overwrite: bool) -> dict[str, Any]:
    """Write the folder, whole or not at all, and return the record."""
    import json

    import numpy as np

    from psstereo.bench import peak_memory, versions
    from psstereo.io.atomic import RECORD, new_folder
    from psstereo.io.pictures import write_png
    from psstereo_cli.record import finite

    whole = {"schema": 1, "command": "match", **record, "peak_memory_bytes": peak_memory(), "versions": versions()}
    plain = dict(finite(whole))
    with new_folder(out, overwrite=overwrite, names={*files, RECORD}) as work:
        for name, array in files.items():
            if name.endswith(".png"):
                write_png(work / name, array)
            else:
                kind = array.dtype if array.dtype.kind == "u" else np.float32
                np.save(work / name, np.asarray(array, kind), allow_pickle=False)
        text = json.dumps(plain, indent=1, ensure_ascii=False, allow_nan=False)
        (work / RECORD).write_bytes((text + "\n").encode("utf-8", "backslashreplace"))
    return plain


def _tell(record: dict[str, Any], out: Path) -> None:
    from psstereo_cli.console import print_table, say

    rows = [(step["name"], "done" if step["done"] else "left out", step["reason"]) for step in record["steps"]]
    if rows:
        print_table("what was done", rows, ("step", "", "why"))
    figures: list[tuple[str, ...]] = [("matched", f"{record['matched']:.1%} of the object")]
    if record["mode"] == "sweep":
        share = record["inside_box"]
        figures.append(("inside the box", "nothing is known" if share is None else f"{share:.1%} of what is known"))
    figures += [(f"flag {name}", f"{count} pixels") for name, count in record["flags"].items()]
    figures += [(name, f"{value:.3g} %") for name, value in record.get("score", {}).items() if name.startswith("bad")]
    figures.append(("time", f"{record['seconds']['total']:.2f} s"))
    print_table("result", figures)
    if "constancy" in record:
        print_table(f"brightness at {record['constancy_at']}", list(record["constancy"].items()))
        rows = [tuple(row) for row in record["failures_told"]]
        print_table("where it is not the same", rows, ("pixels", "of the object", "of all failures", "why"))
    say(f"The result is in {out}.")
