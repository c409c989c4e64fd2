"""Whether a normal map can belong to a surface: the curl of its gradient field.

A height field z(x, y) has gradients p = ∂z/∂x and q = ∂z/∂y with ∂p/∂y = ∂q/∂x. Call the two sides A and B. Flipping y
changes q's sign and the direction of ∂/∂y; read with image rows as they are, it replaces B by −B. So

    agreement = 2 Σ w A B / Σ w (A² + B²)

is 1 for a surface, −1 for one whose green channel is upside down, and about 0 for noise or where A and B vanish
(z = f(x) + g(y), which is a surface both ways). With the weights w = 1/(A² + B² + s²), s a middling size of
√(A² + B²), neither a depth discontinuity nor a steep rim outweighs the rest, and the weights are the same for both
readings, so that the relative curls obey curl² + flipped curl² = 2.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.types import BoolArray, FloatArray

__all__ = ["Integrability", "integrability"]

_GRAZING = 0.1
_NO_VARIATION = 1e-7


@dataclass(frozen=True, kw_only=True)
class Integrability:
    """How well a normal map's gradients fit together.

    Attributes
    ----------
    relative_curl : float
        Robust root mean square of the curl over that of the cross derivatives: 0 for a smooth surface, 1 for
        unrelated gradients, √2 when every one has the wrong sign; NaN where the cross derivatives vanish [1].
    relative_curl_flipped : float
        The same after flipping y [1].
    agreement : float
        ``1 − relative_curl²``, from −1 to 1; NaN likewise [1].
    median_curl : float
        Median of the curl's magnitude, abs(∂p/∂y − ∂q/∂x) [1/px].
    variation : float
        Mean of √((∂p/∂y)² + (∂q/∂x)²) [1/px].
    blocks : int
        Blocks of pixels that were evaluated.
    """

    relative_curl: float
    relative_curl_flipped: float
    agreement: float
    median_curl: float
    variation: float
    blocks: int


def integrability(normals: FloatArray, mask: BoolArray | None = None, *, step: int = 2) -> Integrability:
    """Measure the curl of a normal map relative to how much its gradients vary.

    Not a measure of accuracy: a smooth but wrong map is integrable, a right one with depth discontinuities is not.
    Gradients are orthographic; for a lens with a narrow angle of view the difference is small.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Normals, x right, y up, z toward the camera; NaN where there is none. The length does not matter [1].
    mask : bool array (h, w), optional
        Pixels to use; those with a finite normal when left out.
    step : int
        Normals are averaged over step × step pixels first, which lowers noise and 8-bit rounding [px].

    Returns
    -------
    Integrability
        Figures per pixel of the map as given, computed in float64. With fewer than one block, all are NaN.

    Raises
    ------
    InputError
        If the shapes are wrong.
    OptionError
        If `step` is below 1.
    """
    array = np.asarray(normals)
    if array.ndim != 3 or array.shape[-1] != 3 or (mask is not None and np.shape(mask) != array.shape[:2]):
        raise InputError(
            given=f"The normals have shape {array.shape}, the mask {None if mask is None else np.shape(mask)}.",
            needed="Normals (h, w, 3) and a mask (h, w) of the same size are needed.",
            remedy="Give a whole normal map, not a list of pixels.",
        )
    if step < 1:
        raise OptionError(
            given=f"`step` is {step}.",
            needed="A number of pixels of at least 1 is needed.",
            remedy="Use 2, or more for noisy maps.",
        )
    along_y, along_x = _cross_derivatives(_binned(array, mask, step), step)
    if along_y.size == 0:
        nan = float("nan")
        return Integrability(
            relative_curl=nan, relative_curl_flipped=nan, agreement=nan, median_curl=nan, variation=nan, blocks=0
        )
    energy = along_y**2 + along_x**2
    variation = float(np.mean(np.sqrt(energy)))
    agreement = float("nan")
    if variation > _NO_VARIATION:
        middling = float(np.mean(energy**0.25)) ** 2  # less swayed by steep rims than the mean, never 0 like the median
        weights = 1.0 / (energy + middling**2)
        agreement = float(2.0 * np.sum(weights * along_y * along_x) / np.sum(weights * energy))
    return Integrability(
        relative_curl=float(np.sqrt(max(1.0 - agreement, 0.0))) if np.isfinite(agreement) else agreement,
        relative_curl_flipped=float(np.sqrt(max(1.0 + agreement, 0.0))) if np.isfinite(agreement) else agreement,
        agreement=agreement,
        median_curl=float(np.median(np.abs(along_y - along_x))),
        variation=variation,
        blocks=int(along_y.size),
    )


def _binned(normals: FloatArray, mask: BoolArray | None, step: int) -> FloatArray:
    """Average over step × step pixels in float64; a block with a pixel missing is NaN."""
    rows, columns = normals.shape[0] // step, normals.shape[1] // step
    cut = normals[: rows * step, : columns * step]
    if mask is not None:
        cut = np.where(np.asarray(mask, dtype=np.bool_)[: rows * step, : columns * step, None], cut, np.nan)
    blocks = cut.reshape(rows, step, columns, step, 3)
    return np.asarray(np.mean(blocks, axis=(1, 3), dtype=np.float64))


def _cross_derivatives(normals: FloatArray, step: int) -> tuple[FloatArray, FloatArray]:
    """Return ∂p/∂y and ∂q/∂x at the corners between pixels, both (p,), grazing ones left out [1/px]."""
    lengths = np.linalg.norm(normals, axis=-1)
    usable = normals[..., 2] > _GRAZING * lengths
    depth = np.where(usable, normals[..., 2], np.nan)
    p, q = -normals[..., 0] / depth, -normals[..., 1] / depth
    along_y = (p[:-1, :-1] + p[:-1, 1:] - p[1:, :-1] - p[1:, 1:]) / (2.0 * step)
    along_x = (q[:-1, 1:] + q[1:, 1:] - q[:-1, :-1] - q[1:, :-1]) / (2.0 * step)
    both = np.isfinite(along_y) & np.isfinite(along_x)
    return along_y[both], along_x[both]
