"""The report of a reconstruction: its page, from what the run left."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from psstereo.capture import Capture
    from psstereo.pipeline import Reconstruction

__all__ = ["run_report"]


def run_report(capture: "Capture", result: "Reconstruction") -> str:
    """Return the page of a reconstruction.

    Parameters
    ----------
    capture : Capture
        What was measured.
    result : Reconstruction
        What came out, with its views if there are any.

    Returns
    -------
    str
        HTML.
    """
    from psstereo.report import Report, render_report

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
    # Lights that were refined or found are others than the capture's.
    given = capture.rig.all_distant and facts.get("light_source") == capture.rig.source
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
    return render_report(
        Report(
            name=capture.name,
            summary=summary,
            normals=result.normals,
            depth=result.depth,
            steps=result.steps,
            figures=figures,
            findings=findings,
            directions=capture.rig.directions if given else None,
            names=capture.stack.names,
            views=result.views,
        )
    )
