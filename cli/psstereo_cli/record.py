"""The record of a run, ``run.json``: plain data that says what was done, with what, and how long it took."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from psstereo.bench import peak_memory, versions
from psstereo.capture import Capture
from psstereo.depth.given_normals import free_constants
from psstereo.flags import count_flags
from psstereo.pipeline import Reconstruction
from psstereo.results import DepthResult, NormalsResult

__all__ = ["depth_entry", "finite", "normals_entry", "run_record"]


def finite(value: Any) -> Any:
    """Return plain data in which JSON has no trouble: numbers of NumPy become Python's, NaN and infinity None."""
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def run_record(
    command: str, capture: Capture, result: Reconstruction, extra: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Put the record together.

    Parameters
    ----------
    command : str
        Name of the command.
    capture : Capture
        What was measured.
    result : Reconstruction
        What came out.
    extra : mapping, optional
        More entries.

    Returns
    -------
    dict
        Plain data for JSON.
    """
    m, h, w, c = capture.stack.shape
    record = {
        "schema": 1,
        "command": command,
        "capture": {
            "name": capture.name,
            "images": m,
            "width": w,
            "height": h,
            "channels": c,
            "type": str(capture.stack.dtype),
            "camera": capture.camera.name,
            "lights": capture.rig.source,
            "strength_unit": capture.rig.strength_unit.value,
            "notes": list(capture.notes),
        },
        "normals": normals_entry(result.normals),
        "depth": None if result.depth is None else depth_entry(result.depth),
        "mesh": None
        if result.mesh is None
        else {"vertices": len(result.mesh.vertices), "triangles": len(result.mesh.faces)},
        "steps": [
            {"name": s.name, "done": s.done, "reason": s.reason, "seconds": round(s.seconds, 4)} for s in result.steps
        ],
        "peak_memory_bytes": peak_memory(),
        "versions": versions(),
        **(extra or {}),
    }
    return dict(finite(record))


def normals_entry(result: NormalsResult) -> dict[str, Any]:
    """Return what the record says of normals.

    Parameters
    ----------
    result : NormalsResult
        The normals.

    Returns
    -------
    dict
        Figures, frame, meaning of the albedo, outcome and flags.
    """
    spread = result.uncertainty[np.isfinite(result.uncertainty)]
    return {
        **result.facts,
        "frame": "x right, y up, z toward the camera",
        "albedo": result.albedo_kind.value,
        "outcome": result.outcome.name.lower(),
        "outcome_text": result.outcome.value,
        "median_uncertainty_deg": math.degrees(float(np.median(spread))) if spread.size else None,
        "flags": count_flags(result.flags),
    }


def depth_entry(result: DepthResult) -> dict[str, Any]:
    """Return what the record says of a depth map.

    Parameters
    ----------
    result : DepthResult
        The depth.

    Returns
    -------
    dict
        Figures, kind, unit, range, what normals alone leave free, and outcome.
    """
    known = result.depth[np.isfinite(result.depth)]
    return {
        **result.facts,
        "kind": result.kind.value,
        "unit": result.unit,
        "range": [float(known.min()), float(known.max())] if known.size else None,
        "free_constants": asdict(free_constants(result)),
        "components": int(result.components.max(initial=0)),
        "iterations": result.iterations,
        "residual": result.residual,
        "outcome": result.outcome.name.lower(),
        "outcome_text": result.outcome.value,
    }
