"""``psstereo solvers``: the methods of each family, what each needs and assumes, and when not to use it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import Json

if TYPE_CHECKING:
    from psstereo.normals import NormalSolver

__all__ = ["solvers"]

_USE = {
    "normals": "psstereo reconstruct FOLDER -o OUT --solver {name} --option KEY=VALUE",
    "depth": "psstereo integrate NORMALS -o OUT --integrator {name} --option KEY=VALUE",
    "shading": "psstereo sfs IMAGE -o OUT --method {name} --option KEY=VALUE",
}
"""How a member of each family is asked for."""


def solvers(
    name: Annotated[str | None, typer.Argument(help="Method whose options are wanted; all if absent.")] = None,
    family: Annotated[
        str,
        typer.Option(
            "--for", help="What they find: normals from several lights, depth from normals, or shading for one image."
        ),
    ] = "normals",
    as_json: Json = False,
) -> None:
    """List the methods, or the options of one.

    Example: `psstereo solvers least-squares`

    And then `psstereo reconstruct photos -o result --solver least-squares --option gate=none`

    From normals to depth: `psstereo solvers --for depth`
    """
    from psstereo.catalogue import choose
    from psstereo_cli.console import print_json

    methods = _methods(family)
    if name is None:
        facts = {key: _facts(method) for key, method in methods.items()}
        if as_json:
            print_json(facts)
        elif family == "normals":
            _print_solvers(facts)
        else:
            _print_methods(family, facts)
        return
    method = choose(methods, name, "solver" if family == "normals" else "method")
    if as_json:
        print_json({"name": name, **_facts(method)})
    else:
        _print_one(family, name, _facts(method))


def _methods(family: str) -> Mapping[str, type[Any]]:
    from psstereo.catalogue import choose

    choose(_USE, family, "family of methods")
    if family == "depth":
        from psstereo.depth import INTEGRATORS

        return INTEGRATORS
    if family == "shading":
        from psstereo.sfs import SHADING_METHODS

        return SHADING_METHODS
    from psstereo.normals import NORMAL_SOLVERS

    return NORMAL_SOLVERS


def _facts(method: type[Any]) -> dict[str, Any]:
    from dataclasses import asdict

    from psstereo.method_options import options_of
    from psstereo.normals import NormalSolver

    own = _solver_facts(method) if issubclass(method, NormalSolver) else {}
    return {"summary": method.summary, **own, "options": [asdict(option) for option in options_of(method)]}


def _solver_facts(solver: "type[NormalSolver[Any]]") -> dict[str, Any]:
    return {
        "assumes": solver.assumes,
        "avoid": solver.avoid,
        "least_lights": solver.least_lights,
        "pays_from": solver.pays_from,
    }


def _print_solvers(facts: dict[str, dict[str, Any]]) -> None:
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
    say("psstereo solvers NAME lists the options of one; --for depth and --for shading list other methods.")


def _print_methods(family: str, facts: dict[str, dict[str, Any]]) -> None:
    from psstereo_cli.console import print_table, say

    rows = [(name, one["summary"]) for name, one in facts.items()]
    print_table(f"methods for {family}", rows, ("method", "what it does"))
    say(f"psstereo solvers NAME --for {family} lists the options of one.")


def _print_one(family: str, name: str, facts: dict[str, Any]) -> None:
    from psstereo_cli.console import print_table, say

    rows = [("what it does", facts["summary"])]
    if family == "normals":
        rows += [
            ("assumes that", facts["assumes"]),
            ("avoid it when", facts["avoid"]),
            ("least lights", str(facts["least_lights"])),
            ("pays from", f"{facts['pays_from']} lights"),
        ]
    print_table(f"{'solver' if family == 'normals' else 'method'} {name}", rows)
    options = [
        (one["name"], one["kind"], "none" if one["default"] is None else str(one["default"]), one["meaning"])
        for one in facts["options"]
    ]
    if options:
        print_table("its options", options, ("option", "value", "default", "meaning"))
    say(_USE[family].format(name=name))
