"""A folder with a page that shows an object under any light, and the planes that it is made of."""

import base64
import html
import json
import os
from pathlib import Path
from string import Template

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.io.atomic import new_folder
from psstereo.io.rti_planes import RelightPlanes
from psstereo.types import Array

__all__ = ["write_web_relight"]

_PAGE = "index.html"
_ORDER = {"ptm": (5, 3, 4, 0, 2, 1)}
"""Order of the terms in pictures where it is not that of files: of polynomials 1, u, v, u², u v, v²."""


def write_web_relight(
    folder: str | os.PathLike[str],
    planes: RelightPlanes,
    *,
    title: str = "relit",
    quality: int | None = None,
    overwrite: bool = False,
) -> None:
    """Write ``index.html``, which opens without a network, and beside it ``info.json`` and ``plane_0.png …``.

    The page has all planes in it and needs none of the other files, since a browser lets no page read pictures beside
    it on a disk. It shows the same bytes as :func:`psstereo.forward.polynomial_maps.relit_picture`. The other files are
    for programs that load planes, three a picture, rows from the top: a plane's value is ``(byte / 255 − bias) ·
    scale``, full scale 1. Not for pictures of many megapixels: the page decodes them whole.

    Parameters
    ----------
    folder : path
        New or empty folder.
    planes : RelightPlanes
        The coefficients.
    title : str
        Heading of the page.
    quality : int, optional
        Of JPEG pictures, 1 to 100, a third as large or less, the kind that OpenLIME takes; what the page shows then
        differs a little from the coefficients. PNG, without loss, if absent.
    overwrite : bool
        Whether a folder may be replaced that holds just these files.

    Raises
    ------
    OptionError
        If the quality is out of its range.
    ExistingResultError
        If something is in the way.
    InputError
        If a picture is too large to be coded.
    """
    if quality is not None and not 1 <= quality <= 100:
        raise OptionError(given=f"The quality is {quality}.", needed="1 to 100.", remedy="Take 95.")
    pictures = _pictures(planes)
    ending, kind = ("png", "png") if quality is None else ("jpg", "jpeg")
    coded = [_coded(picture, quality) for picture in pictures]
    names = [f"plane_{i}.{ending}" for i in range(len(coded))]
    height, width = planes.size
    addresses = [f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}" for data in coded]
    with new_folder(Path(folder), overwrite=overwrite, names=[_PAGE, "info.json", *names]) as work:
        for name, data in zip(names, coded, strict=True):
            (work / name).write_bytes(data)
        (work / "info.json").write_text(json.dumps(_info(planes, ending), indent=1) + "\n", encoding="utf-8")
        template = Template(Path(__file__).with_name("web_relight.html").read_text(encoding="utf-8"))
        page = template.substitute(
            title=html.escape(title),
            width=width,
            height=height,
            data=json.dumps(_page_data(planes, addresses)).replace("</", "<\\/"),
        )
        (work / _PAGE).write_text(page, encoding="utf-8", newline="\n")


def _order(planes: RelightPlanes) -> tuple[int, ...]:
    return _ORDER.get(planes.basis, tuple(range(len(planes.codes))))


def _pictures(planes: RelightPlanes) -> list[Array]:
    """Return pictures of three planes each: the colour and two pictures of terms, or a term of three channels each."""
    order = _order(planes)
    if planes.colour is not None:
        terms = [planes.codes[t, ..., 0] for t in order]
        return [planes.colour, *(np.stack(terms[i : i + 3], axis=-1) for i in range(0, len(terms), 3))]
    return [np.broadcast_to(planes.codes[t], (*planes.size, 3)) for t in order]


def _page_data(planes: RelightPlanes, addresses: list[str]) -> dict[str, object]:
    order = _order(planes)
    places = {term: place for place, term in enumerate(order)}
    terms = range(len(order))
    if planes.colour is not None:
        where = [[[1 + places[t] // 3, places[t] % 3]] for t in terms]
    else:
        where = [[[places[t], c] for c in range(planes.codes.shape[3])] for t in terms]
    return {
        "basis": planes.basis,
        "levels": planes.levels().tolist(),
        "where": where,
        "colour": None if planes.colour is None else 0,
        "pictures": addresses,
    }


def _info(planes: RelightPlanes, ending: str) -> dict[str, object]:
    """Return the facts that relight's and OpenLIME's pages take, in the order of the pictures' planes."""
    height, width = planes.size
    scale, bias = planes.scale, planes.bias / 255.0 if planes.basis == "ptm" else -planes.bias / planes.scale
    each = 1 if planes.colour is not None else 3
    head = 3 if planes.colour is not None else 0
    scales = [1.0] * head + [float(scale[t]) for t in _order(planes) for _ in range(each)]
    biases = [0.0] * head + [float(bias[t]) for t in _order(planes) for _ in range(each)]
    return {
        "width": width,
        "height": height,
        "format": ending,
        "type": planes.basis.rstrip("0123456789"),
        "colorspace": "rgb" if planes.colour is None else "lrgb",
        "nplanes": len(scales),
        "materials": [{"scale": scales, "bias": biases, "range": [1.0] * len(scales)}],
    }


def _coded(picture: Array, quality: int | None) -> bytes:
    import cv2

    rows = np.ascontiguousarray(picture[..., ::-1])
    if quality is None:
        done, data = cv2.imencode(".png", rows, [cv2.IMWRITE_PNG_COMPRESSION, 6])
    else:
        full = cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444
        options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, full]
        done, data = cv2.imencode(".jpg", rows, options)
    if not done:
        raise InputError(
            given=f"A picture of the shape {picture.shape} could not be coded.",
            needed="A picture within the limits of its format.",
            remedy="Crop the images to the object, or bin their pixels.",
        )
    return bytes(data.tobytes())
