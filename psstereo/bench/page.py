"""The page of a suite: its plots, tables and refusals in one file of HTML that opens without a network."""

import re
from collections.abc import Mapping
from typing import Any

from psstereo.bench.tables import declines_of, remarks_of, tables_of
from psstereo.report.template import filled

__all__ = ["bench_page", "inline_svg"]


def bench_page(content: Mapping[str, Any], plots: Mapping[str, str], *, command: str | None = None) -> str:
    """Return the page, complete in itself.

    Parameters
    ----------
    content : mapping
        Of :func:`psstereo.bench.folder.bench_content`, or of ``bench.json``.
    plots : mapping
        SVG files as text, by name.
    command : str, optional
        By which anyone measures it again; of suite, rounds and threads alone if absent.

    Returns
    -------
    str
        HTML without any address of something else.
    """
    suite, repeats, threads = content["suite"], content["repeats"], content["threads"]
    problems = len({row["problem"] for row in content["rows"]})
    methods = len({row["method"] for row in content["rows"]})
    parts = (_count(methods, "method"), _count(problems, "problem"), _count(repeats, "round"))
    summary = f"{parts[0]} on {parts[1]}, {parts[2]} on {_count(threads, 'thread')}"
    summary += "." if content["baseline"] is None else f"; ratios refer to {content['baseline']}."
    where = [*content["versions"].items(), *content["machine"].items()]
    if content["memory"] is not None:
        where.append(("largest memory", f"{content['memory'] / 1e6:.0f} MB"))
    return filled(
        "page.html",
        package="psstereo.bench",
        suite=suite,
        summary=summary,
        command=command or f"psstereo bench {suite} --repeats {repeats} --threads {threads} --plots FOLDER",
        plots=[
            {"name": name, "svg": inline_svg(text, f"p{place}-")} for place, (name, text) in enumerate(plots.items())
        ],
        remarks=remarks_of(content),
        tables=tables_of(content),
        declines=declines_of(content),
        where=where,
    )


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")


def inline_svg(text: str, prefix: str) -> str:
    """Return an SVG file as an element of a page, at half its length.

    Parameters
    ----------
    text : str
        The file, as matplotlib writes it with letters as letters; their typeface is left to the page.
    prefix : str
        Put before every name within it, since several drawings of one page share one space of names.

    Returns
    -------
    str
        ``<svg …>…</svg>`` without declarations, comments, metadata, addresses, and names that nothing refers to;
        coordinates to a hundredth of a point.
    """
    body = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text[text.index("<svg") :], flags=re.DOTALL)
    body = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", body)
    wanted = set(re.findall(r'(?:href="|url\()#([^")]+)', body))
    body = re.sub(r'\sid="([^"]+)"', lambda found: f' id="{prefix}{found[1]}"' if found[1] in wanted else "", body)
    body = re.sub(r'(href="|url\()#', rf"\1#{prefix}", body)
    # in HTML the prefix means nothing, and the plain attribute does the same
    body = body.replace("xlink:href=", "href=")
    body = re.sub(r'\s(d|x|y)="[^"]*"', lambda found: re.sub(r"(\.\d\d)\d+|\s+(?=\")", r"\1", found[0]), body)
    body = re.sub(r'\sstyle="[^"]*"', lambda found: re.sub(r"([:;])\s+|font-family:[^;\"]*;?", r"\1", found[0]), body)
    return re.sub(r">\s+<", "><", re.sub(r"\s+", " ", body))
