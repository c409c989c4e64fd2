"""The far-reaching shape of an object that is seen whole, from its outline alone."""

from dataclasses import replace

import numpy as np

from psstereo.camera import Orthographic
from psstereo.depth import Prior
from psstereo.depth.edges import EdgeSteps
from psstereo.depth.weighted import solve_weighted
from psstereo.errors import InputError, UnsupportedError
from psstereo.sfs.assumption import Assumption, Basis
from psstereo.sfs.image import ShadedImage
from psstereo.types import BoolArray, FloatArray

__all__ = ["inflated", "with_silhouette"]

_SOFT = 1e-9
"""Weight of a spring so soft and far away that it is a constant force."""
_STIFF = 1e6
"""Weight that holds the outline beside edges of weight 1."""
_ERROR = 0.2
"""Standard error of such heights, as a share of the greatest."""
_SHARED = 10.0
"""How far pixels err together: their heights count as those of so many pixels along each side would."""


def inflated(mask: BoolArray) -> FloatArray:
    """Return the heights of a balloon in an outline: z² solves ∇² z² = −4 and is 0 just outside.

    On a disc it is half a sphere, on a strip half an elliptic cylinder. Round things without parts before each other
    come close to it; flat ones do not.

    Parameters
    ----------
    mask : bool array (h, w)
        The object.

    Returns
    -------
    float64 array (h, w)
        Heights, NaN outside [pixel sides].
    """
    inside = np.pad(mask, 1)
    near = np.zeros_like(inside)
    near[1:] |= inside[:-1]
    near[:-1] |= inside[1:]
    near[:, 1:] |= inside[:, :-1]
    near[:, :-1] |= inside[:, 1:]
    ring = near & ~inside
    domain = inside | ring
    right = (domain[:, :-1] & domain[:, 1:]).astype(np.float64)
    down = (domain[:-1] & domain[1:]).astype(np.float64)
    steps = EdgeSteps(
        right=np.zeros_like(right), down=np.zeros_like(down), right_weight=right, down_weight=down, left_out=0
    )
    square = solve_weighted(
        steps,
        domain,
        prior=np.where(ring, 0.0, 4.0 / _SOFT),
        prior_weight=np.where(ring, _STIFF, _SOFT),
        tolerance=1e-8,
    ).values
    return np.where(mask, np.sqrt(np.maximum(square[1:-1, 1:-1], 0.0)), np.nan)


def with_silhouette(image: ShadedImage) -> ShadedImage:
    """Add the balloon in the mask's outline as depth that is known roughly.

    For an object that the mask cuts out along its own outline. It settles what shading alone leaves open, whether the
    whole bulges and how much; not for surfaces that go on beyond the mask.

    Parameters
    ----------
    image : ShadedImage
        Under parallel projection, with a mask and without a prior.

    Returns
    -------
    ShadedImage
        With the prior, and what it assumes among the sources.

    Raises
    ------
    UnsupportedError
        If the camera is a pinhole.
    InputError
        If there is no outline, or a prior already.
    """
    if not isinstance(image.camera, Orthographic):
        raise UnsupportedError(
            given=f"The camera is {image.camera.name}, and the outline was to tell the shape.",
            needed="Parallel projection.",
            remedy="Leave it out, or give a prior.",
        )
    if image.prior is not None or image.inside.all():
        has = "a prior" if image.prior is not None else "no mask that leaves anything out"
        raise InputError(
            given=f"The outline was to tell the shape, and the image has {has}.",
            needed="A mask along the object's outline, and no other knowledge of its depth.",
            remedy="Give the mask, or leave out one of the two.",
        )
    pixel = image.camera.pixel_size
    heights = inflated(image.inside) * pixel
    sigma = _ERROR * _SHARED * float(np.nanmax(heights))
    source = Assumption(
        name="silhouette",
        basis=Basis.ASSUMED,
        sentence="The object ends at the mask and bulges in it like a balloon, as far as shading says nothing else.",
    )
    prior = Prior(depth=heights, sigma=sigma, unit=image.camera.unit)
    return replace(image, prior=prior, sources=(*image.sources, source))
