"""The camera's response as it stands in our own TOML files."""

import numpy as np

from psstereo.io.toml_section import Section
from psstereo.io.toml_text import toml_number, toml_rows, toml_text
from psstereo.stack import LINEAR, Response

__all__ = ["read_response", "response_line"]


def read_response(section: Section) -> Response:
    """Return the response of a section, linear if it says nothing.

    Parameters
    ----------
    section : Section
        The section; its key is ``response``.

    Returns
    -------
    Response
        What is to be undone.

    Raises
    ------
    InputError
        If it is none that is known.
    """
    value = section.values.get("response", "linear")
    if isinstance(value, list):
        knots = section.matrix("response", 2)
        return LINEAR if knots is None else Response.from_knots(knots[:, 0], knots[:, 1])
    if isinstance(value, int | float) and not isinstance(value, bool):
        return Response("gamma", float(value)) if value != 1 else LINEAR
    if value not in ("linear", "srgb"):
        raise section.wrong(
            "response", '"linear", "srgb", the exponent of a gamma curve such as 2.2, or [[value, light], …]'
        )
    return Response(str(value))


def response_line(response: Response) -> list[str]:
    """Return the line that :func:`read_response` reads, none for a linear response."""
    if response.is_linear:
        return []
    if response.name == "gamma":
        return [f"response = {toml_number(response.exponent)}"]
    if response.name == "curve":
        return toml_rows("response", np.array(response.knots))
    return [f"response = {toml_text(response.name, 'camera response')}"]
