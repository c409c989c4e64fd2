"""What commands that calibrate have in common: the rig file, the table of its lights, the verdict."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from psstereo.io.rig_file import RigFile

__all__ = ["save_rig"]


def save_rig(out: Path, rig: "RigFile", *, overwrite: bool, as_json: bool, facts: dict[str, Any] | None = None) -> None:
    """Write a rig file and tell a person, or a machine, how good it is.

    Parameters
    ----------
    out : Path
        The file.
    rig : RigFile
        What it is to hold.
    overwrite : bool
        Whether an earlier rig file may be replaced.
    as_json : bool
        Whether a machine reads it.
    facts : dict, optional
        More plain figures for the record.
    """
    from psstereo.io.rig_writer import write_rig
    from psstereo_cli.console import print_json, print_table, say
    from psstereo_cli.record import finite

    write_rig(out, rig, overwrite=overwrite)
    record = {"out": str(out), **_record(rig), **(facts or {})}
    if as_json:
        print_json(dict(finite(record)))
        return
    kind = "position" if record["lights"] and "position" in record["lights"][0] else "direction"
    print_table("lights", _rows(record["lights"], kind), ("light", kind, "strength", "error"))
    say(record["verdict"])
    for line in record["advice"]:
        say(f"  {line}")
    say(f"The rig is in {out}; psstereo reconstruct FOLDER --rig {shlex.quote(str(out))} uses it.")


def _record(rig: "RigFile") -> dict[str, Any]:
    import numpy as np

    from psstereo.lights import Directional, Led

    quality, lights = rig.quality, []
    for k, light in enumerate(rig.rig.lights):
        one: dict[str, Any] = {"name": rig.names[k] if rig.names else str(k + 1)}
        if isinstance(light, Led):
            one |= {"position": light.position.tolist(), "axis": light.axis.tolist(), "mu": light.mu}
            one["strength"] = light.flux.tolist()
        elif isinstance(light, Directional):
            one |= {"direction": light.direction.tolist(), "strength": light.strength.tolist()}
        if quality.direction_error is not None:
            one["direction_error_deg"] = float(np.degrees(quality.direction_error[k]))
        if quality.strength_error is not None:
            one["strength_error_percent"] = 100.0 * float(quality.strength_error[k])
        lights.append(one)
    brightness, angle = quality.residual_brightness, quality.residual_angle
    return {
        "source": rig.rig.source,
        "lights": lights,
        "verdict": quality.verdict,
        "advice": list(quality.advice),
        "residual_percent": None if brightness is None else 100.0 * brightness,
        "residual_deg": None if angle is None else float(np.degrees(angle)),
        "provenance": list(rig.provenance),
    }


def _rows(lights: list[dict[str, Any]], kind: str) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for one in lights:
        errors = [f"{one['direction_error_deg']:.2g}°"] if "direction_error_deg" in one else []
        errors += [f"{one['strength_error_percent']:.2g} %"] if "strength_error_percent" in one else []
        where = " ".join(f"{x:.4g}" for x in one[kind])
        power = " ".join(f"{x:.4g}" for x in one["strength"])
        rows.append((one["name"], where, power + (f", mu {one['mu']:.3g}" if "mu" in one else ""), ", ".join(errors)))
    return rows
