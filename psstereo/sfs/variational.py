r"""Shape from shading by least squares on the heights, from coarse to fine."""

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.depth.edges import EdgeSteps, components_of
from psstereo.depth.rows import Rows
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.flags import Flag
from psstereo.lights import Directional, Harmonics, Light
from psstereo.results import DepthKind, DepthResult, Outcome
from psstereo.sfs.image import ShadedImage
from psstereo.sfs.method import ShadingMethod, ShadingSolution
from psstereo.sfs.variational_descent import Descent, Found, Stage
from psstereo.sfs.variational_grid import Grid, edges_of, finer, pyramid
from psstereo.sfs.variational_light import light_polynomial
from psstereo.sfs.variational_start import RELIEFS, first_surface
from psstereo.sfs.variational_view import Window, inside_window, known_heights, prior_heights
from psstereo.sfs.variational_words import assumptions
from psstereo.types import BoolArray, FlagArray, FloatArray, IntArray, Progress

__all__ = ["Variational"]

_TRACKS = (0.1, 0.3, 1.0)
"""Bending weights λ, one a way down the grids, all but the finest: with less, folds of the first surface stay. A coarse
pixel bends more than a fine one, so the same weight hinders a smooth surface less on the finest grid."""
_KAPPA = 0.65
"""Power of the slant by which bending counts less: 1 would measure the turn of the normal, but then a cliff costs the
less the higher it is, and from ¾ on surfaces tore in the vase's own shadow; with ½ steep sides are flattened [1]."""
_TAUT = (1e-4, 1e-3)
"""Least area weights α on large and small coarse grids: without known heights steep tilts toward infinity can look like
any brightness, and cost hardly any bending."""
_SMALL = 128 * 128
"""Pixels of a grid up to which every way is tried; then the one of least energy goes on."""
_ROUNDING = 1e-9
"""Brightness above the greatest that is rounding [1]."""
_STUCK = 0.01
"""Root-mean-square misfit, as a share of the greatest brightness, that an unmoved surface may leave [1]."""
_SHADOWS = ("attached", "unknown")


@dataclass(frozen=True, kw_only=True)
class Variational(ShadingMethod):
    r"""Minimise the misfit of the brightness over all height maps.

    The unknown is the height itself (for a pinhole camera the logarithm of the distance), so every slope is that of a
    surface. With brightness I and irradiance E as shares of the light's greatest, the energy is

        Σ (E(n) − I)²  +  smoothness Σ \|∂²s\|² \|N\|^−2.6  +  area Σ √(1 + \|∇s\|²)
                       +  Σ (angle / sigma)² (s − prior)²

    with s and sigma in pixels and N the normal before it gets unit length, so that bending counts less on steep sides
    (there the normal turns less for the same second difference). Gauss–Newton steps on s, solved by conjugate gradients
    on a multigrid, descend from a coarse grid to the finest; the energy falls at every step on each. The problem is
    that of [1]_, which splits slopes from heights instead.

    One image does not determine a surface. Light from one side and heights along the border lead to the surface on the
    made scenes that were tried, hills and a vase, from a flat start. Where a part of the surface faces the light,
    hollows and bumps can look the same: known heights, a prior or `relief` decide. The minimum that is found need not
    be the least; the misfit that remains (``data_residual``) tells in part: with a free border a wrong surface can fit
    as well as the right one.

    A prior's errors count as independent from pixel to pixel. Those of a depth map that was enlarged k times are not:
    give it k times its standard error, or its blocks will show.

    Do not use it for glossy or coloured surfaces, nor where one part throws a shadow on another without telling so by
    `shadows` or the mask. Use the eikonal methods for a light at the camera when the tops are known.

    Attributes
    ----------
    smoothness : float
        Weight of bending beside the squared misfit. 0.01 hardly hinders clean images; 0.1 suits noise of 1 % of the
        greatest brightness, 1 suits 5 % [1].
    area : float
        Weight of the surface's area: the minimal-surface term. More flattens; the default only keeps from running away
        what the image does not hold, and 0 leaves it out on the finest grid [1].
    relief : str
        What the surface begins as where neither heights nor a prior say: ``"flat"``, or a dome toward the camera
        (``"convex"``) or away (``"concave"``).
    shadows : str
        ``"attached"``: dark pixels face away from the light, so their brightness is a bound. ``"unknown"``: they may
        lie in a shadow thrown from elsewhere, and say nothing.
    dark : float
        Brightness up to which a pixel counts as dark, as a share of the light's greatest [1].
    tolerance : float
        Relative decrease of the energy in a step at which the iteration ends on a grid [1].
    max_steps : int
        Steps on a grid at most.

    References
    ----------
    .. [1] Y. Quéau, J. Mélou, F. Castan, D. Cremers, J.-D. Durou, "A Variational Approach to Shape-from-shading Under
       Natural Illumination", EMMCVPR 2017. doi:10.1007/978-3-319-78199-0_23
    """

    name: ClassVar[str] = "variational"
    summary: ClassVar[str] = "Least squares on heights: oblique light or a sky, any mask, known heights, a rough prior."
    lights: ClassVar[tuple[type[Light], ...]] = (Directional, Harmonics)
    cameras: ClassVar[tuple[type[Camera], ...]] = (Orthographic, Pinhole)
    takes_heights: ClassVar[bool] = True
    takes_prior: ClassVar[bool] = True
    smoothness: float = 0.01
    area: float = 1e-5
    relief: str = "flat"
    shadows: str = "attached"
    dark: float = 0.02
    tolerance: float = 1e-3
    max_steps: int = 30

    def __post_init__(self) -> None:
        weights = 0 < self.smoothness < math.inf and 0 <= self.area < math.inf and 0 <= self.dark < 1
        limits = 0 < self.tolerance < 1 and self.max_steps >= 1 and self.threads >= 1
        if not (weights and limits and self.relief in RELIEFS and self.shadows in _SHADOWS):
            raise OptionError(
                given=f"Smoothness {self.smoothness}, area {self.area}, dark {self.dark}, tolerance {self.tolerance}, "
                f"max_steps {self.max_steps}, threads {self.threads}, relief {self.relief!r}, shadows "
                f"{self.shadows!r}.",
                needed="Smoothness above 0, area 0 or more, dark 0 or more and below 1, tolerance between 0 and 1, "
                f"steps and threads 1 or more; relief {', '.join(RELIEFS)}; shadows {' or '.join(_SHADOWS)}.",
                remedy="Leave out what need not differ from its default.",
            )

    def solve(self, image: ShadedImage, progress: Progress) -> ShadingSolution:
        """Descend from coarse to fine; see :meth:`ShadingMethod.recover`."""
        window = inside_window(image)
        grid, flags = self._problem(image, window)
        with Rows(self.threads) as rows:
            found, record = self._descend(grid, window, rows, progress)
        _require_moved(found, record, grid)
        p, q, sloped = _slopes(found.values, grid)
        weighed = sloped & (grid.weight > 0)
        anchored, components = _anchors(grid)
        values = _centred(found.values, grid.inside & ~anchored, components)
        kept = grid.inside & (sloped | ~grid.free)
        if grid.prior_weight.size:
            kept |= grid.prior_weight > 0
        normals = np.where((grid.inside & sloped)[..., None], window.normals(p, q), np.nan)
        misfit = math.sqrt(found.misfit / max(int(np.count_nonzero(weighed)), 1))
        depth = DepthResult(
            depth=_placed(np.where(kept, window.to_depth(np.where(kept, values, 0.0)), np.nan), image, window),
            kind=DepthKind.DISTANCE if window.central else DepthKind.HEIGHT,
            unit=window.unit,
            components=_placed(components, image, window),
            iterations=record["products"],
            residual=misfit,
            outcome=_outcome(found.converged, bool((grid.inside & ~kept).any())),
            facts={"data_residual": misfit},
        )
        untied = int(np.unique(components[grid.inside & ~anchored]).size)
        facts = {"data_residual": misfit, "components": int(components.max()), "untied_components": untied, **record}
        return ShadingSolution(
            normals=_placed(normals, image, window),
            depth=depth,
            flags=flags,
            assumptions=assumptions(self.relief, self.shadows, grid, untied=untied),
            converged=found.converged,
            facts=facts,
        )

    def _problem(self, image: ShadedImage, window: Window) -> tuple[Grid, FlagArray]:
        """Return the finest grid, and flags of the whole image."""
        polynomial, greatest = light_polynomial(image.light)
        whole = np.where(image.inside, image.irradiance, 0.0) / greatest
        unlit, over = image.inside & (whole <= self.dark), image.inside & (whole > 1.0 + _ROUNDING)
        if not (image.inside & ~unlit).any():
            raise InputError(
                given=f"All {np.count_nonzero(unlit)} pixels are darker than {self.dark:g} of the light's greatest.",
                needed="At least one must receive light.",
                remedy="Check mask, ambient level, and the strength of the light in the unit of the image.",
            )
        flags = np.zeros(image.inside.shape, np.uint16)
        flags[over] |= np.uint16(Flag.OVER_BRIGHT)
        flags[unlit] |= np.uint16(Flag.UNLIT)
        inside, dark = window.inside, np.ascontiguousarray(unlit[window.rows, window.columns])
        known, heights = known_heights(image, window)
        prior, prior_weight = prior_heights(image, window)
        east, south = edges_of(inside)
        says = inside & ~dark if self.shadows == "unknown" else inside
        return Grid(
            inside=inside,
            free=inside & ~known,
            east=east,
            south=south,
            target=np.clip(whole[window.rows, window.columns], 0.0, 1.0),
            weight=says.astype(np.float64),
            dark=dark,
            frame=window.frame,
            light=polynomial,
            known=heights,
            prior=prior,
            prior_weight=prior_weight,
        ), flags

    def _descend(self, finest: Grid, window: Window, rows: Rows, progress: Progress) -> tuple[Found, dict[str, Any]]:
        grids = pyramid(finest)
        k = len(grids) - 1
        first = first_surface(grids[k], self.relief, toward_camera=-1.0 if window.central else 1.0)
        # A prior is a better guide than the energy of small grids, where a fold can fit as well.
        ways = _TRACKS if finest.prior_weight.size == 0 else _TRACKS[:1]
        tracks = [_Track(bending=bending, values=first) for bending in ways]
        while True:
            done = Descent(grids[k], rows)
            for track in tracks:
                track.run(done, self._stage(k, track.bending, small=len(tracks) > 1))
            if k > 0 and (grids[k - 1].inside.size > _SMALL or k == 1) and len(tracks) > 1:
                # On equal terms: what is found with much smoothing goes on with the least.
                for track in tracks:
                    track.run(done, self._stage(k, _TRACKS[0], small=True))
                tracks = [min(tracks, key=lambda track: track.found.energies[-1])]
            progress("shape", 4 ** (len(grids) - k) - 1, 4 ** len(grids) - 1)
            if k == 0:
                break
            for track in tracks:
                track.values = finer(track.values, grids[k], grids[k - 1])
            k -= 1
        best = min(tracks, key=lambda track: track.found.energies[-1])
        record = {
            "grids": len(grids),
            "steps": best.steps,
            "products": best.products,
            "bending_at_start": best.bending,
            "energy": best.found.energies[-1],
            "energy_at_start": best.found.energies[0],
        }
        return best.found, record

    def _stage(self, k: int, bending: float, *, small: bool) -> Stage:
        """Return the weights on the k-th grid, the finest first."""
        area = self.area
        if k > 0:
            bending = max(self.smoothness / 4**k, bending)
            area = max(area, _TAUT[small])
        else:
            bending = self.smoothness
        return Stage(bending=bending, kappa=_KAPPA, area=area, steps=self.max_steps, tolerance=self.tolerance)


@dataclass(kw_only=True, eq=False)
class _Track:
    """One way down the grids; on small ones several are tried, since one may end in a fold."""

    bending: float
    values: FloatArray
    steps: list[int] = field(default_factory=list)
    products: int = 0

    def run(self, descent: Descent, stage: Stage) -> None:
        """Go on with one descent."""
        self.found = descent.run(self.values, stage)
        self.values = self.found.values
        self.steps.append(len(self.found.energies) - 1)
        self.products += self.found.products


def _require_moved(found: Found, record: dict[str, Any], grid: Grid) -> None:
    """Refuse a surface that never moved although it does not explain the image: it stands on a saddle."""
    misfit = math.sqrt(found.misfit / max(float(grid.weight.sum()), 1.0))
    if any(record["steps"]) or misfit <= _STUCK:
        return
    raise UnsupportedError(
        given=f"No step away from the first surface makes the image fit better; its misfit is {misfit:.2g}.",
        needed="Light from the side, or a start that is not flat: where a flat surface faces the light, brightness"
        " does not tell in which direction to tilt it.",
        remedy="Set relief=convex or relief=concave, give a prior or known heights, or use the method eikonal.",
    )


def _outcome(converged: bool, missing: bool) -> Outcome:
    if not converged:
        return Outcome.NOT_CONVERGED
    return Outcome.PARTIAL if missing else Outcome.SOLVED


def _slopes(s: FloatArray, grid: Grid) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return slopes along rows and down columns, and where both are known."""
    p, along = _slope(s, grid.east)
    q, down = _slope(s.T, grid.south.T)
    return p, q.T, along & down.T


def _slope(s: FloatArray, edge: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Return the mean of a pixel's steps along its row, and whether there is one."""
    steps, count = np.zeros_like(s), edge.astype(np.float64)
    steps[:, :-1] = np.where(edge[:, :-1], s[:, 1:] - s[:, :-1], 0.0)
    slope = steps.copy()
    slope[:, 1:] += steps[:, :-1]
    count[:, 1:] += edge[:, :-1]
    return slope / np.maximum(count, 1.0), np.asarray(count > 0)


def _anchors(grid: Grid) -> tuple[BoolArray, IntArray]:
    """Return pixels whose piece of the mask is held by a known height or a prior, and the numbers of the pieces."""
    right, down = grid.east[:, :-1].astype(np.float64), grid.south[:-1].astype(np.float64)
    edges = EdgeSteps(
        right=np.zeros_like(right), down=np.zeros_like(down), right_weight=right, down_weight=down, left_out=0
    )
    components = components_of(edges, grid.inside)
    held = grid.inside & ~grid.free
    if grid.prior_weight.size:
        held = held | (grid.prior_weight > 0)
    tied = np.bincount(components[held], minlength=int(components.max()) + 1) > 0
    return np.asarray(tied[components] & grid.inside), components


def _centred(values: FloatArray, loose: BoolArray, components: IntArray) -> FloatArray:
    """Return heights whose pieces that nothing holds have mean 0."""
    labels = np.where(loose, components, 0).ravel()
    mean = np.bincount(labels, values.ravel()) / np.maximum(np.bincount(labels), 1)
    return np.where(loose, values - mean[labels].reshape(values.shape), values)


def _placed(part: Any, image: ShadedImage, window: Window) -> Any:
    """Return an array of the window in the whole image, NaN or 0 around it and outside the mask."""
    outside = np.nan if part.dtype.kind == "f" else 0
    whole = np.full((*image.inside.shape, *part.shape[2:]), outside, part.dtype)
    whole[window.rows, window.columns] = part
    whole[~image.inside] = outside
    return whole
