"""The schema of benchmark records: what is written comes back, and what is not of the schema is refused."""

import json
from dataclasses import fields

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.bench import SCHEMA, Record, read_records, write_records
from psstereo.errors import InputError

PLAIN = Record(suite="s", problem="p", method="m", repeat=0, seconds={"total": 0.5}, memory=1000)

_numbers = st.dictionaries(st.text(max_size=8), st.floats(allow_nan=False, allow_infinity=False), max_size=4)


@settings(max_examples=40, deadline=None)
@given(
    st.text(),
    st.integers(0, 10**6),
    _numbers,
    _numbers,
    st.dictionaries(st.text(max_size=8), st.integers(), max_size=3),
    st.none() | st.integers(0, 2**60),
)
def test_a_record_comes_back(name, repeat, seconds, error, sizes, memory):  # noqa: PLR0917
    record = Record(
        suite=name, problem=name, method=name, repeat=repeat,
        seconds={**seconds, "total": 1.5}, error=error, sizes=sizes, memory=memory,
    )  # fmt: skip
    line = record.to_json()
    assert "\n" not in line
    assert Record.from_json(line) == record


def test_the_fields_are_frozen():
    assert [f.name for f in fields(Record)] == [
        "suite", "problem", "method", "repeat", "seconds", "error", "sizes", "memory", "declined",
        "versions", "machine", "schema",
    ]  # fmt: skip
    assert SCHEMA == 2
    content = json.loads(PLAIN.to_json())
    assert content["schema"] == 2
    assert {"python", "psstereo", "numpy"} <= set(content["versions"])
    assert set(content["machine"]) == {"system", "architecture", "processors"}


def test_files_hold_one_record_a_line(tmp_path):
    path = tmp_path / "records.jsonl"
    records = [PLAIN, Record(suite="ü", problem="p\nq", method="m", repeat=1, seconds={"total": 1})]
    write_records(path, records)
    assert len(path.read_text(encoding="utf-8").splitlines()) == 2
    assert read_records(path) == records
    path.write_text("\n" + path.read_text(encoding="utf-8") + "\n\n", encoding="utf-8")
    assert read_records(path) == records


def test_who_declines_has_a_reason_and_no_figures():
    record = Record(suite="s", problem="p", method="m", repeat=0, seconds={}, declined="There are 3 lights.")
    assert Record.from_json(record.to_json()) == record


def changed(**entries):
    return json.dumps(json.loads(PLAIN.to_json()) | entries)


def without(key):
    content = json.loads(PLAIN.to_json())
    del content[key]
    return json.dumps(content)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("rubbish", "Expecting value"),
        ("", "Expecting value"),
        ("[1, 2]", "no object"),
        ("null", "no object"),
        (changed(schema=1), "schema 1"),
        (json.dumps({"schema": 3, "other": "fields"}), "schema 3"),
        (changed(schema=None), "schema None"),
        (without("suite"), "suite"),
        (without("machine"), "machine"),
        (changed(colour="red"), "colour"),
        (changed(suite=3), "wrong type"),
        (changed(repeat="0"), "wrong type"),
        (changed(repeat=True), "wrong type"),
        (changed(seconds={"read": 1.0}), "total"),
        (changed(seconds=[1.0]), "wrong type"),
        (changed(seconds={"total": "1"}), "wrong type"),
        (changed(seconds={"total": True}), "wrong type"),
        (changed(seconds={"total": float("nan")}), "wrong type"),
        (changed(error={"mean_deg": None}), "wrong type"),
        (changed(sizes=3), "wrong type"),
        (changed(memory="much"), "wrong type"),
        (changed(versions=[]), "wrong type"),
        (changed(machine="this one"), "wrong type"),
        (changed(declined=""), "wrong type"),
        (changed(declined=True), "wrong type"),
        (changed(declined="too few lights"), "yet it has figures"),
        (changed(declined="too few lights", seconds={}, error={"mean_deg": 1.0}), "yet it has figures"),
        (without("declined"), "declined"),
    ],
)
def test_what_is_no_record_is_refused(line, why):
    with pytest.raises(InputError, match=why) as caught:
        Record.from_json(line)
    assert "schema 2" in caught.value.needed


def test_a_number_that_json_lacks_is_not_written(tmp_path):
    write_records(tmp_path / "records.jsonl", [PLAIN])
    bad = Record(suite="s", problem="p", method="m", repeat=0, seconds={"total": float("nan")})
    with pytest.raises(ValueError, match="JSON"):
        write_records(tmp_path / "records.jsonl", [PLAIN, bad])
    assert read_records(tmp_path / "records.jsonl") == [PLAIN]  # the earlier file stays
    assert [p.name for p in tmp_path.iterdir()] == ["records.jsonl"]
