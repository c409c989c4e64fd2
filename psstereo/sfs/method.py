"""The interface of shape from shading: one image in, normals and depth out, with every assumption named."""

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

import numpy as np

from psstereo.camera import Camera
from psstereo.errors import InputError, UnsupportedError
from psstereo.flags import Flag
from psstereo.lights import Directional, Light
from psstereo.results import DepthResult, NormalsResult, Outcome
from psstereo.sfs.assumption import Assumption, Basis
from psstereo.sfs.image import ShadedImage
from psstereo.types import FlagArray, FloatArray, Progress, no_progress

__all__ = ["Assumption", "Basis", "ShadingMethod", "ShadingResult", "ShadingSolution"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ShadingSolution:
    """What a method finds.

    Attributes
    ----------
    normals : float64 array (h, w, 3)
        Unit normals, NaN where not found [1].
    depth : DepthResult
        Heights or distances; NaN where not found.
    flags : uint16 array (h, w)
        Bits that the method sets; ``OUTSIDE_MASK`` is added for it.
    assumptions : tuple of Assumption
        What was assumed beyond light, albedo and ambient level, which are named for it.
    converged : bool
        Whether the iteration met its tolerance.
    facts : mapping
        Plain figures for the record: iterations, residual, counts.
    """

    normals: FloatArray
    depth: DepthResult
    flags: FlagArray
    assumptions: tuple[Assumption, ...] = ()
    converged: bool = True
    facts: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class ShadingResult:
    """Shape from one image, and what it rests on.

    Attributes
    ----------
    normals : NormalsResult
        Normals, albedo as given, flags; the uncertainty is NaN, since one image has no redundancy.
    depth : DepthResult
        Depth.
    assumptions : tuple of Assumption
        Everything that the image does not tell and that was taken nevertheless.
    """

    normals: NormalsResult
    depth: DepthResult
    assumptions: tuple[Assumption, ...]


@dataclass(frozen=True, kw_only=True)
class ShadingMethod(ABC):
    """A way to see shape in one image; its fields are its options.

    A method writes :meth:`solve`; checks, flags common to all and the record are here.

    Attributes
    ----------
    threads : int
        Threads at most; the result does not depend on it.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    lights: ClassVar[tuple[type[Light], ...]]
    """Kinds of light it works with."""
    cameras: ClassVar[tuple[type[Camera], ...]]
    """Kinds of camera it works with."""
    takes_heights: ClassVar[bool] = False
    """Whether it regards depth that is known exactly."""
    takes_prior: ClassVar[bool] = False
    """Whether it regards depth that is known roughly."""
    any_mask: ClassVar[bool] = True
    """Whether masks of any outline are taken; otherwise the image must be a full rectangle."""
    threads: int = 1

    def recover(self, image: ShadedImage, *, progress: Progress = no_progress) -> ShadingResult:
        """Recover the surface of a single image.

        Pixels brighter than the light allows count as facing it (flag ``OVER_BRIGHT``); pixels without light carry
        ``UNLIT``, and what stands there is interpolated or NaN, as the method says.

        Parameters
        ----------
        image : ShadedImage
            The image, and what is known beside it.
        progress : callback, optional
            Told how far the work has come.

        Returns
        -------
        ShadingResult
            The surface, and what was assumed.

        Raises
        ------
        UnsupportedError
            If the method does not work with this light or camera, or does not regard something that is given.
        InputError
            If the image has no light at all.
        """
        self._refuse(image)
        _require_light(image)
        started = time.perf_counter()
        found = self.solve(image, progress)
        seconds = time.perf_counter() - started
        inside = image.inside
        flags = np.where(inside, found.flags, np.uint16(Flag.OUTSIDE_MASK)).astype(np.uint16)
        nowhere = inside & np.isnan(found.normals).any(axis=-1)
        flags[nowhere & (flags & ~np.uint16(Flag.OVER_BRIGHT) == 0)] |= np.uint16(Flag.NOT_FINITE)
        flags[inside & np.isnan(found.depth.depth)] |= np.uint16(Flag.NO_DEPTH)
        if not found.converged:
            flags[inside] |= np.uint16(Flag.NOT_CONVERGED)
        missing = bool(nowhere.any()) or bool((flags & np.uint16(Flag.NO_DEPTH)).any())
        outcome = Outcome.PARTIAL if missing else Outcome.SOLVED
        outcome = outcome if found.converged else Outcome.NOT_CONVERGED
        assumptions = (*_common(image), *found.assumptions)
        facts = {
            "method": self.name,
            "options": asdict(self),
            "pixels": int(np.count_nonzero(inside)),
            "assumptions": [
                {"name": one.name, "basis": one.basis.value, "sentence": one.sentence} for one in assumptions
            ],
            **found.facts,
        }
        normals = NormalsResult(
            normals=np.where(inside[..., None], found.normals, np.nan),
            albedo=np.where(inside & ~nowhere, image.albedo, np.nan),
            uncertainty=np.full(inside.shape, np.nan),
            flags=flags,
            outcome=outcome,
            facts=facts,
            seconds={"solve": seconds},
        )
        return ShadingResult(normals=normals, depth=found.depth, assumptions=assumptions)

    def _refuse(self, image: ShadedImage) -> None:
        """Refuse what the method does not regard, rather than leaving it out silently."""
        unfit = {
            f"a light of the kind {image.light.name}": not isinstance(image.light, self.lights),
            f"a camera of the kind {image.camera.name}": not isinstance(image.camera, self.cameras),
            "known heights": image.heights is not None and not self.takes_heights,
            "a prior": image.prior is not None and not self.takes_prior,
            "a mask or unknown pixels": not self.any_mask and not image.inside.all(),
        }
        found = [name for name, bad in unfit.items() if bad]
        if found:
            lights = " or ".join(kind.name for kind in self.lights)
            cameras = " or ".join(kind.name for kind in self.cameras)
            raise UnsupportedError(
                given=f"The method {self.name} was given {' and '.join(found)}.",
                needed=f"It works with lights of the kind {lights} and cameras of the kind {cameras}"
                f"{'' if self.any_mask else ', on full rectangles'}.",
                remedy="Leave it out, or choose another method.",
            )

    @abstractmethod
    def solve(self, image: ShadedImage, progress: Progress) -> ShadingSolution:
        """Return the surface of an image that was checked; pixels outside ``image.inside`` may hold anything."""


def _require_light(image: ShadedImage) -> None:
    """Refuse an image that shows nothing."""
    with np.errstate(invalid="ignore"):
        if not (image.irradiance > 0).any():
            raise InputError(
                given=f"None of {int(np.count_nonzero(image.inside))} pixels is brighter than the ambient level.",
                needed="Light on the surface.",
                remedy="Check image, mask and ambient level.",
            )


def _light_words(light: Light) -> str:
    """Say where a light is: a slip in its azimuth shows nowhere else."""
    if not isinstance(light, Directional):
        return f"It is of the kind {light.name}."
    x, y, z = light.direction
    azimuth, elevation = np.degrees(np.arctan2(y, x)) % 360.0, np.degrees(np.arctan2(z, np.hypot(x, y)))
    return f"A sun at azimuth {azimuth:.1f}° from x right toward y up, elevation {elevation:.1f}°."


def _common(image: ShadedImage) -> tuple[Assumption, ...]:
    """Name what every method takes from its caller."""
    albedo = np.asarray(image.albedo)
    paint = f"It is {float(albedo):g} everywhere." if albedo.ndim == 0 else "It is a map over the image."
    given = (
        Assumption(name="light", basis=Basis.GIVEN, sentence=_light_words(image.light)),
        Assumption(name="albedo", basis=Basis.GIVEN, sentence=paint),
        Assumption(name="ambient", basis=Basis.GIVEN, sentence=f"The level {image.ambient:g} was subtracted."),
        Assumption(name="reflectance", basis=Basis.ASSUMED, sentence="The surface is matte."),
        Assumption(name="interreflection", basis=Basis.ASSUMED, sentence="No light comes from one part to another."),
    )
    told = {one.name: one for one in image.sources}
    others = tuple(one for one in image.sources if one.name not in {common.name for common in given})
    return (*(told.get(one.name, one) for one in given), *others)
