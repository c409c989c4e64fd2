"""The page itself: what goes into it, and the template that it is made by."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.flags import FLAGS
from psstereo.normals.views import SampleViews
from psstereo.report.light_plot import light_plot
from psstereo.report.pictures import as_uri, coloured, contact_sheet, gray, normal_colours, shrunk
from psstereo.report.relight import relight_data
from psstereo.report.template import filled
from psstereo.results import DepthKind, DepthResult, NormalsResult, Step
from psstereo.types import FloatArray

__all__ = ["Map", "Report", "render_report"]

_SIDE = 640
"""Longer side of the pictures [px]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Map:
    """One more picture.

    Attributes
    ----------
    key, title : str
        Its name in the page, and what it shows.
    values : float array (h, w)
        Values, NaN where unknown [`unit`].
    unit : str
        Their unit.
    """

    key: str
    title: str
    values: FloatArray
    unit: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Report:
    """What a page shows.

    Attributes
    ----------
    name : str
        Of the capture.
    summary : str
        A sentence or two about the whole.
    normals : NormalsResult
        What came out.
    depth : DepthResult or None
        Depth, if it was wanted.
    steps : sequence of Step
        What was done and left out.
    figures : sequence of (str, str)
        More figures with their names.
    findings : sequence of mappings
        What is wrong with the capture: ``name``, ``severity``, ``figure``, ``sentence``, ``remedy``.
    assumptions : sequence of (str, str, str)
        What was taken though nothing tells it: what it is about, what it rests on, and a sentence.
    directions : float array (m, 3) or None
        Lights, with their `names`: toward distant ones, or toward lamps from the middle of the surface [1].
    lamps : bool
        Whether these are lamps at places.
    names : sequence of str
        Names of the images.
    image : float array (h, w) or None
        A single image, as linear brightness.
    albedo_known : bool
        Whether the albedo is one; if not it is left out, and the surface is shown in one shade.
    maps : sequence of Map
        More pictures.
    views : SampleViews or None
        Small images and residuals.
    errors : float array (h, w) or None
        Angular error against the truth, where one is known [rad].
    """

    name: str
    summary: str
    normals: NormalsResult
    depth: DepthResult | None = None
    steps: Sequence[Step] = ()
    figures: Sequence[tuple[str, str]] = ()
    findings: Sequence[Mapping[str, str]] = ()
    assumptions: Sequence[tuple[str, str, str]] = ()
    directions: FloatArray | None = None
    lamps: bool = False
    names: Sequence[str] = ()
    image: FloatArray | None = None
    albedo_known: bool = True
    maps: Sequence[Map] = ()
    views: SampleViews | None = None
    errors: FloatArray | None = None


def render_report(report: Report) -> str:
    """Return the page, complete in itself.

    Parameters
    ----------
    report : Report
        What it shows.

    Returns
    -------
    str
        HTML without any address of something else.
    """
    normals = report.normals
    views = report.views
    return filled(
        "page.html",
        name=report.name,
        summary=report.summary,
        findings=report.findings,
        assumptions=report.assumptions,
        steps=report.steps,
        figures=report.figures,
        relight=relight_data(normals.normals, _paint(report)),
        painted=report.albedo_known,
        lamps=report.lamps,
        lights=None if report.directions is None else light_plot(report.directions, report.names),
        pictures=list(_pictures(report)),
        flags=_flags(normals),
        sheet=None if views is None else as_uri(contact_sheet(views.images)),
    )


def _pictures(report: Report) -> Iterable[dict[str, Any]]:
    """Yield each picture with its title and what its colours mean."""
    normals = report.normals
    yield _picture("normals", "Normals", normal_colours(shrunk(normals.normals, _SIDE)))
    if report.albedo_known:
        albedo = normals.albedo
        albedo = albedo.mean(axis=2) if albedo.ndim == 3 and albedo.shape[2] != 3 else albedo
        yield _picture("albedo", f"Albedo, {normals.albedo_kind.value}", gray(shrunk(albedo, _SIDE)))
    if report.image is not None:
        yield _picture("image", "The image, linear brightness", gray(shrunk(report.image, _SIDE)))
    if report.depth is not None:
        sign = -1.0 if report.depth.kind is DepthKind.DISTANCE else 1.0
        shown, low, high = coloured(sign * shrunk(report.depth.depth, _SIDE))
        ends = f"{sign * low:.4g} (dark) to {sign * high:.4g} (bright) {report.depth.unit}"
        yield _picture("depth", report.depth.kind.value.capitalize(), shown, ends)
    if np.isfinite(normals.uncertainty).any():
        yield _scaled("uncertainty", "Expected error of the normals", np.degrees(normals.uncertainty), "°")
    if report.errors is not None:
        yield _scaled("errors", "Error of the normals against the truth", np.degrees(report.errors), "°")
    if report.views is not None and np.isfinite(report.views.residual).any():
        yield _scaled("residual", "Deviation from a matte surface", 100.0 * report.views.residual, " %")
    for more in report.maps:
        shown, low, high = coloured(shrunk(more.values, _SIDE))
        scale = f"{low:.3g} (dark) to {high:.3g} (bright) {more.unit}"
        yield _picture(more.key, more.title, shown, scale)
    count = _bits(normals)
    yield _scaled("flags", "Flags a pixel carries", np.where(count > 0, count, np.nan), "")


def _paint(report: Report) -> FloatArray:
    """Return the albedo, or a shade that leaves room for light."""
    normals = report.normals
    if report.albedo_known:
        return normals.albedo
    return np.where(np.isfinite(normals.normals).all(axis=2), 1.0, np.nan)


def _scaled(key: str, title: str, values: FloatArray, unit: str) -> dict[str, Any]:
    shown, low, high = coloured(shrunk(values, _SIDE), low=0.0)
    return _picture(key, title, shown, f"{low:.3g}{unit} (dark) to {high:.3g}{unit} (bright)")


def _picture(key: str, title: str, pixels: Any, scale: str = "") -> dict[str, Any]:
    return {"key": key, "title": title, "uri": as_uri(pixels), "scale": scale}


def _bits(normals: NormalsResult) -> FloatArray:
    """Return how many flags each pixel carries, being outside the mask not among them."""
    inside = [info.flag for info in FLAGS if info.flag.name != "OUTSIDE_MASK"]
    return np.asarray(np.sum([(normals.flags & np.uint16(flag)) != 0 for flag in inside], axis=0), np.float64)


def _flags(normals: NormalsResult) -> list[dict[str, Any]]:
    found = []
    for info in FLAGS:
        count = int(np.count_nonzero(normals.flags & np.uint16(info.flag)))
        if count:
            found.append({"name": info.flag.name, "count": count, "sentence": info.sentence})
    return found
