"""From the words on the command line to a camera, and to a tone curve."""

from typing import TYPE_CHECKING

from psstereo.errors import OptionError

if TYPE_CHECKING:
    from psstereo.camera import Camera
    from psstereo.stack import Response

__all__ = ["described_camera", "parse_response"]


def described_camera(matrix: str | None, pixel_size: float | None) -> "Camera":
    """Return the camera that was described.

    Parameters
    ----------
    matrix : str or None
        A file with K, or its numbers; a pinhole camera then.
    pixel_size : float or None
        Length of a pixel on the surface under parallel projection [mm].

    Returns
    -------
    Camera
        Orthographic in pixels if nothing was said.

    Raises
    ------
    OptionError
        If both are given.
    """
    from psstereo.camera import Orthographic
    from psstereo.io.camera_file import parse_camera

    if matrix is not None and pixel_size is not None:
        raise OptionError(
            given="Both --K and --pixel-size are given.",
            needed="A pinhole camera has no size of a pixel on the surface, parallel projection no matrix.",
            remedy="Leave one of them out; for a pinhole, --distance or --prior gives the scale.",
        )
    if matrix is not None:
        return parse_camera(matrix)
    return Orthographic() if pixel_size is None else Orthographic(pixel_size=pixel_size, length_unit="mm")


def parse_response(text: str) -> "Response":
    """Return the tone curve that was named.

    Parameters
    ----------
    text : str
        ``linear``, ``srgb``, or the exponent of a gamma curve.

    Returns
    -------
    Response
        The curve.
    """
    from psstereo.stack import Response
    from psstereo_cli.execution import parse_floats

    if text in ("linear", "srgb"):
        return Response(text)
    return Response("gamma", parse_floats(text, 1, "response (linear, srgb, or the exponent of a gamma curve)")[0])
