"""The interface of integrators: normals in, depth out."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from psstereo.camera import Camera
from psstereo.depth.domain import Domain, make_domain
from psstereo.depth.prior import Prior, prior_values
from psstereo.errors import UnsupportedError
from psstereo.results import DepthKind, DepthResult, Outcome
from psstereo.types import BoolArray, FloatArray, IntArray, Progress, no_progress

__all__ = ["Integrator", "Solution"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """What a method finds on a domain, before free constants are settled.

    Attributes
    ----------
    values : float64 array (h, w)
        Heights [camera's unit] or natural logarithms of distances [1], each component up to a constant; any number
        outside the domain.
    components : int array (h, w)
        Pieces of the domain that equations hold together, from 1; 0 outside.
    iterations : int
        Iterations of the linear solver.
    residual : float
        Relative residual reached [1].
    converged : bool
        Whether the residual met the tolerance.
    centred : bool
        Whether the values' mean over each component is 0 already.
    facts : mapping
        Plain figures for the record.
    """

    values: FloatArray
    components: IntArray
    iterations: int = 0
    residual: float = 0.0
    converged: bool = True
    centred: bool = False
    facts: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Integrator(ABC):
    """A method that finds the depth whose surface has given normals; its fields are its options.

    A method writes :meth:`solve`; checking, cropping, free constants and reporting are common to all.

    Attributes
    ----------
    threads : int
        Threads that a method may use for a single surface; the result does not depend on it.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    any_domain: ClassVar[bool] = True
    """Whether masks, holes, weights and every camera are taken; a method that is for rectangles only says so."""
    exact_on_spheres: ClassVar[bool] = True
    """Whether slopes are the means of neighbours, which are exact where the surface is a sphere."""
    round_off: ClassVar[float] = 1e-9
    """How much other components may move a component's depth, by rounding and where the iteration stops [1]."""
    takes_prior: ClassVar[bool] = False
    """Whether `solve` regards the domain's prior."""
    threads: int = 1

    def integrate(
        self,
        normals: FloatArray,
        camera: Camera,
        *,
        mask: BoolArray | None = None,
        weights: FloatArray | None = None,
        prior: Prior | None = None,
        progress: Progress = no_progress,
    ) -> DepthResult:
        """Return the depth of a normal map.

        Pixels of the mask are left out, and counted in the result's facts, where the normal is zero, NaN or infinite,
        where it does not face the camera (n · ray ≥ 0), and where the weight is 0. Normals of other than unit length
        are normalised. All work is done in float64.

        Parameters
        ----------
        normals : float array (h, w, 3)
            Normals, x right, y up, z toward the camera; NaN where unknown [1].
        camera : Camera
            The camera of the normal map, of the same size and crop.
        mask : bool array (h, w), optional
            Pixels wanted; all if left out.
        weights : float array (h, w), optional
            Confidence of each pixel, an inverse variance of any common scale; 0 leaves the pixel out [1].
        prior : Prior, optional
            Depth known beforehand, to fuse with the normals and to fix the free constants.
        progress : callback, optional
            Told how far the work has come, in per cent.

        Returns
        -------
        DepthResult
            Float64 depth (h, w), NaN outside. Without a prior each connected component is settled by itself: heights
            have mean 0 [camera's unit], distances have geometric mean 1 [relative]. With one, depth is in its unit,
            components that it does not touch are NaN, and ``left_out`` counts their pixels under ``no_prior``.

        Raises
        ------
        InputError
            If shapes or types do not fit, a weight is negative or not finite, no pixel can be used, or the prior
            does not fit.
        UnsupportedError
            If there is a prior and the method takes none, or the method is not for this domain.
        """
        domain = make_domain(normals, camera, mask, weights, threads=self.threads)
        if prior is not None:
            domain = self._with_prior(prior, domain, camera)
        solution = self.solve(domain, progress)
        depth, beyond, untied = _settle(solution, domain)
        if prior is not None:
            domain = replace(domain, left_out={**domain.left_out, "no_prior": untied})
        pixels = int(np.count_nonzero(domain.inside))
        facts = {
            "method": self.name,
            "options": asdict(self),
            "pixels": pixels,
            "left_out": {**domain.left_out, "beyond_range": beyond},
            **_component_facts(solution.components, pixels),
            **solution.facts,
        }
        missing = beyond + untied + (0 if mask is None else sum(domain.left_out.values()))
        outcome = Outcome.PARTIAL if missing else Outcome.SOLVED
        return DepthResult(
            depth=_placed(depth, np.nan, domain),
            kind=domain.kind,
            unit=camera.unit if prior is None else prior.unit,
            components=_placed(_known(solution.components, depth, beyond + untied), 0, domain),
            iterations=solution.iterations,
            residual=solution.residual,
            outcome=outcome if solution.converged else Outcome.NOT_CONVERGED,
            facts=facts,
        )

    def _with_prior(self, prior: Prior, domain: Domain, camera: Camera) -> Domain:
        if not self.takes_prior:
            raise UnsupportedError(
                given=f"The integrator {self.name} was given a prior depth.",
                needed="It can work from normals alone only.",
                remedy="Use the integrator poisson or discontinuity, or leave the prior out.",
            )
        values, weights = prior_values(prior, domain, camera)
        return replace(domain, prior=values, prior_weight=weights)

    @abstractmethod
    def solve(self, domain: Domain, progress: Progress) -> Solution:
        """Return values whose surface has the normals of a domain; free constants may be anything.

        Parameters
        ----------
        domain : Domain
            Checked input.
        progress : callback
            To be told how far the work has come, in per cent.

        Returns
        -------
        Solution
            Values and how they were found.
        """


def _settle(solution: Solution, domain: Domain) -> tuple[FloatArray, int, int]:
    """Return the depth with free constants settled, and the pixels that no float can hold or no prior ties down."""
    inside = domain.inside
    whole = bool(inside.all())
    values = solution.values.ravel() if whole else solution.values[inside]
    untied = np.zeros(1, np.bool_)
    if domain.prior_weight is not None:
        tied = np.bincount(solution.components.ravel(), domain.prior_weight.ravel()) > 0
        untied = ~tied[solution.components[inside]]
        values = np.where(untied, np.nan, values)
    elif not solution.centred:
        values = _centred(values, solution.components, inside)
    beyond, lost = 0, int(np.count_nonzero(untied))
    if domain.kind is DepthKind.DISTANCE:
        with np.errstate(over="ignore", under="ignore"):
            values = np.exp(values)
        fine = np.isfinite(values) & (values > 0)
        beyond = values.size - int(np.count_nonzero(fine)) - lost
        values = np.where(fine, values, np.nan) if beyond else values
    if whole:
        return values.reshape(inside.shape), beyond, lost
    depth = np.full(inside.shape, np.nan)
    depth[inside] = values
    return depth, beyond, lost


def _centred(values: FloatArray, components: IntArray, inside: BoolArray) -> FloatArray:
    """Return the values of the pixels inside less the mean of their component."""
    # Two passes: the first mean carries the rounding of an arbitrary constant, the second removes what is left.
    if components.max() == 1:
        values = values - values.mean()
        values -= values.mean()
        return values
    labels = components[inside]
    counts = np.maximum(np.bincount(labels), 1)
    for _ in range(2):
        values = values - (np.bincount(labels, weights=values) / counts)[labels]
    return values


def _placed(array: Any, outside: float, domain: Domain) -> Any:
    """Put an array of the domain's rectangle back into the image."""
    if array.shape == domain.shape:
        return array
    whole = np.full(domain.shape, outside, array.dtype)
    whole[domain.window] = array
    return whole


def _known(components: IntArray, depth: FloatArray, missing: int) -> IntArray:
    """Return the components without the pixels that have no depth."""
    return np.where(np.isnan(depth), 0, components) if missing else components


def _component_facts(components: IntArray, pixels: int) -> dict[str, int]:
    sizes = np.array([pixels]) if components.max() == 1 else np.bincount(components.ravel())[1:]
    return {
        "components": int(sizes.size),
        "largest_component": int(sizes.max(initial=0)),
        "single_pixels": int(np.count_nonzero(sizes == 1)),
    }
