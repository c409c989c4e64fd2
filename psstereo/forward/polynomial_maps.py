"""Relightable pictures: the brightness of each pixel as a short series over the light's direction."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError, RigError
from psstereo.io.rti_planes import TERMS, RelightPlanes, quantised_planes
from psstereo.lights.vectors import unit_vector
from psstereo.stack.stack import full_scale
from psstereo.types import Array, FloatArray, Progress, no_progress

__all__ = ["PolynomialMaps", "basis_values", "fit_polynomial_maps", "relit_picture"]

_WORST_CONDITION = 1e3
"""Of the basis at the lights; beyond it noise grows more than the 255 steps of a coefficient can hold."""
_POWER_STEPS = 4
_TOGETHER = 8
"""Images that are held at a time, for one product of matrices."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PolynomialMaps:
    """Coefficients of each pixel's brightness.

    Attributes
    ----------
    basis : str
        A key of :data:`psstereo.io.rti_planes.TERMS`.
    coefficients : float64 array (t, h, w, c)
        Of values as a screen takes them, full scale 1.
    planes : RelightPlanes
        The same as bytes, for the writers, in colour as it was asked for.
    residual : float
        Root-mean-square difference between the images and the series at their own lights, before rounding [1].
    notes : tuple of str
        What was left out, as sentences.
    """

    basis: str
    coefficients: FloatArray
    planes: RelightPlanes
    residual: float
    notes: tuple[str, ...] = ()


def basis_values(basis: str, directions: npt.ArrayLike) -> FloatArray:
    """Return the terms of a basis at directions.

    The harmonics are those of Gautron et al. [1]_, orthonormal over the hemisphere, written in x, y, z so that the view
    itself is no special case.

    Parameters
    ----------
    basis : str
        A key of :data:`psstereo.io.rti_planes.TERMS`.
    directions : float array (..., 3)
        Unit vectors, z ≥ 0 [1].

    Returns
    -------
    float64 array (..., t)
        PTM: u², v², u v, u, v, 1. HSH: by degree, as ``.rti`` files have them [1].

    Raises
    ------
    OptionError
        If the basis is unknown.

    References
    ----------
    .. [1] P. Gautron, J. Křivánek, S. Pattanaik, K. Bouatouch, "A novel hemispherical basis for accurate and efficient
       rendering", EGSR 2004.
    """
    if basis not in TERMS:
        raise OptionError(
            given=f"The basis is {basis!r}.", needed=f"It is one of {', '.join(TERMS)}.", remedy="Choose one of them."
        )
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    if basis == "ptm":
        return np.stack([x * x, y * y, x * y, x, y, np.ones_like(x)], axis=-1)
    first, second = math.sqrt(6.0 / math.pi), math.sqrt(30.0 / math.pi)
    side = np.sqrt(z / (1.0 + z))  # √(cos θ − cos² θ) over sin θ
    middle = 2.0 * z - 1.0
    terms = [
        np.full_like(x, math.sqrt(1.0 / (2.0 * math.pi))),
        first * x * side,
        math.sqrt(3.0 / (2.0 * math.pi)) * middle,
        first * y * side,
    ]
    if basis == "hsh9":
        twice = -second * z / (1.0 + z)
        terms += [
            twice * (x * x - y * y),
            second * x * middle * side,
            math.sqrt(5.0 / (2.0 * math.pi)) * (1.0 - 6.0 * z + 6.0 * z * z),
            second * y * middle * side,
            twice * 2.0 * x * y,
        ]
    return np.stack(terms, axis=-1)


def fit_polynomial_maps(
    capture: Capture,
    *,
    basis: str = "ptm",
    colour: str = "lrgb",
    curve: str = "srgb",
    exposure: float = 1.0,
    progress: Progress = no_progress,
) -> PolynomialMaps:
    """Fit the series to a capture, each pixel by least squares over its lights.

    All pixels have the same design matrix, so that one QR factorisation serves them, and images are taken eight at a
    time; 8 (t + 8) c bytes a pixel are held. Shadows and highlights take part, as RTI shows them, if softly: a series
    of so few terms has no edges. For normals and albedo use a solver, not this.

    Parameters
    ----------
    capture : Capture
        Images under distant lights with z > 0; others are left out, and the notes say so.
    basis : str
        A key of :data:`psstereo.io.rti_planes.TERMS`.
    colour : {"lrgb", "rgb"}
        One series of brightness times a colour, for ``.ptm`` only; or a series for each channel.
    curve : {"srgb", "linear"}
        What a screen makes of values. Viewers show them as they are, so that light is put on the sRGB curve first.
    exposure : float
        Factor on the light, of which 1 is then white [1].
    progress : callable
        Told how many images are read.

    Returns
    -------
    PolynomialMaps
        The coefficients, and as bytes.

    Raises
    ------
    OptionError
        If a word is unknown or the exposure not positive.
    InputError
        If images have other than one or three channels.
    RigError
        If there are fewer lights than terms, or they stand so that the terms cannot be told apart, as on one ring.
    UnsupportedError
        If a light is not distant.
    """
    _check_words(basis, colour, curve, exposure)
    directions = capture.rig.directions
    front = np.flatnonzero(directions[:, 2] > 0)
    q, r = _factor(basis, directions[front])
    _, height, width, channels = capture.stack.shape
    if channels not in (1, 3):
        raise InputError(
            given=f"The images have {channels} channels.", needed="One, or R, G and B.", remedy="Choose some of them."
        )
    strengths = capture.rig.strengths(channels)
    factors = exposure * strengths.mean() / strengths / capture.stack.white
    projected = np.zeros((TERMS[basis], height * width * channels))
    power = 0.0
    for start in range(0, len(front), _TOGETHER):
        part = front[start : start + _TOGETHER]
        values = np.stack([_shown(capture, int(i), factors[i], curve).ravel() for i in part])
        power += float(np.vdot(values, values))
        projected += q[start : start + len(part)].T @ values
        progress("fitting the series", start + len(part), len(front))
    # The images' part outside the range of the basis; its square is a difference, so that rounding may show.
    rest = max(0.0, power - float(np.vdot(projected, projected)))
    coefficients = np.linalg.solve(r, projected).reshape(len(projected), height, width, channels)
    lost = len(directions) - len(front)
    note = f"{lost} images with light from the side or from behind (z ≤ 0) were left out."
    return PolynomialMaps(
        basis=basis,
        coefficients=coefficients,
        planes=_planes(coefficients, basis, colour),
        residual=math.sqrt(rest / (len(front) * height * width * channels)),
        notes=(note,) if lost else (),
    )


def relit_picture(planes: RelightPlanes, light: npt.ArrayLike) -> Array:
    """Return the picture under a light: uint8 (h, w, c), three channels where the planes have a colour.

    The sum of the terms in their order, times the colour over 255, clipped to 0 … 255 and rounded half up: a page that
    does the same sum shows the same picture.

    Parameters
    ----------
    planes : RelightPlanes
        The coefficients.
    light : float array (3,)
        Toward the light, z ≥ 0 [1].

    Raises
    ------
    RigError
        If the light is zero or not finite, or below the picture's plane.
    """
    direction = unit_vector(light, "light direction")
    if direction[2] < 0:
        raise RigError(
            given=f"The light has z = {direction[2]:.3g}, behind the picture.",
            needed="A series over the hemisphere has no values there.",
            remedy="Take a light in front, z ≥ 0.",
        )
    weights = basis_values(planes.basis, direction)
    table = planes.levels() * weights[:, None]
    total = table[0][planes.codes[0]]
    for term in range(1, len(table)):
        total = total + table[term][planes.codes[term]]
    if planes.colour is not None:
        total = total * planes.colour / 255.0
    return np.asarray(np.floor(np.clip(total, 0.0, 255.0) + 0.5), np.uint8)


def _check_words(basis: str, colour: str, curve: str, exposure: float) -> None:
    for what, word, known in (
        ("basis", basis, tuple(TERMS)),
        ("colour", colour, ("lrgb", "rgb")),
        ("curve", curve, ("srgb", "linear")),
    ):
        if word not in known:
            raise OptionError(
                given=f"The {what} is {word!r}.", needed=f"It is one of {', '.join(known)}.", remedy="Choose one."
            )
    if not 0 < exposure < np.inf:
        raise OptionError(given=f"The exposure is {exposure}.", needed="A positive number.", remedy="Take 1.")
    if basis != "ptm" and colour == "lrgb":
        raise OptionError(
            given=f"The basis is {basis} and the colour lrgb.",
            needed="Files of hemispherical harmonics have a series for each channel.",
            remedy="Choose the colour rgb, or the basis ptm.",
        )


def _factor(basis: str, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    terms = TERMS[basis]
    if len(directions) < terms:
        raise RigError(
            given=f"{len(directions)} lights are in front of the object.",
            needed=f"The basis {basis} has {terms} terms, and needs as many lights at least.",
            remedy="Take more images" + (", or the basis hsh4." if terms > 4 and len(directions) >= 4 else "."),
        )
    q, r = np.linalg.qr(basis_values(basis, directions))
    condition = float(np.linalg.cond(r))
    if not condition < _WORST_CONDITION:
        raise RigError(
            given=f"At these {len(directions)} lights the terms of {basis} are nearly the same (condition "
            f"{condition:.2g}).",
            needed="Lights at several angles from the view; those of one ring cannot tell how brightness changes "
            "across it.",
            remedy="Add a light near the camera, or a second ring"
            + (", or take a series of fewer terms: --basis hsh4." if terms > 4 else "."),
        )
    return q, r


def _shown(capture: Capture, index: int, factors: FloatArray, curve: str) -> FloatArray:
    """Return an image as a screen takes it, for light of mean strength, from 0 to 1; NaN counts as black."""
    stack = capture.stack
    as_it_is = capture.response.is_linear and capture.dark is None and capture.flat is None
    if as_it_is and stack.dtype.kind == "u":  # whole numbers: the curve once for each, not for each pixel
        frame = stack.frame(index)
        codes = np.arange(full_scale(stack.dtype) + 1.0)
        tables = [_on_curve(codes * factor, curve) for factor in factors]
        return np.stack([table[frame[..., c]] for c, table in enumerate(tables)], axis=-1)
    return _on_curve(np.nan_to_num(capture.linear(index).astype(np.float64) * factors), curve)


def _on_curve(light: FloatArray, curve: str) -> FloatArray:
    """Return light, clipped to 0 … 1, on the curve of a screen."""
    inside = np.clip(light, 0.0, 1.0)
    if curve == "linear":
        return inside
    return np.where(inside <= 0.0031308, 12.92 * inside, 1.055 * np.maximum(inside, 0.0031308) ** (1 / 2.4) - 0.055)


def _planes(coefficients: FloatArray, basis: str, colour: str) -> RelightPlanes:
    """Round the coefficients; for LRGB, find each pixel's colour, and the brightness that goes with it as rounded."""
    if colour == "rgb":
        return quantised_planes(coefficients, basis)
    if coefficients.shape[3] == 1:
        white = np.full((*coefficients.shape[1:3], 3), 255, np.uint8)
        return quantised_planes(coefficients, basis, colour=white)
    flat = coefficients.reshape(len(coefficients), -1, 3)
    # Over the hemisphere the terms are not equally large; the root of their mean products weighs the coefficients.
    root = np.linalg.cholesky(_hemisphere_moments())
    weighed = np.tensordot(root.T, flat, 1)
    paint_like = np.ones((flat.shape[1], 3))
    for _ in range(_POWER_STEPS):  # toward the principal colour; the three series are nearly multiples of each other
        along = (weighed * paint_like).sum(axis=2, keepdims=True)
        paint_like = (weighed * along).sum(axis=0)
        top = np.abs(paint_like).max(axis=1, keepdims=True)
        paint_like = np.where(top > 0, np.abs(paint_like) / np.where(top > 0, top, 1.0), 1.0)
    paint = np.rint(255.0 * paint_like).astype(np.uint8)
    share = paint / 255.0
    brightness = np.einsum("tpc,pc->tp", flat, share) / np.maximum((share * share).sum(axis=1), 1e-12)
    size = coefficients.shape[1:3]
    return quantised_planes(
        brightness.reshape(len(flat), *size, 1), basis, colour=np.ascontiguousarray(paint.reshape(*size, 3))
    )


def _hemisphere_moments() -> FloatArray:
    """Return mean products of PTM's terms over the disc of (u, v), each point as likely, (6, 6)."""
    radii, angles = np.sqrt((np.arange(16) + 0.5) / 16), np.arange(16) * (2 * np.pi / 16)
    u, v = (radii[:, None] * np.cos(angles)).ravel(), (radii[:, None] * np.sin(angles)).ravel()
    terms = basis_values("ptm", np.stack([u, v, np.sqrt(1 - u * u - v * v)], axis=-1))
    return np.asarray(terms.T @ terms / len(terms))
