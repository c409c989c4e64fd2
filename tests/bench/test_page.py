"""The page of a suite: complete in itself, every name in it once, and all that was measured on it."""

import math
import re
from html.parser import HTMLParser

import pytest

from psstereo.bench import Summary
from psstereo.bench.folder import bench_content, write_bench
from psstereo.bench.plots import draw
from psstereo.bench.sweep import Sweep
from psstereo.bench.tables import declines_of, remarks_of, tables_of

_VOID = {"meta", "img", "br"}


class Outline(HTMLParser):
    """Takes a page apart, complains where tags do not match, and notes names and what refers to them."""

    def __init__(self):
        super().__init__()
        self.open, self.names, self.addresses, self.cells, self.tags = [], [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        found = dict(attributes)
        self.names += [found["id"]] if "id" in found else []
        self.addresses += [found[key] for key in ("src", "href") if key in found]
        self.addresses += [address for value in found.values() for address in re.findall(r"url\((.*?)\)", value or "")]
        if tag not in _VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in _VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in {"td", "th", "h1", "h3", "li", "code"}:
            self.cells.append(data)


def summary(problem, method, seconds, *, declined=None, **error):
    lost = declined is not None
    return Summary(
        problem=problem,
        method=method,
        seconds=math.nan if lost else seconds,
        ratio=math.nan if lost else seconds / 0.5,
        error=error,
        spread=0.0 if lost else 0.02,
        declined=declined,
    )


@pytest.fixture(scope="module")
def measured():
    grown = {f"{n} lights": float(n) for n in (8, 16, 32)}
    found = [summary("matte", "plain", 0.5, mean_deg=2.0), summary("matte", "thorough", 1.0, mean_deg=0.25)]
    found += [
        summary(p, m, n * k / 64, mean_deg=4 / n) for p, n in grown.items() for k, m in ((1, "plain"), (2, "slow"))
    ]
    found.append(summary("8 lights", "shy <b>", 0, declined="There are 8 lights. It needs 20 & more."))
    sweeps = [
        Sweep(title="hills", axis="lights", values=grown),
        Sweep(title="growth", axis="count", values=grown, measure="seconds"),
    ]
    return found, sweeps


@pytest.fixture(scope="module")
def told(measured):
    found, sweeps = measured
    facts = {"notes": ["Images are in memory."]}
    return bench_content("normals", found, baseline="plain", threads=2, repeats=3, sweeps=sweeps, facts=facts)


@pytest.fixture(scope="module")
def page(measured, told, tmp_path_factory):
    folder = tmp_path_factory.mktemp("page") / "plots"
    figures = draw("normals", *measured)
    files = write_bench(folder, told, figures, command="psstereo bench normals --repeats 3")
    assert {name.removesuffix(".svg") for name in files if name.endswith(".svg")} == {
        "error_time", "error_lights", "time_count",
    }  # fmt: skip
    return (folder / "report.html").read_text(encoding="utf-8")


def test_the_page_is_complete_in_itself_and_every_name_in_it_is_its_own(page):
    outline = Outline()
    outline.feed(page)
    assert outline.open == []
    assert "http" not in page
    assert outline.addresses
    assert all(address.startswith("#") for address in outline.addresses)
    assert {address[1:] for address in outline.addresses} <= set(outline.names)
    assert len(outline.names) == len(set(outline.names))
    assert outline.tags.count("svg") == 3
    assert {"plots", "tables", "declines", "where", "plot-error_time", "plot-error_lights"} <= set(outline.names)


def test_all_that_was_measured_is_on_it(page, told):
    outline = Outline()
    outline.feed(page)
    cells = outline.cells
    assert {"500.0 ms ± 10.0", "1000.0 ms ± 10.0", "2°", "0.25°", "2.000"} <= set(cells)
    assert {"shy <b>", "8 lights", "There are 8 lights. It needs 20 & more."} <= set(cells)
    assert "<b>" not in page
    assert "psstereo bench normals --repeats 3" in cells
    assert "Images are in memory." in cells
    assert {told["versions"]["numpy"], told["machine"]["architecture"]} <= set(cells)


def test_tables_are_those_of_the_measurements(told):
    first, by_lights, growth = tables_of(told)
    assert first.columns == ("problem", "method", "time", "ratio", "mean")
    assert [row[:2] for row in first.rows] == [("matte", "plain"), ("matte", "thorough")]
    assert "«plain»" in first.note
    assert by_lights.columns == ("method", "8", "16", "32")
    assert {row[0]: row[1:] for row in by_lights.rows}["shy <b>"] == ("declined", "", "")
    assert {row[0]: row[1:] for row in by_lights.rows}["plain"] == ("0.5", "0.25", "0.12")
    assert growth.columns[-1] == "slope"
    assert growth.rows[0][-1] == "1.00 ± 0.00"
    (decline,) = declines_of(told)
    assert (decline.method, decline.problems) == ("shy <b>", ("8 lights",))
    assert remarks_of(told) == ["Images are in memory."]


def test_a_suite_may_bring_a_table_of_its_own():
    table = {"title": "verdicts", "columns": ["case", "verdict"], "rows": [["one", "pass"]]}
    content = bench_content(
        "stress", [summary("p", "m", 1.0)], baseline=None, threads=1, repeats=1, facts={"table": table}
    )
    (found,) = tables_of(content)
    assert (found.title, found.columns, found.rows) == (
        "suite stress: verdicts",
        ("case", "verdict"),
        (("one", "pass"),),
    )
