"""What a person is told of a reconstruction: steps, figures, and where the result is."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from psstereo.pipeline import Reconstruction

__all__ = ["tell"]


def tell(out: Path, record: dict[str, Any], result: "Reconstruction", *, as_json: bool) -> None:
    """Print what was used and what came out, and leave with 4 if something did not converge.

    Parameters
    ----------
    out : Path
        The result folder.
    record : dict
        What run.json holds.
    result : Reconstruction
        The answer.
    as_json : bool
        Whether a machine reads it.

    Raises
    ------
    typer.Exit
        With 4 if something did not converge.
    """
    from psstereo_cli.console import print_json, print_table, say
    from psstereo_cli.failure import NOT_CONVERGED

    if as_json:
        print_json({**record, "out": str(out)})
    else:
        for note in record["capture"]["notes"]:
            say(f"note: {note}")
        rows = [
            (step["name"], f"{step['seconds']:.2f} s" if step["done"] else "left out", step["reason"])
            for step in record["steps"]
        ]
        print_table(f"{record['capture']['name']}: what was done", rows, ("step", "time", "why"))
        print_table("result", _figures(record))
        say(f"The result is in {out}.")
    if not result.converged:
        raise typer.Exit(NOT_CONVERGED)


def _figures(record: dict[str, Any]) -> list[tuple[str, ...]]:
    normals, depth = record["normals"], record["depth"]
    spread = normals["median_uncertainty_deg"]
    told = normals.get("light_strengths")
    rows: list[tuple[str, ...]] = [
        ("normals", normals["outcome_text"]),
        ("albedo", normals["albedo"]),
        ("expected error", "cannot be told: no redundant light" if spread is None else f"{spread:.3g}° (median)"),
        *((f"flag {name}", f"{count} pixels") for name, count in normals["flags"].items() if name != "OUTSIDE_MASK"),
    ]
    if told is not None:
        limits = min(_flat(told["factors"])), max(_flat(told["factors"]))
        expected = f"expected error {100 * told['expected_error']:.2g} %"
        rows.append(("strengths told by the images", f"{limits[0]:.3g} to {limits[1]:.3g} times nominal, {expected}"))
    rows.extend(_light_rows(normals))
    if depth is not None:
        low, high = depth["range"]
        rows.append(
            ("depth", f"{depth['kind']} [{depth['unit']}] from {low:.4g} to {high:.4g}. {depth['outcome_text']}")
        )
    return rows


def _flat(numbers: list[Any]) -> list[float]:
    """Return the numbers of a list, or of lists in it, one after the other."""
    return [each for one in numbers for each in (one if isinstance(one, list) else [one])]


def _light_rows(normals: dict[str, Any]) -> list[tuple[str, ...]]:
    """Say how far to trust lights that come from the images."""
    refined, found = normals.get("lights_refined"), normals.get("lights_found")
    if refined is not None:
        done = "moved" if refined["changed"] else "left as they were"
        said = f"{refined['disagreement_deg']:.2g}° off, expected {refined['expected_error_deg']:.2g}°"
        return [("refined lights", f"{done}: the given ones are {said}")]
    if found is None:
        return []
    shape = f"{found['relief']} (clearness {abs(found['outwardness']):.2g}; the inverse shows the same images)"
    stands = f"surface basis stands out by {found['integrability_ratio']:.2g}, resolved by {found['ambiguity']}"
    return [("unknown lights", stands), ("relief", shape)]
