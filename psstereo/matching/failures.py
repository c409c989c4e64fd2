"""Where brightness constancy breaks, and why: occluded, saturated, shadow-edge and specular pixels."""

from dataclasses import dataclass

import numpy as np

from psstereo.matching.constancy import Constancy
from psstereo.matching.images import ViewImages
from psstereo.types import BoolArray, FloatArray

__all__ = ["FailureReport", "failure_report"]

_DARK = 0.1
"""Share of a typical brightness below which a pixel counts as in shadow."""
_REACH = 2
"""How far from a shadow's outline pixels belong to it [px]."""
_AROUND = 15
"""Side of the neighbourhood than which a highlight is brighter [px]."""
_EXCESS = 0.1
"""By which share it is brighter."""

_SENTENCES = {
    "occluded": "The other view does not see the point.",
    "saturated": "A value ended at full scale in one of the views.",
    "shadow-edge": "A shadow ends there, in the middle of a pixel of one view and not of the other.",
    "specular": "A highlight stands in one of the views and moved with it.",
    "other": "Brightness differs for none of these reasons.",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class FailureReport:
    """Masks of what breaks constancy, each pixel in the first class that fits.

    Attributes
    ----------
    classes : mapping of str to bool array (h, w)
        Pixels by class: occluded, saturated, shadow-edge, specular, other.
    failing : bool array (h, w)
        Pixels that were compared and differ by more than noise.
    object_mask : bool array (h, w)
        The object.
    """

    classes: dict[str, BoolArray]
    failing: BoolArray
    object_mask: BoolArray

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Return a table: class, share of the object, share of all failures that are in it, and what it means."""
        total = max(int(self.object_mask.sum()), 1)
        failures = max(int(self.failing.sum()), 1)
        return [
            (
                name,
                f"{np.count_nonzero(where) / total:.2%}",
                "not compared"
                if name in ("occluded", "saturated")
                else f"{np.count_nonzero(where & self.failing) / failures:.1%}",
                _SENTENCES[name],
            )
            for name, where in self.classes.items()
        ]

    def shares(self) -> dict[str, float]:
        """Return the share of the object that each class covers [1]."""
        total = max(int(self.object_mask.sum()), 1)
        return {name: np.count_nonzero(where) / total for name, where in self.classes.items()}


def failure_report(
    constancy: Constancy,
    first: ViewImages,
    visible: BoolArray,
    saturated_there: BoolArray | None = None,
) -> FailureReport:
    """Say why brightness differs.

    Parameters
    ----------
    constancy : Constancy
        The comparison.
    first : ViewImages
        The first view.
    visible : bool array (h, w)
        Points that the second view sees.
    saturated_there : bool array (h, w), optional
        Where the second view is saturated, arranged as the first view's pixels.

    Returns
    -------
    FailureReport
        The classes.
    """
    mask = first.mask
    full = first.saturated.any(axis=(0, 1)) | (np.False_ if saturated_there is None else saturated_there)
    edges = np.zeros(mask.shape, np.bool_)
    shiny = np.zeros(mask.shape, np.bool_)
    for light in range(first.lights):
        here, there = first.values[light].mean(axis=0), constancy.second[light].mean(axis=0)
        edges |= _shadow_edges(here, mask) | _shadow_edges(there, mask & visible)
        apart = np.abs(constancy.difference[light])
        with np.errstate(invalid="ignore"):
            differs = (apart > 3).any(axis=0)
        shiny |= differs & _stands_out(np.maximum(here, there), mask)
    left = mask.copy()
    classes: dict[str, BoolArray] = {}
    for name, where in (
        ("occluded", ~visible),
        ("saturated", full),
        ("shadow-edge", edges & constancy.failing),
        ("specular", shiny & constancy.failing),
        ("other", constancy.failing),
    ):
        classes[name] = left & where
        left &= ~where
    return FailureReport(classes=classes, failing=constancy.failing, object_mask=mask)


def _shadow_edges(values: FloatArray, mask: BoolArray) -> BoolArray:
    """Return pixels near the outline of what is dark."""
    import cv2

    dark = mask & (values < _DARK * float(np.percentile(values[mask], 90)))
    bright = mask & ~dark
    side = 2 * _REACH + 1
    kernel = np.ones((side, side), np.uint8)
    near = [cv2.dilate(part.astype(np.uint8), kernel) > 0 for part in (dark, bright)]
    return np.asarray(near[0] & near[1])


def _stands_out(values: FloatArray, mask: BoolArray) -> BoolArray:
    """Return pixels that are brighter than what is usual on the object around them, or among its brightest."""
    import cv2

    solid = np.where(mask, values, 0.0).astype(np.float32)
    share = cv2.blur(mask.astype(np.float32), (_AROUND, _AROUND))
    around = cv2.blur(solid, (_AROUND, _AROUND)) / np.maximum(share, 1e-6)
    top = float(np.percentile(values[mask], 90))
    return np.asarray(mask & ((values > (1 + _EXCESS) * around) | (values > top)))
