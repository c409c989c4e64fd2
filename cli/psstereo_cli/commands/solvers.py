"""``psstereo solvers``: the methods for normals, what each needs and assumes, and when not to use it."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import Json

if TYPE_CHECKING:
    from psstereo.normals import NormalSolver

__all__ = ["solvers"]


def solvers(
    name: Annotated[str | None, typer.Argument(help="Solver whose options are wanted; all solvers if absent.")] = None,
    as_json: Json = False,
) -> None:
    """List the solvers, or the options of one.

    Example: `psstereo solvers least-squares`

    And then `psstereo reconstruct photos -o result --solver least-squares --option gate=none`
    """
    from psstereo.catalogue import choose
    from psstereo.normals import NORMAL_SOLVERS
    from psstereo_cli.console import print_json

    if name is None:
        facts = {key: _facts(solver) for key, solver in NORMAL_SOLVERS.items()}
        if as_json:
            print_json(facts)
        else:
            _print_all(facts)
        return
    solver = choose(NORMAL_SOLVERS, name, "solver")
    if as_json:
        print_json({"name": name, **_facts(solver)})
    else:
        _print_one(name, _facts(solver))


def _facts(solver: "type[NormalSolver[Any]]") -> dict[str, Any]:
    from dataclasses import asdict

    from psstereo.method_options import options_of

    return {
        "summary": solver.summary,
        "assumes": solver.assumes,
        "avoid": solver.avoid,
        "least_lights": solver.least_lights,
        "pays_from": solver.pays_from,
        "options": [asdict(option) for option in options_of(solver)],
    }


def _print_all(facts: dict[str, dict[str, Any]]) -> None:
    from psstereo_cli.console import print_table, say

    rows = [
        (
            name,
            one["summary"],
            one["assumes"],
            str(one["least_lights"]),
            str(one["pays_from"]),
            one["avoid"],
        )
        for name, one in facts.items()
    ]
    columns = ("solver", "what it does", "assumes that", "least lights", "pays from", "avoid it when")
    print_table("solvers for normals", rows, columns)
    say("From so many lights it pays: with fewer, least-squares is as good or better.")
    say("psstereo solvers NAME lists the options of one.")


def _print_one(name: str, facts: dict[str, Any]) -> None:
    from psstereo_cli.console import print_table, say

    rows = [
        ("what it does", facts["summary"]),
        ("assumes that", facts["assumes"]),
        ("avoid it when", facts["avoid"]),
        ("least lights", str(facts["least_lights"])),
        ("pays from", f"{facts['pays_from']} lights"),
    ]
    print_table(f"solver {name}", rows)
    options = [
        (one["name"], one["kind"], "none" if one["default"] is None else str(one["default"]), one["meaning"])
        for one in facts["options"]
    ]
    print_table("its options", options, ("option", "value", "default", "meaning"))
    say(f"psstereo reconstruct FOLDER -o OUT --solver {name} --option KEY=VALUE")
