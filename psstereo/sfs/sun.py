"""What the methods for a single sun share: the shading that it must have caused, and heights made into a solution."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from psstereo.camera import Orthographic
from psstereo.errors import InputError
from psstereo.flags import Flag
from psstereo.lights import Directional
from psstereo.results import DepthKind, DepthResult
from psstereo.sfs.assumption import Assumption
from psstereo.sfs.image import ShadedImage
from psstereo.sfs.method import ShadingSolution
from psstereo.sfs.singular import label_components
from psstereo.types import BoolArray, FlagArray, FloatArray

__all__ = ["Sunlit", "solution_from_heights", "sunlit"]

_ROUNDING = 1e-6
"""What brightness may exceed the light's strength by without being called impossible [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sunlit:
    """An image under one distant light, as shading.

    Attributes
    ----------
    shading : float64 array (h, w)
        Cosine between normal and light, from 0 to 1; 0 outside [1].
    direction : float64 array (3,)
        Toward the light [1].
    inside : bool array (h, w)
        Pixels of the surface.
    flags : uint16 array (h, w)
        ``OVER_BRIGHT`` and ``UNLIT`` where they hold.
    """

    shading: FloatArray
    direction: FloatArray
    inside: BoolArray
    flags: FlagArray


def sunlit(image: ShadedImage) -> Sunlit:
    """Return the shading of an image under a :class:`~psstereo.lights.Directional` light.

    Parameters
    ----------
    image : ShadedImage
        The image.

    Returns
    -------
    Sunlit
        Shading and flags.

    Raises
    ------
    InputError
        If no pixel receives light.
    """
    light = cast(Directional, image.light)  # what the methods' `lights` say
    strength = float(light.strength[0])
    inside, irradiance = image.inside, image.irradiance
    with np.errstate(invalid="ignore"):
        bright, dark = inside & (irradiance > strength * (1.0 + _ROUNDING)), inside & (irradiance <= 0.0)
    if strength <= 0 or bool((dark == inside).all()):
        raise InputError(
            given=f"None of {int(np.count_nonzero(inside))} pixels receives light; its strength is {strength:g}.",
            needed="Shading: at least one pixel that is brighter than the ambient level.",
            remedy="Check image, mask and ambient level.",
        )
    flags = np.zeros(inside.shape, np.uint16)
    flags[bright] |= np.uint16(Flag.OVER_BRIGHT)
    flags[dark] |= np.uint16(Flag.UNLIT)
    shading = np.clip(np.where(inside, irradiance, 0.0) / strength, 0.0, 1.0)
    return Sunlit(shading=shading, direction=np.asarray(light.direction, np.float64), inside=inside, flags=flags)


def solution_from_heights(
    heights: FloatArray,
    sun: Sunlit,
    image: ShadedImage,
    assumptions: tuple[Assumption, ...],
    *,
    iterations: int = 0,
    residual: float = 0.0,
    converged: bool = True,
    facts: Mapping[str, Any] | None = None,
) -> ShadingSolution:
    """Return a solution whose normals are those of its heights.

    Parameters
    ----------
    heights : float64 array (h, w)
        Heights; their mean over each component becomes 0 [pixel sides].
    sun : Sunlit
        The shading that they explain.
    image : ShadedImage
        The image.
    assumptions : tuple of Assumption
        What the method assumed.
    iterations, residual, converged, facts
        As in :class:`~psstereo.results.DepthResult` and :class:`~psstereo.sfs.method.ShadingSolution`.

    Returns
    -------
    ShadingSolution
        The solution; the brightness misfit of its normals is among the facts.
    """
    from psstereo.depth.from_depth import normals_from_depth

    components = label_components(sun.inside)
    labels = components[sun.inside]
    sums, counts = np.bincount(labels, heights[sun.inside]), np.maximum(np.bincount(labels), 1)
    settled = np.full(heights.shape, np.nan)
    pixel = cast(Orthographic, image.camera).pixel_size  # what the methods' `cameras` say
    settled[sun.inside] = pixel * (heights[sun.inside] - (sums / counts)[labels])
    normals = normals_from_depth(settled, image.camera)
    known = sun.inside & np.isfinite(normals).all(axis=-1)
    told = np.maximum(normals[known] @ sun.direction, 0.0) - sun.shading[known]
    misfit = float(np.sqrt(np.mean(told * told))) if told.size else float("nan")
    depth = DepthResult(
        depth=settled,
        kind=DepthKind.HEIGHT,
        unit=image.camera.unit,
        components=components,
        iterations=iterations,
        residual=residual,
    )
    return ShadingSolution(
        normals=normals,
        depth=depth,
        flags=sun.flags,
        assumptions=assumptions,
        converged=converged,
        facts={"brightness_misfit": misfit, "iterations": iterations, **(facts or {})},
    )
