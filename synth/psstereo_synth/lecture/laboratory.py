"""A virtual laboratory that measures reflectance, one direction of the light and one of the eye at a time."""

from itertools import combinations_with_replacement

import numpy as np

from psstereo.brdf import Ggx, Lambert, OrenNayar
from psstereo_synth.lecture.dome import dome, measure
from psstereo_synth.lecture.example import Cell, Example, largest_of, largest_relative
from psstereo_synth.lecture.statements import STATEMENTS

__all__ = ["laboratory"]

_ANGLES = ((0.0, 0.0), (50.0, 0.0), (55.0, 180.0), (80.0, 100.0))
"""Angle to the normal and azimuth of the places on the dome [deg]."""


def laboratory() -> Example:
    """Measure three materials from pairs of directions, and with lamp and camera exchanged.

    *Statement.* A sample is lit from one direction l only, and looked at from one direction v only. The radiance
    that the camera sees over the irradiance that the sample receives is the reflectance ρ(l, v) [sr⁻¹]. The lamp's
    cosine is part of the irradiance and so divides out. If lamp and camera change places, ρ is the same (Helmholtz
    reciprocity). A matte sample of albedo a has ρ = a/π for every pair.

    *Where it stops being true.* Real lamps and cameras have an extent and give a mean of ρ over it: a highlight
    narrower than that is measured too low. ρ may vary by thousands from pair to pair, so a few pairs say little about
    the others. Reciprocity is about ρ: radiances do not stay when places are changed, the cosines differ. And
    some models in use, such as Phong's first one, violate it.

    Returns
    -------
    Example
        The errors are relative: of ρ against the model's own formula, and against ρ with lamp and camera exchanged.
    """
    samples = {
        "matte": Lambert(albedo=np.array([0.6])),
        "rough": OrenNayar(albedo=np.array([0.6]), roughness=np.array([0.5])),
        "glossy": Ggx(albedo=np.array([0.3]), f0=np.array([0.05]), roughness=np.array([0.3])),
    }
    ways = [dome(*pair) for pair in _ANGLES]
    rows: list[tuple[Cell, ...]] = []
    error = 0.0
    for name, brdf in samples.items():
        found = measure(brdf, ways, ways)
        for i, j in combinations_with_replacement(range(len(ways)), 2):
            model = float(brdf.evaluate(np.array([0.0, 0.0, 1.0]), ways[i], ways[j])[0])
            pair = [float(found[i, j]), float(found[j, i])]
            error = largest_of(error, largest_relative(pair, [model, model]))
            places = [f"{tilt:g} / {turn:g}" for tilt, turn in (_ANGLES[i], _ANGLES[j])]
            rows.append((name, *places, pair[0], pair[1], model))
    tolerance = 1e-11
    return Example(
        title="A reflectance laboratory",
        statement=STATEMENTS["laboratory"],
        columns=("sample", "lamp at [deg]", "camera at [deg]", "ρ [sr⁻¹]", "ρ exchanged [sr⁻¹]", "model [sr⁻¹]"),
        rows=tuple(rows),
        largest_error=error,
        tolerance=tolerance,
        holds=error <= tolerance,
        notes=("angle to the normal / azimuth",),
    )
