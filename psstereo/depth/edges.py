r"""Steps of the depth between neighbouring pixels, from the normals at both ends.

A chord of a plane or of a sphere is perpendicular to the sum of the two unit normals at its ends: for a sphere of
centre C and radius r, n = (X - C) / r, so (n_a + n_b) · (X_b - X_a) = (\|X_b - C\|² - \|X_a - C\|²) / r = 0. Asking
this of every pair of neighbours a, b, with the mid normal n = n_a + n_b, gives their step without any derivative:

* parallel projection, X = (x, y, z): ``z_b - z_a = -(n_x Δx + n_y Δy) / n_z``;
* central projection, X = z d with the ray d: ``ln z_b - ln z_a = ln(-n·d_a) - ln(-n·d_b)``.

Both are exact on planes and spheres of any slant, and second-order accurate elsewhere.

Slant. A slope t = tan θ grows like 1 / cos θ, and an angular error δ of the normal moves it by δ / cos θ across and
δ / cos² θ along the slope, so that near the silhouette a few pixels would outvote all others. Clipping the slope would
bend the surface; instead an edge weighs ``cos² θ``, with θ the slant of the mid normal against the ray. Its energy,
weight · t², then stays below 1 however steep the edge, and its pull, weight · t, fades to nothing. Measured
against equal weights (or a fade only beyond 84 degrees, which comes to the same): a quarter less error from noisy
normals, and 30 to 40 % less on cat and cow of DiLiGenT, whose silhouettes border on depth jumps; pot1 and goblet gain
4 and 8 %. cos⁴ is better still at jumps, but twice as bad under noise.

Weights of pixels are inverse variances by meaning. The step takes half of each normal, so its variance is the mean
of both variances but for a common factor, and its weight the harmonic mean ``2 w_a w_b / (w_a + w_b)``: equal
weights stay as they are, and a pixel of weight zero has no say.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.depth.domain import Domain
from psstereo.results import DepthKind
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["EdgeSteps", "components_of", "edge_steps"]

_SMALLEST_COSINE = 1e-8
"""A slope of 10⁸ pixels a pixel is no information; its square is where double precision ends."""
_SMALLEST_WEIGHT = 1e-30
"""Relative weight below which an edge counts as absent."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EdgeSteps:
    """Steps of the height or of the logarithm of the distance between neighbouring pixels.

    Attributes
    ----------
    right : float64 array (h, w − 1)
        Value at column u + 1 minus value at column u; 0 where the edge has no weight [unit of the camera, or 1].
    down : float64 array (h − 1, w)
        Value at row v + 1 minus value at row v; 0 where the edge has no weight [unit of the camera, or 1].
    right_weight, down_weight : float64 arrays of the same shapes
        Weights in 0 to 1; 0 where there is no edge [1].
    left_out : int
        Pairs of neighbours inside the domain without a usable step.
    """

    right: FloatArray
    down: FloatArray
    right_weight: FloatArray
    down_weight: FloatArray
    left_out: int

    @property
    def count(self) -> int:
        """Number of edges that have weight."""
        return int(np.count_nonzero(self.right_weight) + np.count_nonzero(self.down_weight))

    @property
    def uniform(self) -> bool:
        """Whether every pair of neighbours has an edge and all weigh the same."""
        weights = [part for part in (self.right_weight, self.down_weight) if part.size]
        if not weights:
            return True
        one = float(weights[0].flat[0])
        return one > 0 and all(bool(np.all(part == one)) for part in weights)


def edge_steps(domain: Domain, *, slant_exponent: float = 2.0) -> EdgeSteps:
    """Return the steps between all neighbouring pixels of a domain.

    Parameters
    ----------
    domain : Domain
        Normals, rays and weights.
    slant_exponent : float
        An edge weighs the cosine of its slant to this power; 0 for equal weights [1].

    Returns
    -------
    EdgeSteps
        Exact on planes and spheres (normals without error), otherwise second-order accurate.

    Notes
    -----
    A discontinuity of the depth leaves no trace in the normals at its two sides: the step across it is then wrong, and
    only a method that weighs edges by what it has found (bilateral integration) can discount it.
    """
    first, last = slice(None, -1), slice(1, None)
    everything = slice(None)
    right, right_weight, right_lost = _along(domain, (everything, first), (everything, last), slant_exponent)
    down, down_weight, down_lost = _along(domain, (first, everything), (last, everything), slant_exponent)
    return EdgeSteps(
        right=right, down=down, right_weight=right_weight, down_weight=down_weight, left_out=right_lost + down_lost
    )


def _along(
    domain: Domain, a: tuple[slice, slice], b: tuple[slice, slice], exponent: float
) -> tuple[FloatArray, FloatArray, int]:
    """Return steps, weights and the number of unusable pairs of the edges from the pixels `a` to the pixels `b`."""
    pairs = domain.inside[a] & domain.inside[b]
    step, cosine = _chord(domain, a, b)
    usable = pairs & (cosine > _SMALLEST_COSINE)
    weight = np.where(usable, cosine, 0.0) ** exponent
    if domain.weights is not None:
        weight = weight * _harmonic_mean(domain.weights[a], domain.weights[b])
    usable &= weight > _SMALLEST_WEIGHT
    left_out = int(np.count_nonzero(pairs & ~usable))
    return np.where(usable, step, 0.0), np.where(usable, weight, 0.0), left_out


def _chord(domain: Domain, a: tuple[slice, slice], b: tuple[slice, slice]) -> tuple[FloatArray, FloatArray]:
    """Return the steps and the cosine between the mid normal and the direction to the camera (smaller of both ends).

    A cosine of 0 or less means that the chord never meets the other ray in front of the camera; the step is then 0.
    """
    middle = domain.normals[a] + domain.normals[b]
    length = np.sqrt(_dot(middle, middle))
    # Outside the domain normals are zero: any positive length keeps the division quiet, the result is not used.
    length = np.where(length > 0, length, 1.0)
    if domain.kind is DepthKind.HEIGHT:
        facing = middle[..., 2]
        across = domain.places[b] - domain.places[a]
        usable = facing > _SMALLEST_COSINE * length
        rise = -(middle[..., 0] * across[..., 0] + middle[..., 1] * across[..., 1])
        return np.where(usable, rise / np.where(usable, facing, 1.0), 0.0), facing / length
    ray_a, ray_b = domain.places[a], domain.places[b]
    at_a, at_b = -_dot(middle, ray_a), -_dot(middle, ray_b)
    cosine = np.minimum(at_a / np.sqrt(_dot(ray_a, ray_a)), at_b / np.sqrt(_dot(ray_b, ray_b))) / length
    usable = cosine > _SMALLEST_COSINE
    step = np.log(np.where(usable, at_a, 1.0)) - np.log(np.where(usable, at_b, 1.0))
    return step, cosine


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


def _harmonic_mean(a: FloatArray, b: FloatArray) -> FloatArray:
    total = a + b
    return np.asarray(2.0 * a * (b / np.where(total > 0, total, 1.0)))


def components_of(steps: EdgeSteps, inside: BoolArray) -> IntArray:
    """Number the pieces of the domain that edges hold together.

    Parameters
    ----------
    steps : EdgeSteps
        The edges.
    inside : bool array (h, w)
        Pixels of the domain.

    Returns
    -------
    int32 array (h, w)
        1, 2, … in the order of each component's first pixel; 0 outside.
    """
    from scipy.ndimage import label

    if steps.left_out == 0:
        return np.asarray(label(inside)[0], np.int32)
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    index = np.cumsum(inside).reshape(inside.shape) - 1
    right, down = steps.right_weight > 0, steps.down_weight > 0
    start = np.concatenate([index[:, :-1][right], index[:-1][down]])
    stop = np.concatenate([index[:, 1:][right], index[1:][down]])
    count = int(np.count_nonzero(inside))
    graph = coo_array((np.ones(start.size, np.int8), (start, stop)), shape=(count, count))
    components = np.zeros(inside.shape, np.int32)
    components[inside] = connected_components(graph, directed=False)[1] + 1
    return components
