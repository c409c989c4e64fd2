"""The record of shape from shading, ``run.json``: what was given, assumed, and found."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from psstereo.bench import peak_memory, versions
from psstereo.sfs import ShadedImage, ShadingResult
from psstereo.surface_mesh import SurfaceMesh
from psstereo_cli.record import depth_entry, finite, normals_entry

__all__ = ["shading_record"]


def shading_record(
    name: str, image: ShadedImage, result: ShadingResult, mesh: SurfaceMesh, notes: Iterable[str]
) -> dict[str, Any]:
    """Put the record together.

    Parameters
    ----------
    name : str
        Of the image.
    image : ShadedImage
        What was given.
    result : ShadingResult
        What came out; its assumptions stand among the figures of the normals.
    mesh : SurfaceMesh
        Triangles of the depth.
    notes : iterable of str
        What was found while reading.

    Returns
    -------
    dict
        Plain data for JSON.
    """
    height, width = image.image.shape
    seconds = float(result.normals.seconds["solve"])
    record = {
        "schema": 1,
        "command": "sfs",
        "input": {
            "name": name,
            "width": width,
            "height": height,
            "camera": image.camera.name,
            "light": image.light.name,
            "light_direction": _direction(image),
            "albedo": float(np.nanmedian(image.albedo)),
            "ambient": image.ambient,
            "notes": list(notes),
        },
        "normals": normals_entry(result.normals),
        "depth": depth_entry(result.depth),
        "mesh": {"vertices": len(mesh.vertices), "triangles": len(mesh.faces)},
        "seconds": seconds,
        "steps": [
            {"name": str(result.normals.facts["method"]), "done": True, "reason": "One image.", "seconds": seconds}
        ],
        "peak_memory_bytes": peak_memory(),
        "versions": versions(),
    }
    return dict(finite(record))


def _direction(image: ShadedImage) -> list[float] | None:
    """Return the direction toward a distant light [1], None for others."""
    direction = getattr(image.light, "direction", None)
    return None if direction is None else [float(component) for component in direction]
