"""Is green up or down? Files never say, so look at the surface that the map describes.

Two cues, both blind in some cases, hence a third verdict, "undecided":

* *Curl.* Gradients of a surface have no curl; with y upside down they have. Blind where ∂²z/∂x∂y vanishes (planes,
  grooves and tents along an axis, z = f(x) + g(y)).
* *Silhouette.* Where a closed object's outline turns away from the camera, its normals point out of the mask. Blind
  where the mask is no such outline (reliefs, whole frames). The red channel, which nobody flips, tests whether it is.

Photometric noise and 8-bit rounding weaken the curl cue and do not bias it. Concave and convex readings of the same
picture have the same verdict in the curl cue.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from psstereo.errors import InputError
from psstereo.metrics import integrability
from psstereo.types import BoolArray, FloatArray

__all__ = ["GreenVerdict", "green_convention"]

_STEPS = (1, 2, 4)
_MIN_BLOCKS = 100
_MIN_AGREEMENT = 0.25
_MIN_OUTLINE = 20
_MIN_GRAZING_SHARE = 0.3
_MIN_OUTWARD = 0.5


@dataclass(frozen=True, kw_only=True)
class GreenVerdict:
    """What the two cues say about a map that was read as "opengl".

    Attributes
    ----------
    verdict : {"opengl", "directx", "undecided"}
        Convention that the file seems to have been written in.
    relative_curl, relative_curl_flipped : float
        Curl as read and with y flipped: 0 for a smooth surface, 1 for noise; NaN where there is nothing to tell [1].
    curl_blocks : int
        Blocks of pixels behind these two figures.
    outward_x, outward_y : float
        How far red and green point out of the mask along its outline, from −1 (inward) to 1; NaN where the mask is no
        outline [1].
    outline : int
        Steep pixels along the outline behind these two figures.
    sentence : str
        Verdict, reason and what to do, for a person.
    """

    verdict: Literal["opengl", "directx", "undecided"]
    relative_curl: float
    relative_curl_flipped: float
    curl_blocks: int
    outward_x: float
    outward_y: float
    outline: int
    sentence: str


def green_convention(normals: FloatArray, mask: BoolArray | None = None) -> GreenVerdict:
    """Check whether a normal map that was read as "opengl" looks like "directx".

    Parameters
    ----------
    normals : float array (h, w, 3)
        Normals as read with the convention "opengl"; NaN where there is none [1].
    mask : bool array (h, w), optional
        Pixels of the object; those with a finite normal when left out.

    Returns
    -------
    GreenVerdict
        The verdict, both cues' figures and a sentence. When the cues contradict each other, or both are weak, the
        verdict is "undecided".

    Raises
    ------
    InputError
        If the shapes are wrong.
    """
    array = np.asarray(normals)
    if array.ndim != 3 or array.shape[-1] != 3 or (mask is not None and np.shape(mask) != array.shape[:2]):
        raise InputError(
            given=f"The normals have shape {array.shape}, the mask {None if mask is None else np.shape(mask)}.",
            needed="Normals (h, w, 3) and a mask (h, w) of the same size are needed.",
            remedy="Give a whole normal map, not a list of pixels.",
        )
    inside = np.asarray(np.isfinite(array).all(axis=-1))
    if mask is not None:
        inside &= np.asarray(mask, dtype=np.bool_)
    candidates = [figures for step in _STEPS if (figures := integrability(array, inside, step=step)).blocks > 0]
    decisive = [figures for figures in candidates if figures.blocks >= _MIN_BLOCKS and np.isfinite(figures.agreement)]
    curl = max(decisive or candidates, key=lambda figures: abs(np.nan_to_num(figures.agreement)), default=None)
    # Noise alone scatters the agreement by about 1 over the root of the number of blocks.
    curl_vote = _vote(curl.agreement, max(_MIN_AGREEMENT, 4.0 / curl.blocks**0.5)) if curl and decisive else 0
    outward_x, outward_y, outline = _outward(array, inside)
    red, green = _vote(outward_x, _MIN_OUTWARD), _vote(outward_y, _MIN_OUTWARD)
    verdict, sentence = _judge(curl_vote, red, green)
    nan = float("nan")
    return GreenVerdict(
        verdict=verdict,
        relative_curl=curl.relative_curl if curl else nan,
        relative_curl_flipped=curl.relative_curl_flipped if curl else nan,
        curl_blocks=curl.blocks if curl else 0,
        outward_x=outward_x,
        outward_y=outward_y,
        outline=outline,
        sentence=sentence,
    )


def _vote(score: float, threshold: float) -> int:
    """Return 1, −1, or 0 where the score is too weak or NaN."""
    return int(np.sign(score)) if abs(score) >= threshold else 0


def _judge(curl: int, red: int, green: int) -> tuple[Literal["opengl", "directx", "undecided"], str]:
    """Combine the votes: curl (1 fits as read), red and green at the outline (1 outward)."""
    if red < 0 and green > 0 and curl <= 0:
        return "undecided", (
            "Along the outline red points inward and green outward, so the red channel seems to be the flipped one. "
            "Look at the map before using it."
        )
    outline = green if red > 0 else 0
    if curl * outline < 0:
        return "undecided", (
            "The curl and the outline contradict each other, which happens with noisy maps and with masks that are "
            "not an outline. Look at the map: a bump lit from above is green above in 'opengl'."
        )
    total = curl + outline
    if total == 0:
        return "undecided", (
            "Neither the curl nor the outline tells which way green points, as with planes, grooves along an axis or "
            "noise. Ask the program that wrote the map."
        )
    reason = " and ".join(
        ["the gradients have less curl"] * (curl != 0) + ["the outline faces outward"] * (outline != 0)
    )
    if total > 0:
        return "opengl", f"Green is up: read this way, {reason}. Nothing has to be done."
    return "directx", f"Green seems to be down: with y flipped, {reason}. Read the map with the convention 'directx'."


def _outward(normals: FloatArray, inside: BoolArray) -> tuple[float, float, int]:
    """Return how far x and y of the normals point out of the mask at its outline, and the pixels used.

    The frame of the picture is not an outline. Each score is Σ n·o / Σ |n·o| over steep pixels, o the outward
    direction; NaN when they are few, or when the outline hardly runs across that axis.
    """
    from scipy import ndimage

    nan = float("nan")
    edge: BoolArray = inside & ~np.asarray(ndimage.binary_erosion(inside, border_value=1), dtype=np.bool_)
    x, y = np.asarray(normals[..., 0], dtype=np.float64)[edge], np.asarray(normals[..., 1], dtype=np.float64)[edge]
    steep = np.hypot(x, y) > 0.5
    count = int(np.count_nonzero(steep))
    if count < _MIN_OUTLINE or count < _MIN_GRAZING_SHARE * steep.size:
        return nan, nan, count
    soft = np.asarray(ndimage.gaussian_filter(inside.astype(np.float64), 2.0, mode="nearest"))
    down, right = (np.asarray(np.gradient(soft, axis=axis)) for axis in (0, 1))
    out_x, out_y = -right[edge][steep], down[edge][steep]
    length = np.hypot(out_x, out_y)
    scores = []
    for component, out in ((x[steep], out_x), (y[steep], out_y)):
        product = component * out / np.where(length > 0, length, 1.0)
        weight = float(np.sum(np.abs(product)))
        scores.append(float(np.sum(product)) / weight if weight > 0.05 * count else nan)
    return scores[0], scores[1], count
