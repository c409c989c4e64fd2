"""The record of an integration, ``run.json``: what was given, what stayed free, what came out."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from psstereo.bench import peak_memory, versions
from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.depth.given_normals import Integration
from psstereo.flags import count_flags
from psstereo.io import green_convention
from psstereo.types import FloatArray
from psstereo_cli.record import depth_entry, finite

__all__ = ["integration_record", "warnings_about"]

_OPPOSITE = {"opengl": "directx", "directx": "opengl"}


def integration_record(
    result: Integration,
    camera: Camera,
    *,
    name: str,
    convention: str,
    mask: str | None,
    notes: Iterable[str],
    warnings: Iterable[str],
    seconds: float,
) -> dict[str, Any]:
    """Put the record together.

    Parameters
    ----------
    result : Integration
        What came out.
    camera : Camera
        The camera of the normals.
    name, convention, mask
        Of the normal map; the mask is None if there was none.
    notes : iterable of str
        What was found while reading.
    warnings : iterable of str
        What to look at before the result is used.
    seconds : float
        Time that reading took [s].

    Returns
    -------
    dict
        Plain data for JSON.
    """
    height, width = result.depth.depth.shape
    reading = {"name": "reading", "done": True, "reason": f"{width} × {height} normals.", "seconds": round(seconds, 4)}
    record = {
        "schema": 1,
        "command": "integrate",
        "input": {
            "name": name,
            "width": width,
            "height": height,
            "convention": convention,
            "mask": mask,
            "camera": _camera(camera),
            "notes": list(notes),
            "warnings": list(warnings),
        },
        "normals": {
            "frame": "x right, y up, z toward the camera",
            "pixels": int(np.count_nonzero(np.isfinite(result.normals).all(axis=2))),
            "flags": count_flags(result.flags),
        },
        "depth": depth_entry(result.depth),
        "mesh": {"vertices": len(result.mesh.vertices), "triangles": len(result.mesh.faces)},
        "steps": [
            reading,
            *(
                {"name": s.name, "done": s.done, "reason": s.reason, "seconds": round(s.seconds, 4)}
                for s in result.steps
            ),
        ],
        "peak_memory_bytes": peak_memory(),
        "versions": versions(),
    }
    return dict(finite(record))


def warnings_about(normals: FloatArray, camera: Camera, convention: str) -> list[str]:
    """Say what looks wrong about a normal map and its camera; nothing is changed.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Normals as they were read, y up; NaN where there is none [1].
    camera : Camera
        The camera that was described.
    convention : str
        As which the normals were read.

    Returns
    -------
    list of str
        Sentences: that y seems to run the other way, and that K seems to belong to another crop.
    """
    found = [_green(normals, convention)]
    if isinstance(camera, Pinhole):
        height, width = normals.shape[:2]
        if not (-0.5 <= camera.cx < width - 0.5 and -0.5 <= camera.cy < height - 0.5):
            found.append(
                f"The principal point ({camera.cx:.1f}, {camera.cy:.1f}) lies outside the {width} × {height} pixels. If"
                " the normal map was cropped, subtract the crop's first column and row from it."
            )
    return [warning for warning in found if warning is not None]


def _green(normals: FloatArray, convention: str) -> str | None:
    """Say so if a normal map looks as if y ran the other way."""
    found = green_convention(normals)
    if found.verdict != "directx":
        return None
    cues = []
    if found.relative_curl_flipped < found.relative_curl:
        cues.append(f"the gradients' curl falls from {found.relative_curl:.2f} to {found.relative_curl_flipped:.2f}")
    if found.outward_y < 0:
        cues.append("the outline faces outward")
    other = _OPPOSITE.get(convention)
    remedy = f"try --convention {other}" if other else "check which way y runs in it, and --convention"
    return (
        f"Green seems to run the other way than '{convention}' says: with y flipped, {' and '.join(cues)}. Nothing was "
        f"flipped; {remedy}."
    )


def _camera(camera: Camera) -> dict[str, Any]:
    if isinstance(camera, Pinhole):
        return {"name": camera.name, "K": camera.matrix.tolist()}
    if isinstance(camera, Orthographic):
        return {"name": camera.name, "pixel_size": camera.pixel_size, "unit": camera.unit}
    return {"name": camera.name}
