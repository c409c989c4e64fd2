"""The interface of integrators: normals in, depth out."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

import numpy as np

from psstereo.camera import Camera
from psstereo.depth.domain import Domain, make_domain
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
    facts : mapping
        Plain figures for the record.
    """

    values: FloatArray
    components: IntArray
    iterations: int = 0
    residual: float = 0.0
    converged: bool = True
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
    threads: int = 1

    def integrate(
        self,
        normals: FloatArray,
        camera: Camera,
        *,
        mask: BoolArray | None = None,
        weights: FloatArray | None = None,
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
        progress : callback, optional
            Told how far the work has come, in per cent.

        Returns
        -------
        DepthResult
            Float64 depth (h, w), NaN outside. Each connected component is settled by itself: heights have mean 0
            [camera's unit], distances have geometric mean 1 [relative].

        Raises
        ------
        InputError
            If shapes or types do not fit, a weight is negative or not finite, or no pixel can be used.
        """
        domain = make_domain(normals, camera, mask, weights)
        solution = self.solve(domain, progress)
        depth, beyond = _settle(solution, domain)
        facts = {
            "method": self.name,
            "options": asdict(self),
            "pixels": int(np.count_nonzero(domain.inside)),
            "left_out": {**domain.left_out, "beyond_range": beyond},
            **_component_facts(solution.components),
            **solution.facts,
        }
        missing = beyond + (0 if mask is None else sum(domain.left_out.values()))
        outcome = Outcome.PARTIAL if missing else Outcome.SOLVED
        return DepthResult(
            depth=_placed(depth, np.nan, domain),
            kind=domain.kind,
            unit=camera.unit,
            components=_placed(np.where(np.isnan(depth), 0, solution.components), 0, domain),
            iterations=solution.iterations,
            residual=solution.residual,
            outcome=outcome if solution.converged else Outcome.NOT_CONVERGED,
            facts=facts,
        )

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


def _settle(solution: Solution, domain: Domain) -> tuple[FloatArray, int]:
    """Return the depth with each component's mean settled, and the number of pixels that no float can hold."""
    inside = domain.inside
    labels = solution.components[inside]
    values = solution.values[inside]
    counts = np.bincount(labels)
    # Two passes: the first mean carries the rounding of an arbitrary constant, the second removes what is left.
    for _ in range(2):
        means = np.bincount(labels, weights=values, minlength=counts.size) / np.maximum(counts, 1)
        values = values - means[labels]
    if domain.kind is DepthKind.DISTANCE:
        with np.errstate(over="ignore", under="ignore"):
            values = np.exp(values)
        values = np.where(np.isfinite(values) & (values > 0), values, np.nan)
    depth = np.full(inside.shape, np.nan)
    depth[inside] = values
    return depth, int(np.count_nonzero(np.isnan(values)))


def _placed(array: Any, outside: float, domain: Domain) -> Any:
    """Put an array of the domain's rectangle back into the image."""
    whole = np.full(domain.shape, outside, array.dtype)
    whole[domain.window] = array
    return whole


def _component_facts(components: IntArray) -> dict[str, int]:
    sizes = np.bincount(components[components > 0])[1:]
    return {
        "components": int(sizes.size),
        "largest_component": int(sizes.max(initial=0)),
        "single_pixels": int(np.count_nonzero(sizes == 1)),
    }
