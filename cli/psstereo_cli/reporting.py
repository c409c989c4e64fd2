"""The report of a result: its page, from what the run left."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from psstereo.capture import Capture
    from psstereo.depth.given_normals import Integration
    from psstereo.io.derived_files import Derived
    from psstereo.pipeline import Reconstruction
    from psstereo.sfs import ShadedImage, ShadingResult

__all__ = ["integration_report", "run_report", "shading_report"]


def run_report(capture: "Capture", result: "Reconstruction") -> str:
    """Return the page of a reconstruction.

    Parameters
    ----------
    capture : Capture
        What was measured; under near lamps its images are looked at once more.
    result : Reconstruction
        What came out, with its views if there are any.

    Returns
    -------
    str
        HTML.
    """
    from psstereo.near import wants_near
    from psstereo.report import Report, lamp_directions, render_report, views_under_lamps

    count, height, width, channels = capture.stack.shape
    facts = result.normals.facts
    colour = "colour" if channels == 3 else f"{channels} channel" + ("s" if channels > 1 else "")
    summary = (
        f"{count} images of {width} × {height} pixels, {colour}, {capture.stack.dtype}. {result.normals.outcome.value}"
    )
    figures = [
        ("solver", str(facts.get("solver", "near lamps"))),
        ("camera", capture.camera.name),
        ("lights", capture.rig.source),
        *((f"seconds: {name}", f"{value:.2f}") for name, value in result.normals.seconds.items()),
        *(("note", note) for note in capture.notes),
    ]
    findings = [
        {
            "name": one.name,
            "severity": one.severity,
            "figure": f"{one.figure:.3g} {one.unit}".strip(),
            "sentence": one.sentence,
            "remedy": one.remedy,
        }
        for one in result.plan.facts.findings
    ]
    near = wants_near(capture) and facts.get("solver") == "near-lamps"
    directions = None
    # Lights that were refined or found are others than the capture's.
    if capture.rig.all_distant and facts.get("light_source") == capture.rig.source:
        directions = capture.rig.directions
    elif near and result.depth is not None:
        directions = lamp_directions(capture, result.depth)
    return render_report(
        Report(
            name=capture.name,
            summary=summary,
            normals=result.normals,
            depth=result.depth,
            steps=result.steps,
            figures=figures,
            findings=findings,
            directions=directions,
            lamps=near,
            names=capture.stack.names,
            views=views_under_lamps(capture, result.normals, result.depth) if near else result.views,
        )
    )


def shading_report(image: "ShadedImage", result: "ShadingResult", record: Mapping[str, Any]) -> str:
    """Return the page of shape from one image.

    Parameters
    ----------
    image : ShadedImage
        What was given.
    result : ShadingResult
        What came out.
    record : mapping
        Of :func:`psstereo_cli.shading_record.shading_record`.

    Returns
    -------
    str
        HTML.
    """
    from psstereo.report import Report, render_report
    from psstereo.results import Step

    given, normals, depth = record["input"], record["normals"], record["depth"]
    direction = getattr(image.light, "direction", None)
    misfit = normals.get("brightness_misfit", normals.get("data_residual"))
    figures = [
        ("method", str(normals["method"])),
        ("light", str(given["light"])),
        ("camera", str(given["camera"])),
        ("albedo taken", _number(given["albedo"])),
        ("ambient level taken", _number(given["ambient"])),
        *([] if misfit is None else [("brightness misfit, of a facing surface", _number(misfit))]),
        *_depth_figures(depth),
        *(("note", note) for note in given["notes"]),
    ]
    return render_report(
        Report(
            name=str(given["name"]),
            summary=f"One image of {given['width']} × {given['height']} pixels. {result.normals.outcome.value}",
            normals=result.normals,
            depth=result.depth,
            steps=[Step(**step) for step in record["steps"]],
            figures=figures,
            assumptions=[(one.name, one.basis.value, one.sentence) for one in result.assumptions],
            directions=None if direction is None else direction[None],
            names=(str(given["name"]),),
            image=image.image,
        )
    )


def integration_report(result: "Integration", derived: "Derived", record: Mapping[str, Any]) -> str:
    """Return the page of an integration.

    Parameters
    ----------
    result : Integration
        What came out.
    derived : Derived
        What was made of it besides.
    record : mapping
        Of :func:`psstereo_cli.integration_record.integration_record`.

    Returns
    -------
    str
        HTML.
    """
    import numpy as np

    from psstereo.report import Report, render_report
    from psstereo.results import NormalsResult, Step

    given, depth = record["input"], record["depth"]
    shape = result.normals.shape[:2]
    unknown = np.full(shape, np.nan)
    normals = NormalsResult(
        normals=result.normals, albedo=unknown, uncertainty=unknown, flags=result.flags, outcome=result.depth.outcome
    )
    warnings = [
        {"name": "normal map", "severity": "warning", "figure": "", "sentence": warning, "remedy": ""}
        for warning in given["warnings"]
    ]
    figures = [
        ("axes of the normal map", str(given["convention"])),
        ("camera", str(given["camera"]["name"])),
        ("mask", str(given["mask"] or "none")),
        *_depth_figures(depth),
        *(("note", note) for note in given["notes"]),
    ]
    return render_report(
        Report(
            name=str(given["name"]),
            summary=f"A normal map of {given['width']} × {given['height']} pixels. {depth['outcome_text']}",
            normals=normals,
            depth=result.depth,
            steps=[Step(**step) for step in record["steps"]],
            figures=figures,
            findings=warnings,
            albedo_known=False,
            maps=list(_derived_maps(derived)),
        )
    )


def _derived_maps(derived: "Derived") -> Iterable[Any]:
    """Yield relief and mean curvature as pictures, if there are any."""
    from psstereo.report import Map

    if derived.relief is not None:
        yield Map(key="relief", title="Relief", values=derived.relief, unit=derived.relief_unit)
    if derived.curvature:
        mean = derived.curvature["mean"]
        yield Map(key="curvature", title="Mean curvature", values=mean, unit=derived.curvature_unit)


def _depth_figures(depth: Mapping[str, Any]) -> list[tuple[str, str]]:
    span = "nothing" if depth["range"] is None else "{:.4g} to {:.4g}".format(*depth["range"])
    return [
        ("depth", f"{depth['kind']} [{depth['unit']}] from {span}"),
        ("what stays free", str(depth["free_constants"]["sentence"])),
        ("pieces", str(depth["components"])),
        ("iterations", f"{depth['iterations']}, relative residual {_number(depth['residual'])}"),
    ]


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.3g}"
