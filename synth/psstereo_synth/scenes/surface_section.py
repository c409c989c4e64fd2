"""The sections [surface], [material] and [albedo] of a scene file."""

from typing import Any

import numpy as np

from psstereo.brdf import BRDFS, Brdf, read_merl
from psstereo.errors import InputError, OptionError
from psstereo.io.toml_section import Section
from psstereo_synth.meshes import TriangleMesh, read_mesh
from psstereo_synth.patterns import PATTERNS, Constant, Pattern
from psstereo_synth.scenes.build import build_member, parameters
from psstereo_synth.scenes.material import Material
from psstereo_synth.scenes.values import positive, truth
from psstereo_synth.shapes import RELIEFS, HeightGrid, Relief, read_elevation

__all__ = ["read_material", "read_surface"]

_FITTED = 0.9
"""Half the longest side of a mesh, unless the file says otherwise; shapes are about as large [length]."""

_DIFFUSE = ("albedo", "diffuse")
"""What models call the albedo of their diffuse part."""


def read_surface(section: Section) -> tuple[Relief | TriangleMesh, float]:
    """Return the surface, and how far it reaches from the origin.

    Parameters
    ----------
    section : Section
        The table [surface].

    Returns
    -------
    surface : Relief or TriangleMesh
        What is photographed.
    reach : float
        Half the width of a picture that shows it [length].

    Raises
    ------
    PsstereoError
        If none or more than one is given, a name or key is unknown, a value means nothing, or a file cannot be used.
    """
    given = [key for key in ("shape", "elevation", "mesh") if key in section.values]
    if len(given) != 1:
        raise InputError(
            given=f"[surface] in {section.file.name} has {' and '.join(given) or 'no shape'}.",
            needed=f"One of shape ({', '.join(RELIEFS)}), elevation (a file) or mesh (a file).",
            remedy='Write shape = "hills", for instance.',
        )
    if given == ["shape"]:
        relief = build_member(RELIEFS, section, "shape", "shape")
        return relief, max(relief.extent) if isinstance(relief, HeightGrid) else 1.0
    if given == ["mesh"]:
        section.allow(("mesh", "scale", "smooth"))
        scale, smooth = positive(section, "scale", _FITTED), truth(section, "smooth", default=False)
        path = section.path("mesh")
        assert path is not None
        return read_mesh(path, smooth=smooth).centred(scale), scale / _FITTED
    section.allow(("elevation",))
    path = section.path("elevation")
    assert path is not None
    grid = read_elevation(path)
    return grid, max(grid.extent)


def read_material(section: Section, albedo: Section) -> Material:
    """Return what a surface is made of.

    Parameters
    ----------
    section : Section
        The table [material].
    albedo : Section
        The table [albedo].

    Returns
    -------
    Material
        Matte and of the albedo 0.7 if both are empty.

    Raises
    ------
    PsstereoError
        If a name or key is unknown, a value is missing or means nothing, or a file cannot be used.
    """
    name = section.choice("brdf", tuple(BRDFS)) or "lambert"
    pattern: Pattern = Constant(albedo=0.7)
    if albedo.values:
        pattern = build_member(PATTERNS, albedo, "pattern", "pattern")
    if name == "merl":
        return _measured(section, albedo)
    surplus = [key for key in _DIFFUSE if key in section.values]
    if surplus:
        raise OptionError(
            given=f"[material] in {section.file.name} has {surplus[0]}.",
            needed="Albedo has a table of its own, since it may vary over the surface.",
            remedy='Write [albedo], pattern = "constant" and albedo = 0.7 below it.',
        )
    model: type[Brdf] = BRDFS[name]
    values: dict[str, Any] = parameters(model, section, known=("brdf",), given=_DIFFUSE)
    _require_channels(section, values)
    material = Material(model=model, parameters=values, albedo=pattern)
    material.brdf(np.zeros((1, 3)))  # refuses what means nothing now rather than when it is rendered
    return material


def _measured(section: Section, albedo: Section) -> Material:
    """Return a measured reflectance."""
    section.allow(("brdf", "file"))
    path = section.path("file")
    if path is None:
        raise section.wrong("file", "the name of a MERL .binary file")
    if albedo.values:
        raise OptionError(
            given=f"{section.file.name} has a table [albedo] and a measured reflectance.",
            needed="A measured reflectance is the same everywhere and has its albedo in it.",
            remedy="Take the table [albedo] out.",
        )
    return Material(model=read_merl(path))


def _require_channels(section: Section, values: dict[str, Any]) -> None:
    """Refuse maps: a file holds one number, or one a channel."""
    for key, value in values.items():
        if getattr(value, "ndim", 0) > 1:
            raise section.wrong(key, "a number, or three for red, green and blue")
