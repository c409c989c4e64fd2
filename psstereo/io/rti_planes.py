"""Coefficients of relightable pictures as bytes, the way that RTI files hold them."""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.types import Array, FloatArray

__all__ = ["TERMS", "RelightPlanes", "quantised_planes"]

TERMS = {"ptm": 6, "hsh4": 4, "hsh9": 9}
"""Terms of each basis: polynomials of RTI's ``.ptm`` files, and hemispherical harmonics of its ``.rti`` files."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RelightPlanes:
    """Coefficients of a basis over the light's direction, a byte each.

    Attributes
    ----------
    basis : str
        A key of :data:`TERMS`.
    codes : uint8 array (t, h, w, c)
        Coefficients of t terms, row 0 at the top. PTM: u², v², u v, u, v, 1; HSH: by degree.
    scale, bias : float64 array (t,)
        PTM: brightness in 255ths is ``(code − bias) · scale``, with whole numbers from 0 to 255 as biases. HSH:
        brightness is ``code / 255 · scale + bias``, both of them numbers that float32 holds [1].
    colour : uint8 array (h, w, 3) or None
        Colour that the brightness is multiplied by, over 255, where there is one channel of coefficients for all.
    """

    basis: str
    codes: Array
    scale: FloatArray
    bias: FloatArray
    colour: Array | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.codes.shape[1], self.codes.shape[2]

    def levels(self) -> FloatArray:
        """Return what each code of each term means, float64 (t, 256), in 255ths of full scale."""
        codes = np.arange(256.0)
        scale, bias = self.scale[:, None], self.bias[:, None]
        return (codes - bias) * scale if self.basis == "ptm" else 255.0 * (codes / 255.0 * scale + bias)


def quantised_planes(coefficients: FloatArray, basis: str, *, colour: Array | None = None) -> RelightPlanes:
    """Turn coefficients into bytes; each is within half a step of a 255th of its term's range.

    The range of a term is that of all pixels and channels, of PTM with zero in it, so that the bias is a byte, as some
    programs keep it. A few wild pixels make the steps coarse for all.

    Parameters
    ----------
    coefficients : float array (t, h, w, c)
        Coefficients of the brightness, full scale 1, in the order of :class:`RelightPlanes`.
    basis : str
        A key of :data:`TERMS`.
    colour : uint8 array (h, w, 3), optional
        Colour that the brightness is multiplied by.

    Returns
    -------
    RelightPlanes
        The bytes.

    Raises
    ------
    OptionError
        If the basis is unknown.
    InputError
        If shapes do not fit, or a coefficient is not finite.
    """
    if basis not in TERMS:
        raise OptionError(
            given=f"The basis is {basis!r}.", needed=f"It is one of {', '.join(TERMS)}.", remedy="Choose one of them."
        )
    shape, channels = coefficients.shape, (1,) if colour is not None else (1, 3)
    fits = len(shape) == 4 and shape[0] == TERMS[basis] and 0 not in shape and shape[3] in channels
    if not fits or (colour is not None and (colour.shape != (*shape[1:3], 3) or colour.dtype != np.uint8)):
        raise InputError(
            given=f"The coefficients have the shape {shape}"
            + ("." if colour is None else f", the colour {colour.shape} {colour.dtype}."),
            needed=f"The basis {basis} has {TERMS[basis]} terms (t, h, w, c), of one channel or three; a colour is "
            "uint8 (h, w, 3) beside one channel.",
            remedy="Fit them with psstereo.forward.polynomial_maps.",
        )
    low, high = coefficients.min(axis=(1, 2, 3)), coefficients.max(axis=(1, 2, 3))
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise InputError(
            given="A coefficient is not finite.", needed="Numbers.", remedy="Fill pixels that are NaN, or crop them."
        )
    scale, bias = _ptm_steps(low, high) if basis == "ptm" else _hsh_steps(low, high)
    codes = np.zeros(shape, np.uint8)
    for term in range(len(codes)):
        value = coefficients[term].astype(np.float64)
        code = (
            value * 255.0 / scale[term] + bias[term] if basis == "ptm" else (value - bias[term]) / scale[term] * 255.0
        )
        codes[term] = np.clip(np.rint(code), 0.0, 255.0)
    return RelightPlanes(basis=basis, codes=codes, scale=scale, bias=bias, colour=colour)


def _ptm_steps(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return scales with as many digits as are written, and whole biases from 0 to 255."""
    bottom = np.minimum(low, 0.0)
    span = np.maximum(high, 0.0) - bottom
    scale = np.array([float(f"{s:.9g}") if s > 0 else 1.0 for s in span])
    return scale, np.abs(np.rint(bottom / scale * 255.0))


def _hsh_steps(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    scale = (high - low).astype(np.float32).astype(np.float64)
    return np.where(scale > 0, scale, 1.0), low.astype(np.float32).astype(np.float64)
