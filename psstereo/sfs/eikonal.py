"""Shape from shading as a Hamilton–Jacobi equation: exact wherever paths of known height lead."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.flags import Flag
from psstereo.kernels.sweeping_conic import GIVEN, LEAN, OPEN, OUTSIDE
from psstereo.lights import Directional, Led, Light
from psstereo.results import DepthResult, Outcome
from psstereo.sfs.eikonal_frame import Shading, lamp_shading, sun_shading
from psstereo.sfs.eikonal_sweeps import Marched, Problem, march
from psstereo.sfs.image import ShadedImage
from psstereo.sfs.method import Assumption, Basis, ShadingMethod, ShadingSolution
from psstereo.sfs.singular import Singular, find_singular, label_components
from psstereo.types import BoolArray, FlagArray, FloatArray, Progress

__all__ = ["Eikonal"]


@dataclass(frozen=True, kw_only=True)
class Eikonal(ShadingMethod):
    """Heights grow along paths from where they are known, as steeply as the brightness says.

    Under a sun the brightness ties the slopes of a pixel to a conic, in parallel projection an eikonal equation if the
    light stands behind the camera [1]_. Its viscosity solution [2]_ is found by fast sweeping: monotone and of first
    order, or of second order along the paths that the monotone scheme finds. It is the true surface if that has no
    creases other than the relief's own kind, is lit everywhere, and is known at the places from which paths start:
    summits (hollows, if concave) that face the light, and the border where paths enter. Known heights are kept
    exactly. Components of the mask without any start at a place that faces the light, with height 0, or distance 1.

    With a lamp at the optical centre and its fall-off the distance itself is found, and nothing needs to be known
    [2]_: the points nearest to the camera are found with the rest.

    Not for surfaces in cast shadow, for glossy or painted ones, and not where no height is known and the surface has
    several summits: their relative heights are then a guess, which the assumptions name.

    Attributes
    ----------
    order : int
        2, or 1 for the monotone scheme, which is three to four times as fast and never overshoots.
    relief : str
        ``"convex"`` if the surface falls away from the camera around the places that face the light, ``"concave"`` if
        it comes nearer. A single image does not tell.
    summits : str
        ``"one"``: of the places that face the light in a component without known heights, the one deepest inside gets
        the height 0 and all others follow. ``"all"``: every one of them does.
    facing : float
        Brightness below the greatest that still counts as facing the light, where a place to start is looked for [1].
    darkest : float
        Share of the greatest brightness below which a pixel counts as unlit; its brightness is taken as this [1].
    tolerance : float
        Change of a value between sweeps that ends the iteration [px].
    max_sweeps : int
        Sweeps at most, in each phase.
    length_unit : str
        Unit of length that a lamp's flux is in; without meaning where the albedo is assumed, not given: distances are
        relative then.

    Raises
    ------
    OptionError
        If an option has a value that is not possible.

    References
    ----------
    .. [1] E. Rouy, A. Tourin, "A Viscosity Solutions Approach to Shape-From-Shading", SIAM J. Numer. Anal. 29, 1992.
       doi:10.1137/0729053
    .. [2] E. Prados, O. Faugeras, "Shape from shading: a well-posed problem?", Proc. CVPR 2005.
       doi:10.1109/CVPR.2005.319
    """

    name: ClassVar[str] = "eikonal"
    summary: ClassVar[str] = (
        "Hamilton–Jacobi equation by fast sweeping: the viscosity solution, from known heights or summits."
    )
    lights: ClassVar[tuple[type[Light], ...]] = (Directional, Led)
    cameras: ClassVar[tuple[type[Camera], ...]] = (Orthographic, Pinhole)
    takes_heights: ClassVar[bool] = True
    order: int = 2
    relief: str = "convex"
    summits: str = "one"
    facing: float = 0.01
    darkest: float = 1e-3
    tolerance: float = 1e-5
    max_sweeps: int = 400
    length_unit: str = "mm"

    def __post_init__(self) -> None:
        fine = self.order in (1, 2) and self.relief in ("convex", "concave") and self.summits in ("one", "all")
        numbers = 0 <= self.facing < 1 and 0 < self.darkest < 1 and 0 < self.tolerance < np.inf
        if not (fine and numbers and self.max_sweeps >= 1 and self.threads >= 1):
            raise OptionError(
                given=f"The order is {self.order}, the relief {self.relief!r}, the summits {self.summits!r}, `facing` "
                f"{self.facing}, `darkest` {self.darkest}, the tolerance {self.tolerance}, the limit "
                f"{self.max_sweeps} sweeps, the number of threads {self.threads}.",
                needed="Order 1 or 2, relief 'convex' or 'concave', summits 'one' or 'all', `facing` from 0 and "
                "`darkest` above 0, both below 1, a positive tolerance, and at least one sweep and one thread.",
                remedy="Leave out the options that are not needed.",
            )

    def solve(self, image: ShadedImage, progress: Progress) -> ShadingSolution:
        """See :meth:`ShadingMethod.solve`."""
        inside, given = image.inside, _known(image)
        singular = None
        if isinstance(image.light, Led):
            if self.relief == "concave":
                raise UnsupportedError(
                    given="The relief is 'concave' under a lamp at the optical centre.",
                    needed="The fall-off of the lamp decides about the relief: the nearest points face it.",
                    remedy="Leave the relief out.",
                )
            shading = lamp_shading(image, image.light, darkest=self.darkest)
        else:
            assert isinstance(image.light, Directional)
            hollow = self.relief == "concave"
            shading = sun_shading(image, image.light, hollow=hollow, darkest=self.darkest)
            singular = find_singular(shading.bright, inside, given, facing=self.facing, every=self.summits == "all")
        values, fixed = self._starts(image, shading, given, singular)
        state = np.where(inside, np.where(fixed, GIVEN, OPEN), OUTSIDE).astype(np.uint8)
        problem = Problem(
            values=values,
            state=state,
            bright=shading.bright,
            frame=shading.frame,
            tolerance=self.tolerance * shading.fine,
            limit=self.max_sweeps,
            threads=self.threads,
        )
        found = march(problem, self.order, progress)
        return self._solution(image, shading, singular, found)

    @staticmethod
    def _starts(
        image: ShadedImage, shading: Shading, given: BoolArray, singular: Singular | None
    ) -> tuple[FloatArray, BoolArray]:
        """Return the values to begin with and where they are fixed."""
        values = np.zeros(given.shape) if singular is not None else 0.5 * np.log(shading.bright)
        fixed = given if singular is None else given | singular.chosen
        if image.heights is not None and given.any():
            known = np.where(given, image.heights, 1.0)
            values = np.where(given, shading.values(known), values)
        return values, fixed

    def _solution(
        self, image: ShadedImage, shading: Shading, singular: Singular | None, found: Marched
    ) -> ShadingSolution:
        """Return what was found, with every assumption."""
        reached = image.inside & (found.values < LEAN)
        depth = shading.depth(np.where(reached, found.values, np.nan))
        flags: FlagArray = shading.flags
        lost = int(np.count_nonzero(image.inside & ~reached))
        flags[image.inside & ~reached] |= np.uint16(Flag.NO_DEPTH)
        components = label_components(image.inside) if singular is None else singular.components
        facts = {"sweeps": found.sweeps, "still_changing": found.change, "phase": found.phase, "without_path": lost}
        if singular is not None:
            facts |= {"facing_the_light": singular.found, "components_without": singular.without}
        missing = Outcome.PARTIAL if lost else Outcome.SOLVED
        return ShadingSolution(
            normals=found.normals,
            depth=DepthResult(
                depth=depth,
                kind=image.camera.depth_kind,
                unit=self.length_unit if singular is None and not _scale_is_free(image) else image.camera.unit,
                components=components,
                iterations=found.sweeps,
                residual=found.change,
                outcome=missing if found.converged else Outcome.NOT_CONVERGED,
                facts=facts,
            ),
            flags=flags,
            assumptions=self._assumptions(image, singular, lost),
            converged=found.converged,
            facts=facts,
        )

    def _assumptions(self, image: ShadedImage, singular: Singular | None, lost: int) -> tuple[Assumption, ...]:
        """Name what one image does not tell."""
        border = "No path enters through the border of the mask, other than from known heights."
        if lost:
            border += f" {lost} pixels that no path reaches have no depth."
        dark = (
            f"Where the surface is darker than {self.darkest:g} of the most, it was taken as that bright; such pixels "
            "carry the flag UNLIT."
        )
        said = [
            Assumption(name="boundary", basis=Basis.ASSUMED, sentence=border),
            Assumption(name="darkness", basis=Basis.ASSUMED, sentence=dark),
            Assumption(name="continuity", basis=Basis.ASSUMED, sentence="Each component is one continuous surface."),
        ]
        if singular is None:
            return tuple(said)
        way = "falls away from" if self.relief == "convex" else "comes nearer to"
        relief = f"It is {self.relief}: the surface {way} the camera around the places from which heights start."
        said.append(Assumption(name="relief", basis=Basis.ASSUMED, sentence=relief))
        if singular.known:
            known = f"Known heights are exact; {singular.known} components start from them alone."
            said.append(Assumption(name="heights", basis=Basis.GIVEN, sentence=known))
        if singular.chosen.any():
            said += self._starting(image, singular)
        return tuple(said)

    def _starting(self, image: ShadedImage, singular: Singular) -> list[Assumption]:
        """Say from where the heights of components without known ones start."""
        zero = "the height 0" if isinstance(image.camera, Orthographic) else "the distance 1"
        facing = singular.found - singular.without
        if facing > singular.without and self.summits == "all":
            basis, rule = Basis.ASSUMED, "each of them has it, although their heights may differ"
        elif facing > 1:
            basis, rule = Basis.ASSUMED, "in each component the one deepest inside has it, and is its only start"
        else:
            basis, rule = Basis.ESTIMATED, "which leaves the constant free"
        sentence = f"{facing} places face the light; {zero} is the convention for a start, and {rule}."
        said = [Assumption(name="singular points", basis=basis, sentence=sentence)]
        if singular.without:
            stand_in = (
                f"In {singular.without} components no place faces the light and no height is known; the brightest "
                f"pixels stand in, with {zero}."
            )
            said.append(Assumption(name="start", basis=Basis.ASSUMED, sentence=stand_in))
        return said


def _scale_is_free(image: ShadedImage) -> bool:
    """Return whether nobody knows the albedo under a lamp, so that distances have no length."""
    return any(one.name == "albedo" and one.basis is Basis.ASSUMED for one in image.sources)


def _known(image: ShadedImage) -> BoolArray:
    """Return where heights are given, or refuse distances that are none."""
    if image.heights is None:
        return np.zeros(image.image.shape, np.bool_)
    heights = np.asarray(image.heights, np.float64)
    given: BoolArray = ~np.isnan(heights) & image.inside
    bad = np.isinf(heights[given]) | (heights[given] <= 0 if isinstance(image.camera, Pinhole) else False)
    if bad.any():
        raise InputError(
            given=f"{int(np.count_nonzero(bad))} of the known depths are infinite, or not in front of the camera.",
            needed="Finite heights; distances above zero for a pinhole camera; NaN where nothing is known.",
            remedy="Check the heights.",
        )
    return given
