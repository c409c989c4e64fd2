"""``psstereo info``: what a folder is taken for, and why."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import Format, Json, Lights, LightsLayout, Mask, RigOption

if TYPE_CHECKING:
    from psstereo.capture import Capture, Truth

__all__ = ["info"]


def info(
    folder: Annotated[Path | None, typer.Argument(help="Folder, or file that describes a capture.")] = None,
    layout: Format = None,
    lights: Lights = None,
    lights_layout: LightsLayout = None,
    rig: RigOption = None,
    mask: Mask = None,
    formats: Annotated[bool, typer.Option("--formats", help="List the layouts that are known.")] = False,
    template: Annotated[bool, typer.Option("--template", help="Print a capture.toml to start from.")] = False,
    as_json: Json = False,
) -> None:
    """Say what was recognised in a folder, and how it would be read; nothing is solved.

    Example: `psstereo info photos`
    """
    from psstereo.io import READERS, TEMPLATE
    from psstereo_cli.console import print_json, print_table

    if template:
        typer.echo(TEMPLATE, nl=False)
        return
    if formats:
        if as_json:
            print_json({name: reader.summary for name, reader in READERS.items()})
        else:
            rows = [(name, reader.summary) for name, reader in READERS.items()]
            print_table("layouts, the first that fits is taken", rows, ("format", "what is there"))
        return
    if folder is None:
        raise typer.BadParameter("Name a folder, or use --formats or --template.", param_hint="FOLDER")
    record = _describe(folder, layout, lights, lights_layout, rig, mask)
    if as_json:
        print_json(record)
    else:
        _print(record)


def _describe(
    folder: Path,
    layout: str | None,
    lights: Path | None,
    lights_layout: str | None,
    rig: Path | None,
    mask: str | None,
) -> dict[str, Any]:
    from psstereo.io import recognise
    from psstereo.types import no_progress
    from psstereo_cli.loading import load_capture
    from psstereo_cli.record import finite

    capture, truth = load_capture(
        folder,
        layout=layout,
        lights=lights,
        lights_layout=lights_layout,
        rig=rig,
        mask=mask,
        truth=True,
        progress=no_progress,
    )
    fits = recognise(folder)
    record = {
        "format": layout or (fits[0].format if fits else "images"),
        "recognised": [{"format": fit.format, "reason": fit.reason} for fit in fits],
        **_capture_facts(capture),
        "truth": _truth_facts(truth),
        "notes": list(capture.notes),
    }
    return dict(finite(record))


def _capture_facts(capture: "Capture") -> dict[str, Any]:
    import numpy as np

    m, h, w, c = capture.stack.shape
    facts: dict[str, Any] = {
        "name": capture.name,
        "images": {
            "count": m,
            "width": w,
            "height": h,
            "channels": c,
            "type": str(capture.stack.dtype),
            "full_scale": capture.stack.white if capture.stack.saturates else None,
            "response": capture.response.name,
            "dark_image": capture.dark is not None,
        },
        "camera": capture.camera.name,
        "mask_share": None if capture.mask is None else float(capture.mask.mean()),
        "lights": {"source": capture.rig.source, "distant": capture.rig.all_distant},
    }
    if capture.rig.all_distant:
        tilt = np.degrees(np.arccos(np.clip(capture.rig.directions[:, 2], -1, 1)))  # for people, no error measure
        strength = capture.rig.strengths(c)
        facts["lights"] |= {
            "condition": capture.rig.condition(),
            "tilt_deg": [float(tilt.min()), float(tilt.max())],
            "behind": int((capture.rig.directions[:, 2] <= 0).sum()),
            "strength_ratio": float(strength.max() / strength.min()),
            "strength_unit": capture.rig.strength_unit.value,
        }
    return facts


def _truth_facts(truth: "Truth | None") -> dict[str, Any] | None:
    if truth is None:
        return None
    return {
        "source": truth.source,
        "normals": truth.normals is not None,
        "depth": truth.depth is not None,
        "albedo": truth.albedo is not None,
    }


def _print(record: dict[str, Any]) -> None:
    from psstereo_cli.console import print_table, say

    images, lights = record["images"], record["lights"]
    fits = record["recognised"]
    rows: list[tuple[str, ...]] = [("format", record["format"])]
    rows += [
        ("recognised as" if i == 0 else "would fit too", f"{f['format']}: {f['reason']}") for i, f in enumerate(fits)
    ]
    size = f"{images['count']} of {images['width']} × {images['height']}, {images['channels']} × {images['type']}"
    rows.append(("images", size))
    rows.append(("response", images["response"] + (", dark image subtracted" if images["dark_image"] else "")))
    rows.append(("camera", record["camera"]))
    share = record["mask_share"]
    rows.append(("mask", "none: every pixel counts" if share is None else f"{share:.1%} of the image"))
    rows.append(("lights", f"{lights['source']}, {'distant' if lights['distant'] else 'near'}"))
    if lights["distant"]:
        condition = lights["condition"]
        rows.append(("light tilt", f"{lights['tilt_deg'][0]:.1f}° to {lights['tilt_deg'][1]:.1f}° from the view"))
        rows.append(
            ("conditioning", "the lights are coplanar" if condition is None else f"{condition:.3g} (1 is best)")
        )
        rows.append(("strengths", f"strongest over weakest {lights['strength_ratio']:.3g}, {lights['strength_unit']}"))
    truth = record["truth"]
    known = [] if truth is None else [part for part in ("normals", "depth", "albedo") if truth[part]]
    rows.append(("truth", "none" if truth is None else f"{', '.join(known)} ({truth['source']})"))
    print_table(record["name"], rows)
    for note in record["notes"]:
        say(f"note: {note}")
