"""Plans in files: JSON that a person can read, edit, and run again."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from psstereo.errors import InputError, MissingFileError, PsstereoError, UnreadableFileError
from psstereo.plan.facts import Facts
from psstereo.plan.plain import from_plain, to_plain
from psstereo.plan.plan import Plan
from psstereo.plan.predict import Prediction
from psstereo.plan.stage import Decision
from psstereo.plan.stages.catalogue import STAGES

__all__ = ["SCHEMA", "plan_record", "read_plan", "write_plan"]

SCHEMA = 1
"""Number of the files' present form."""
_LARGEST = 4_000_000
"""Size beyond which a file is no plan [byte]."""


def plan_record(plan: Plan) -> dict[str, Any]:
    """Return a plan as plain data.

    Parameters
    ----------
    plan : Plan
        The plan.

    Returns
    -------
    dict
        For JSON: schema, stages, facts, prediction.
    """
    stages = [
        {
            "name": one.stage,
            "use": one.use,
            "options": to_plain(one.options),
            "reason": one.reason,
            "figure": one.figure,
        }
        for one in plan.decisions
    ]
    predicted = None if plan.prediction is None else to_plain(plan.prediction)
    return {"schema": SCHEMA, "stages": stages, "facts": to_plain(plan.facts), "predicted": predicted}


def write_plan(path: Path, plan: Plan) -> None:
    """Write a plan; the file appears whole or not at all.

    Parameters
    ----------
    path : Path
        The file.
    plan : Plan
        The plan.

    Raises
    ------
    MissingFileError
        If the file cannot be written there.
    """
    partial = path.with_name(f".{path.name}.part")
    try:
        partial.write_text(json.dumps(plan_record(plan), indent=1, ensure_ascii=False, allow_nan=False) + "\n", "utf-8")
        partial.replace(path)
    except OSError as error:
        raise MissingFileError(
            given=f"{path} cannot be written ({error.strerror or error}).",
            needed="A folder that exists and can be written to.",
            remedy="Choose another place.",
        ) from None
    finally:
        partial.unlink(missing_ok=True)


def read_plan(path: Path) -> Plan:
    """Read a plan and check every entry.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Plan
        The plan; whether it fits a capture shows when it is run.

    Raises
    ------
    MissingFileError, UnreadableFileError
        If the file is not there, or no JSON.
    InputError
        If an entry is missing, unknown or wrong.
    """
    content = _json(path)
    where = path.name
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        schema = content.get("schema") if isinstance(content, dict) else None
        raise InputError(
            given=f"{where} has the schema {str(schema)[:20]}.",
            needed=f"A plan of schema {SCHEMA}.",
            remedy="Make it with psstereo plan CAPTURE -o plan.json.",
        )
    strange = sorted(set(content) - {"schema", "stages", "facts", "predicted"})
    if strange:
        raise _wrong(where, f"the entry {strange[0]!r} is unknown")
    facts = from_plain(Facts, content.get("facts"), f"facts of {where}")
    predicted = content.get("predicted")
    prediction = None if predicted is None else from_plain(Prediction, predicted, f"predicted of {where}")
    return Plan(facts=facts, decisions=_stages(content.get("stages"), where), prediction=prediction)


def _json(path: Path) -> Any:
    try:
        if path.stat().st_size > _LARGEST:
            raise ValueError("it is too large")
        return json.loads(path.read_text("utf-8"), parse_constant=_refuse_constant)
    except FileNotFoundError:
        raise MissingFileError(
            given=f"{path} does not exist.",
            needed="A plan.",
            remedy="Make it with psstereo plan CAPTURE -o plan.json.",
        ) from None
    except (OSError, ValueError, RecursionError) as error:
        raise UnreadableFileError(
            given=f"{path} cannot be read as a plan ({str(error)[:80]}).",
            needed="A JSON file as psstereo plan writes it.",
            remedy="Correct it, or make the plan anew.",
        ) from None


def _refuse_constant(word: str) -> float:
    raise ValueError(f"{word} is no number of JSON")


def _stages(data: Any, where: str) -> tuple[Decision, ...]:
    if not isinstance(data, list):
        raise _wrong(where, "it has no list of stages")
    found: dict[str, Decision] = {}
    for entry in data:
        one = _stage(entry, where)
        if one.stage in found:
            raise _wrong(where, f"the stage {one.stage} is there twice")
        found[one.stage] = one
    missing = [name for name in STAGES if name not in found]
    if missing:
        raise _wrong(where, f"the stage {missing[0]} is missing")
    return tuple(found[name] for name in STAGES)


def _stage(entry: Any, where: str) -> Decision:
    if not isinstance(entry, Mapping) or not isinstance(entry.get("name"), str):
        raise _wrong(where, "a stage has no name")
    name, use, options = entry["name"], entry.get("use"), entry.get("options", {})
    if name not in STAGES:
        raise _wrong(where, f"the stage {name[:40]!r} is unknown; known are {', '.join(STAGES)}")
    strange = sorted(set(entry) - {"name", "use", "options", "reason", "figure"})
    if strange:
        raise _wrong(where, f"the entry {strange[0]!r} of the stage {name} is unknown")
    if not isinstance(use, bool):
        raise _wrong(where, f"use of the stage {name} is {str(use)[:20]!r} and must be true or false")
    if not isinstance(options, dict):
        raise _wrong(where, f"the options of the stage {name} are no object")
    unknown = sorted(set(options) - set(STAGES[name].keys))
    if unknown:
        known = ", ".join(STAGES[name].keys) or "none"
        raise _wrong(where, f"the option {unknown[0]!r} of the stage {name} is unknown; known are {known}")
    if options and not use:
        raise _wrong(where, f"the stage {name} is left out and has options")
    texts = {key: entry.get(key, "") for key in ("reason", "figure")}
    if not all(isinstance(text, str) for text in texts.values()):
        raise _wrong(where, f"reason and figure of the stage {name} must be texts")
    return Decision(stage=name, use=use, options=options, **texts)


def _wrong(where: str, what: str) -> PsstereoError:
    return InputError(
        given=f"In {where} {what}.",
        needed="A plan as psstereo plan writes it, with stages turned on or off and options changed.",
        remedy="Correct it, or make the plan anew.",
    )
