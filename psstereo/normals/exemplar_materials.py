"""What each pixel is made of, in terms of the exemplar solver's lobes or materials."""

from dataclasses import dataclass

import numpy as np

from psstereo.kernels.exemplar import FAILED
from psstereo.lights import Rig
from psstereo.normals.exemplar import LOBES, Exemplar, fit_samples
from psstereo.normals.solver import Samples
from psstereo.types import FloatArray

__all__ = ["MaterialMap", "material_map"]


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialMap:
    """Amounts of each exemplar at some pixels.

    Attributes
    ----------
    names : tuple of str
        Of the exemplars: the lobes, or the materials in their order; the last is light from the surroundings.
    amounts : float64 array (p, q)
        In the unit of brightness over light strength; NaN where nothing could be fitted.
    residual : float64 array (p,)
        Where the loss of the residuals turns, as a share of the pixel's brightness: what the exemplars leave
        unexplained; NaN likewise [1].
    """

    names: tuple[str, ...]
    amounts: FloatArray
    residual: FloatArray


def material_map(rig: Rig, samples: Samples, *, solver: Exemplar | None = None) -> MaterialMap:
    """Return the amounts of each exemplar at every pixel.

    A lobe that no light excites at a pixel, as a sharp highlight that falls between the lights, has no effect on the
    brightness, and its amount there means nothing: not for rendering single pixels anew, but for means over regions.
    Amounts are told on matte pixels too, where the solver's normal is that of a simpler method.

    Parameters
    ----------
    rig : Rig
        The lights.
    samples : Samples
        Observations of the pixels.
    solver : Exemplar, optional
        With its materials, if it has any.

    Returns
    -------
    MaterialMap
        The amounts.

    Raises
    ------
    RigError
        If there are too few lights.
    """
    given = Exemplar() if solver is None else solver
    count = samples.values.shape[1]
    state = given.prepare(rig, count)
    _, fit, chosen, _ = fit_samples(given, state, samples)
    names = tuple(lobe.name for lobe in LOBES)
    if known := given.materials:
        names = (*(f"material-{k + 1}" for k in range(len(known))), names[-1])
    amounts, residual = np.full((count, len(names)), np.nan), np.full(count, np.nan)
    if fit is not None:
        stands = fit.outcome < FAILED
        amounts[chosen[stands]], residual[chosen[stands]] = fit.amounts[stands], fit.scale[stands]
    return MaterialMap(names=names, amounts=amounts, residual=residual)
