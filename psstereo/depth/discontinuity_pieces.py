"""Pieces that came loose, and where they are put.

Normals fix the shape of a piece that only cliffs part from its surroundings, but not its depth: every constant fits
equally well. What is left are statements about surfaces:

* Along their border one of both is in front, from end to end: surfaces touch and hide each other but do not pass
  through each other. The jump has one sign, and the piece is moved until it vanishes where it is least. This seats a
  plate on its hinge, and a cliff that runs from rim to rim at its lower end.
* Who is in front: whoever turns out of sight at the border, as the curvature before it tells; else the choice with
  the smaller jumps at the border's ends on the rim of the domain, since cliffs fade at their ends and not half-way;
  else that with the smaller jumps on the whole; if all are alike, the smaller piece, as an object before its
  background.
* What is known stays where the prior has it.
* Where a handle enters a pot, the border is no outline but a seam, and all of a seam's edges want the same move, so
  that a good part of the rest of the border wanting one and the same tells where the piece belongs, as long as nothing
  hidden comes to the front of what hides it. (At an outline agreement means nothing: a hidden surface begins where the
  outline ends by chance only.)
* Behind an outline nothing is seen of how far the hidden surface is away. It is at least behind the outline itself,
  which is the radius of curvature times the cosine of the slant beyond the last pixel; and a share of the radius
  behind that, or of the smaller piece's diameter: a small thing is not far from what it belongs to.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.depth.discontinuity_evidence import Pair, cosines, edge_ends, plane_steps
from psstereo.depth.discontinuity_parts import pieces_of
from psstereo.depth.domain import Domain
from psstereo.depth.edges import EdgeSteps
from psstereo.results import DepthKind
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["seat_pieces"]

_TAIL = 0.05
"""Share of a border that may contradict the sign of the jump, as noise and mixed pixels do [1]."""
_MIXED = 0.1
"""Share of an outline that may have what it hides in front, as mixed pixels are many there [1]."""
_AGREEING = 0.25
"""Share of a border that must fit for a piece to stay [1]."""
_FITS = 1.0
"""Jump that counts as none [px]."""
_ALIKE = 0.2
"""Relative difference of two choices' mean jumps that does not decide between them [1]."""
_RIM = 3
"""Distance from the rim of the domain up to which a border's edge is at its end [px]."""
_WITHIN = 1.0
"""Distance within which a surface must turn out of sight for its outline to be at an edge [px]."""
_BACK = 2
"""Distance over which the outline's curvature is measured [px]."""
_OUTLINED = 1.0 / 3.0
"""Share of a border from which an outline decides where the pieces are [1]."""
_SEAM = 0.1
"""Share of a border that must be a seam that fits for its piece to be put there [1]."""
_FEWEST = 6
"""Edges that must fit to make a seam [1]."""
_REACH = 2.0
"""Radii of the smaller piece, taken for a disc, that count for the outline's radius at most [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Border:
    """Edges between pieces, seen from the piece that is first; larger values are nearer, all lengths in pixels."""

    first: IntArray
    second: IntArray
    jump: FloatArray
    """Second end minus first end."""
    chord: FloatArray
    by_first: FloatArray
    by_second: FloatArray
    """Jumps expected from the mid normal and from either end's plane."""
    cosine: tuple[FloatArray, FloatArray]
    outward: tuple[FloatArray, FloatArray]
    """Component of the normals along the edge, positive toward the other piece."""
    radius: tuple[FloatArray, FloatArray]
    at_rim: BoolArray

    def only(self, chosen: Any, turned: BoolArray) -> "_Border":
        """Return some of the edges, those in `turned` seen from the other side."""
        sign = np.where(turned, -1.0, 1.0)

        def swapped(a: Any, b: Any) -> tuple[Any, Any]:
            a, b = a[chosen], b[chosen]
            return np.where(turned, b, a), np.where(turned, a, b)

        ends = swapped(self.first, self.second)
        by_first, by_second = swapped(self.by_first, self.by_second)
        return _Border(
            first=ends[0],
            second=ends[1],
            jump=sign * self.jump[chosen],
            chord=sign * self.chord[chosen],
            by_first=sign * by_first,
            by_second=sign * by_second,
            cosine=swapped(*self.cosine),
            outward=swapped(*self.outward),
            radius=swapped(*self.radius),
            at_rim=self.at_rim[chosen],
        )


def seat_pieces(
    domain: Domain,
    plain: EdgeSteps,
    factor: tuple[FloatArray, FloatArray],
    values: FloatArray,
    *,
    pitch: float,
    behind: float,
    prior: FloatArray | None = None,
) -> tuple[FloatArray, int]:
    """Move the pieces that came loose to where they plausibly are, or to where the prior wants them.

    Parameters
    ----------
    domain : Domain
        The domain.
    plain : EdgeSteps
        Steps and their weights before anything was let go.
    factor : float64 arrays (h, w − 1) and (h − 1, w)
        Share of its weight that each edge has kept [1].
    values : float64 array (h, w)
        The solution, in which each piece is up to a constant [camera's unit, or 1].
    pitch : float
        Distance of neighbouring pixels [camera's unit, or 1].
    behind : float
        Share of an outline's radius that hidden surfaces lie behind it [1].
    prior : float64 array (h, w), optional
        Values wanted where the domain's prior has weight [camera's unit, or 1].

    Returns
    -------
    values : float64 array (h, w)
        The values with each piece moved [camera's unit, or 1].
    moved : int
        Number of pieces that were parted from a neighbour.
    """
    pieces = pieces_of(domain.inside, plain, factor)
    sizes = np.bincount(pieces[domain.inside])
    if sizes.size == 1:
        return values, 0
    values, tied = _by_prior(domain, pieces, sizes.size, values, prior)
    nearer = -1.0 if domain.kind is DepthKind.DISTANCE else 1.0
    border = _border(domain, plain, pieces, values, nearer / pitch)
    shift, moved = _seats(border, sizes.astype(np.float64), tied, behind)
    return np.where(domain.inside, values + nearer * pitch * shift[pieces], values), moved


def _by_prior(
    domain: Domain, pieces: IntArray, count: int, values: FloatArray, prior: FloatArray | None
) -> tuple[FloatArray, BoolArray]:
    """Move each piece of which something is known to its prior's weighted mean; return also which these are."""
    if prior is None or domain.prior_weight is None:
        return values, np.zeros(count, np.bool_)
    weight, owner = domain.prior_weight[domain.inside], pieces[domain.inside]
    held = np.bincount(owner, weight, count)
    pull = np.bincount(owner, weight * (prior - values)[domain.inside], count)
    own = np.where(held > 0, pull / np.where(held > 0, held, 1.0), 0.0)
    return np.where(domain.inside, values + own[pieces], values), held > 0


def _border(domain: Domain, plain: EdgeSteps, pieces: IntArray, values: FloatArray, scale: float) -> _Border:
    """Gather the edges between different pieces."""
    from scipy.ndimage import binary_erosion

    cosine = cosines(domain)
    rim = ~np.asarray(binary_erosion(domain.inside, np.ones((3, 3), np.bool_), iterations=_RIM))
    parts = []
    across = (domain.normals[..., 0], -domain.normals[..., 1])
    for ends, weight, chord, along, axis in zip(
        edge_ends(), (plain.right_weight, plain.down_weight), (plain.right, plain.down), across, (1, 0), strict=True
    ):
        a, b = ends
        cut = (weight > 0) & (pieces[a] != pieces[b])
        steps = plane_steps(domain, ends)
        radius = _radii(along, domain.inside, ends, axis)
        parts.append(
            (
                pieces[a][cut],
                pieces[b][cut],
                *(scale * part[cut] for part in (values[b] - values[a], chord, steps[0], steps[1])),
                *(part[cut] for part in (cosine[a], cosine[b], along[a], -along[b], radius[0], radius[1])),
                (rim[a] | rim[b])[cut],
            )
        )
    first, second, jump, chord, by_first, by_second, *ends_of, at_rim = (
        np.concatenate(pair) for pair in zip(*parts, strict=True)
    )
    return _Border(
        first=first,
        second=second,
        jump=jump,
        chord=chord,
        by_first=by_first,
        by_second=by_second,
        cosine=(ends_of[0], ends_of[1]),
        outward=(ends_of[2], ends_of[3]),
        radius=(ends_of[4], ends_of[5]),
        at_rim=at_rim,
    )


def _radii(along: FloatArray, inside: BoolArray, ends: Pair, axis: int) -> tuple[FloatArray, FloatArray]:
    """Return the radius of curvature before each edge's first and behind its second end, NaN if it is not convex [px].

    Along a circle the normal's component in the direction of travel grows by 1 / radius a pixel.
    """
    known = np.where(inside, along, np.nan)
    back, ahead = np.full_like(known, np.nan), np.full_like(known, np.nan)
    source, target = [slice(None)] * 2, [slice(None)] * 2
    source[axis], target[axis] = slice(None, -_BACK), slice(_BACK, None)
    back[tuple(target)] = known[tuple(source)]
    ahead[tuple(source)] = known[tuple(target)]
    bends = (known - back)[ends[0]] / _BACK, (ahead - known)[ends[1]] / _BACK
    before, behind = (np.where(bend > 0, 1.0 / np.where(bend > 0, bend, 1.0), np.nan) for bend in bends)
    return before, behind


def _seats(border: _Border, sizes: FloatArray, tied: BoolArray, behind: float) -> tuple[FloatArray, int]:
    """Join pieces pair by pair, longest border first, and return each piece's shift and the number of joints.

    What is tied to a prior stays where it is.
    """
    count = sizes.size
    shift, root, moved = np.zeros(count), np.arange(count), 0
    while True:
        ends = root[border.first], root[border.second]
        apart = np.flatnonzero(ends[0] != ends[1])
        if apart.size == 0:
            return shift, moved
        low, high = np.minimum(*ends)[apart], np.maximum(*ends)[apart]
        keys, places, lengths = np.unique(low * count + high, return_inverse=True, return_counts=True)
        longest = int(np.argmax(lengths))
        chosen = apart[places == longest]
        a, b = divmod(int(keys[longest]), count)
        part = border.only(chosen, ends[0][chosen] != a)
        jump = part.jump + shift[part.second] - shift[part.first]
        if not (tied[a] and tied[b]):
            move = _move(part, jump, sizes[a], sizes[b], behind)
            shift[root == (a if tied[b] else b)] += -move if tied[b] else move
        root[root == b] = a
        sizes[a] += sizes[b]
        tied[a] |= tied[b]
        moved += 1


def _move(part: _Border, jump: FloatArray, size_first: float, size_second: float, behind: float) -> float:
    """Return by how much the second piece is to be moved nearer."""
    outlines = [_is_outline(part, k) for k in (0, 1)]
    shares = [float(outline.mean()) for outline in outlines]
    front = int(np.argmax(shares))
    touching = _contact(part, jump, front, outlines)
    if touching is not None:
        return touching
    if shares[front] > _OUTLINED:
        reach = _REACH * math.sqrt(min(size_first, size_second) / math.pi)
        return _behind_outline(part, jump, front, outlines[front], behind=behind, reach=reach)
    if np.mean(np.abs(jump - part.chord) < _FITS) >= _AGREEING:
        return 0.0
    flatter = np.where(np.abs(part.by_first) < np.abs(part.by_second), part.by_first, part.by_second)
    excess = jump - flatter
    low, high = (float(np.quantile(excess, share)) for share in (_TAIL, 1.0 - _TAIL))
    for some in (part.at_rim, np.ones(excess.size, np.bool_)):
        if some.any():
            to_front, to_back = float(np.mean(np.abs(excess - low)[some])), float(np.mean(np.abs(excess - high)[some]))
            if abs(to_front - to_back) > _ALIKE * max(to_front, to_back):
                return -low if to_front < to_back else -high
    return -low if size_second < size_first else -high


def _contact(part: _Border, jump: FloatArray, front: int, outlines: list[BoolArray]) -> float | None:
    """Return the move by which most of the border that is no outline fits, None if that is not convincing.

    Where a handle enters a pot, the border is a seam, and all its edges want the same move; elsewhere each wants
    another. No move is taken that leaves what an outline hides in front of it.
    """
    sign = 1.0 if front == 0 else -1.0
    seam = ~(outlines[0] | outlines[1])
    wanted = np.sort(sign * (jump - part.chord)[seam])
    if not (seam.any() and outlines[front].any()):
        return None
    fitting = np.searchsorted(wanted, wanted + 2.0 * _FITS, side="right") - np.arange(wanted.size)
    least = float(np.quantile((sign * jump)[outlines[front]], 1.0 - _MIXED))
    fitting = np.where(wanted + _FITS > least - _FITS, fitting, 0)
    best = int(np.argmax(fitting))
    count = int(fitting[best])
    if count < max(_AGREEING * wanted.size, _SEAM * seam.size, _FEWEST):
        return None
    return -sign * float(np.median(wanted[best : best + count]))


def _is_outline(part: _Border, end: int) -> BoolArray:
    """Return at which edges the surface at one end turns out of sight before the other end is reached."""
    cosine = part.cosine[end]
    turns_away = (cosine < part.cosine[1 - end]) & (part.outward[end] > 0)
    # From a point with this slant a circle's outline is radius · (1 − sin) away.
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    return np.asarray(turns_away & (part.radius[end] * cosine**2 / (1.0 + sine) < _WITHIN))


def _behind_outline(
    part: _Border, jump: FloatArray, front: int, outline: BoolArray, *, behind: float, reach: float
) -> float:
    """Return by how much the second piece is to be moved nearer if the outline is that of one piece."""
    sign = 1.0 if front == 0 else -1.0
    radius = float(np.median(part.radius[front][outline]))
    hidden = (sign * jump + radius * part.cosine[front])[outline]
    return -sign * (float(np.quantile(hidden, 1.0 - _MIXED)) + behind * min(radius, reach))
