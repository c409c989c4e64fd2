"""What a search for the camera's response has found, whichever way it went."""

from dataclasses import dataclass

from psstereo.io.rig_file import RigQuality
from psstereo.stack import LINEAR, Response

__all__ = ["ResponseFit", "gamma_or_linear", "nearly_linear"]

_TIMES = 3.0
"""Standard errors from 1 within which an exponent counts as 1."""
_SMALL = 0.01
"""Difference of an exponent from 1 that is too small to matter [1]."""


@dataclass(frozen=True, kw_only=True)
class ResponseFit:
    """A response, and how well it is known.

    Attributes
    ----------
    response : Response
        To be undone.
    exponent : float
        Of the gamma curve that fits best, whether or not it is the response [1].
    exponent_error : float
        Its standard error; where left-out exposures or lights tell another exponent, what that spread says [1].
    residual : float
        Root-mean-square difference between the observations and the model, as a share of full scale [1].
    observations : int
        Values that took part.
    quality : RigQuality
        The same in words.
    """

    response: Response
    exponent: float
    exponent_error: float
    residual: float
    observations: int
    quality: RigQuality


def nearly_linear(exponent: float, error: float) -> bool:
    """Return whether an exponent cannot be told from 1, or need not be."""
    return abs(exponent - 1.0) < max(_TIMES * error, _SMALL)


def gamma_or_linear(exponent: float, error: float) -> Response:
    """Return the gamma curve, or none where it would change nothing."""
    return LINEAR if nearly_linear(exponent, error) else Response("gamma", exponent)
