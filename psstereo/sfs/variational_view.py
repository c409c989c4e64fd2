"""Depth of either camera as the height that is solved for, in pixels, and back."""

import math
from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import InputError, UnsupportedError
from psstereo.results import DepthKind
from psstereo.sfs.image import ShadedImage
from psstereo.types import BoolArray, FloatArray

__all__ = ["Window", "inside_window", "known_heights", "prior_heights"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Window:
    """The smallest rectangle that holds the mask, seen by the camera.

    Attributes
    ----------
    rows, columns : slice
        Where it is in the image.
    inside : bool array (h, w)
        The mask in it.
    frame : float64 array (3, 3, 3)
        Normals from slopes, see :mod:`psstereo.kernels.shading_step`.
    central : bool
        Whether heights are logarithms of distances.
    length : float
        Size of a pixel [camera's unit], or focal length [px].
    unit : str
        Unit of the depth.
    """

    rows: slice
    columns: slice
    inside: BoolArray
    frame: FloatArray
    central: bool
    length: float
    unit: str

    def to_heights(self, depth: FloatArray) -> FloatArray:
        """Return depths as heights: over the pixel's size, or the logarithm times the focal length [px]."""
        return np.asarray(self.length * np.log(depth) if self.central else depth / self.length)

    def to_depth(self, heights: FloatArray) -> FloatArray:
        """Return heights as depths [unit]."""
        return np.asarray(np.exp(heights / self.length) if self.central else heights * self.length)

    def normals(self, p: FloatArray, q: FloatArray) -> FloatArray:
        """Return unit normals (h, w, 3) of slopes along rows and down columns."""
        rows, columns = np.indices(self.inside.shape, dtype=np.float64)
        places = (np.ones(p.shape), columns, rows)
        factors = (p, q, places[0])
        normal = np.zeros((*p.shape, 3))
        for k in range(3):
            for m in range(3):
                normal += (factors[k] * places[m])[..., None] * self.frame[k, m]
        return np.asarray(normal / np.sqrt((normal * normal).sum(axis=-1, keepdims=True)))


def inside_window(image: ShadedImage) -> Window:
    """Return the rectangle of an image's mask, and what its camera makes of slopes there.

    For a central projection the point is z d with the ray d, affine over the image, and z = exp(s / f): the normal is
    (d + f ∂d/∂row …) × … = A p + B q + C with A = f ∂d/∂row × d, B = f d × ∂d/∂column and C = f² ∂d/∂row × ∂d/∂column.
    """
    inside = image.inside
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    top, left = int(rows[0]), int(columns[0])
    camera = image.camera
    frame = np.zeros((3, 3, 3))
    if isinstance(camera, Orthographic):
        frame[:, 0] = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        length = camera.pixel_size
    elif isinstance(camera, Pinhole):
        rays = np.linalg.inv(camera.matrix) * np.array([[1.0], [-1.0], [-1.0]])
        across, down, corner = rays[:, 0], rays[:, 1], rays @ np.array([left, top, 1.0])
        length = math.sqrt(camera.fx * camera.fy)
        for k, ray in enumerate((corner, across, down)):
            frame[0, k], frame[1, k] = length * np.cross(down, ray), length * np.cross(ray, across)
        frame[2, 0] = length**2 * np.cross(down, across)
    else:
        raise _unknown(camera)
    central = camera.depth_kind is DepthKind.DISTANCE
    window = slice(top, int(rows[-1]) + 1), slice(left, int(columns[-1]) + 1)
    unit = image.prior.unit if image.prior is not None and central else camera.unit
    return Window(
        rows=window[0],
        columns=window[1],
        inside=np.ascontiguousarray(inside[window]),
        frame=frame,
        central=central,
        length=length,
        unit=unit,
    )


def _unknown(camera: Camera) -> UnsupportedError:
    return UnsupportedError(
        given=f"The camera is of the kind {camera.name}.",
        needed="Normals must be known as affine functions of the slopes.",
        remedy="Use an orthographic or pinhole camera.",
    )


def known_heights(image: ShadedImage, window: Window) -> tuple[BoolArray, FloatArray]:
    """Return where the height is known exactly, and the heights there [px], 0 elsewhere.

    Raises
    ------
    InputError
        If one is infinite, or a distance not positive.
    """
    if image.heights is None:
        return np.zeros_like(window.inside), np.zeros(window.inside.shape)
    depth = np.asarray(image.heights, np.float64)[window.rows, window.columns]
    known = window.inside & ~np.isnan(depth)
    bad = known & (np.isinf(depth) | (window.central & (depth <= 0)))
    if bad.any():
        raise InputError(
            given=f"{np.count_nonzero(bad)} of {np.count_nonzero(known)} known heights are infinite or no distance.",
            needed="Known heights are finite, and distances of a pinhole camera positive.",
            remedy="Use NaN where the depth is not known.",
        )
    return known, np.where(known, window.to_heights(np.where(known, depth, 1.0)), 0.0)


def prior_heights(image: ShadedImage, window: Window) -> tuple[FloatArray, FloatArray]:
    """Return heights wanted [px] and their weights beside the brightness; arrays of size 0 without a prior.

    The brightness, as a share of the greatest, counts with the standard error ``prior.angle``: a normal that turns by
    as much changes it by at most that. So the weight of a height is (angle / sigma)².

    Raises
    ------
    InputError
        If shape, unit, standard errors or distances do not fit.
    """
    if image.prior is None:
        return np.zeros((0, 0)), np.zeros((0, 0))
    prior = image.prior
    depth, sigma = np.asarray(prior.depth), np.asarray(prior.sigma, np.float64)
    if depth.shape != image.image.shape or sigma.shape not in {(), depth.shape} or depth.dtype.kind != "f":
        raise InputError(
            given=f"The prior depth has shape {depth.shape} and type {depth.dtype}, its error shape {sigma.shape}.",
            needed=f"Depth must be floating-point numbers for the {image.image.shape} pixels, its error too or one.",
            remedy="Bring the prior to the pixels of the image, with NaN where it is unknown.",
        )
    if not window.central and prior.unit != image.camera.unit:
        raise InputError(
            given=f"The prior is in {prior.unit}, the camera in {image.camera.unit}.",
            needed="Heights and prior must be in one unit.",
            remedy="Give the orthographic camera the size of its pixels in the unit of the prior.",
        )
    depth = depth[window.rows, window.columns].astype(np.float64)
    sigma = np.broadcast_to(sigma, image.image.shape)[window.rows, window.columns]
    known = window.inside & ~np.isnan(depth)
    fine = np.isfinite(depth) & np.isfinite(sigma) & (sigma > 0) & ((depth > 0) | (not window.central))
    if not (fine | ~known).all() or not 0 < prior.angle < np.inf:
        raise InputError(
            given=f"{np.count_nonzero(known & ~fine)} of {np.count_nonzero(known)} pixels with a prior depth have no "
            f"valid depth or standard error; the error of the normals is {prior.angle} rad.",
            needed="Standard errors must be positive and finite, and so must distances.",
            remedy="Use NaN where the depth is unknown, and check the unit.",
        )
    safe = np.where(known, depth, 1.0)
    error = np.where(known, sigma, 1.0) / (safe / window.length if window.central else window.length)
    heights = np.where(known, window.to_heights(safe), 0.0)
    return heights, np.where(known, (prior.angle / error) ** 2, 0.0)
