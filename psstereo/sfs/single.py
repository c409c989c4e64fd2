"""From a photograph, or one of a capture, to the image that shape from shading works on."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from psstereo.camera import Camera, Orthographic
from psstereo.capture import Capture
from psstereo.errors import InputError, UnsupportedError
from psstereo.lights import Directional, Led, Light
from psstereo.sfs.assumption import Assumption, Basis
from psstereo.sfs.estimators import estimate_albedo_and_ambient, estimate_light
from psstereo.sfs.image import ShadedImage
from psstereo.stack import LINEAR, Response, gray_weights
from psstereo.stack.stack import full_scale
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["brightness", "image_of_capture", "image_of_photograph", "most_frontal"]


def brightness(
    frame: Array, *, response: Response = LINEAR, gray: str | Sequence[float] = "mean", white: float | None = None
) -> FloatArray:
    """Return linear brightness as a share of full scale.

    Parameters
    ----------
    frame : array (h, w) or (h, w, c)
        Pixel values: unsigned integers, or floats.
    response : Response
        Tone curve to undo.
    gray : str or sequence of float
        How channels become one, see :func:`psstereo.stack.gray_weights`.
    white : float, optional
        Value of full scale; from the type if absent.

    Returns
    -------
    float64 array (h, w)
        Brightness [full scale].

    Raises
    ------
    InputError
        If the array is no image.
    """
    values = np.asarray(frame)
    values = values[..., None] if values.ndim == 2 else values
    if values.ndim != 3 or values.size == 0 or values.dtype.kind not in "uf":
        raise InputError(
            given=f"The image is an array of shape {np.asarray(frame).shape} and type {values.dtype}.",
            needed="Unsigned integers or floating-point numbers, (h, w) or (h, w, c).",
            remedy="Check how it was read.",
        )
    top = full_scale(values.dtype) if white is None else white
    linear = response.linearise(values, top).astype(np.float64) / top
    weights = gray_weights(gray, linear.shape[2]).matrix
    if len(weights) != 1:
        raise UnsupportedError(
            given="The channels were to be kept apart.",
            needed="Shape from one image works on one brightness.",
            remedy="Choose one channel, or a mean of them.",
        )
    return np.asarray(linear @ weights[0])


def most_frontal(capture: Capture) -> int:
    """Return the image whose light is nearest to the camera's direction.

    Parameters
    ----------
    capture : Capture
        With distant lights, or lamps.

    Returns
    -------
    int
        Its place, from 0.
    """
    middle = np.zeros((1, 3))
    facing = [float(light.directions(middle)[0, 2]) for light in capture.rig.lights]
    return int(np.nanargmax(facing))


def image_of_capture(
    capture: Capture,
    index: int,
    *,
    gray: str | Sequence[float] = "mean",
    albedo: float | None = None,
    ambient: float = 0.0,
) -> ShadedImage:
    """Take one image of a capture, with its light.

    Parameters
    ----------
    capture : Capture
        Images and lights.
    index : int
        Which, from 0.
    gray : str or sequence of float
        How channels become one; the light's strength is taken alike.
    albedo : float, optional
        Brightness under unit irradiance; estimated from the brightest part if absent [full scale].
    ambient : float
        Level to subtract, beside the capture's dark image [full scale].

    Returns
    -------
    ShadedImage
        The image; its sources say what was estimated.

    Raises
    ------
    InputError
        If there is no such image.
    UnsupportedError
        If its light is neither a sun nor a lamp.
    """
    if not 0 <= index < len(capture.stack):
        raise InputError(
            given=f"Image {index + 1} is asked for.",
            needed=f"The capture {capture.name} has images 1 to {len(capture.stack)}.",
            remedy="Choose one of them.",
        )
    values = brightness(capture.linear(index), gray=gray, white=capture.stack.white)
    light = _one_channel(capture.rig.lights[index], gray)
    name = capture.stack.names[index]
    source = Assumption(
        name="image", basis=Basis.GIVEN, sentence=f"It is {name}, with the light of {capture.rig.source}."
    )
    image = ShadedImage(image=values, light=light, mask=capture.mask, camera=capture.camera, ambient=ambient)
    image = replace(image, sources=(source,))
    if albedo is not None:
        return replace(image, albedo=albedo)
    return _with_albedo(image, _strength(light))


def image_of_photograph(
    values: FloatArray,
    *,
    light: Light | None,
    albedo: float | None = None,
    ambient: float | None = 0.0,
    mask: BoolArray | None = None,
    camera: Camera | None = None,
) -> ShadedImage:
    """Put a photograph together with what is known of it, and estimate the rest.

    Parameters
    ----------
    values : float array (h, w)
        Linear brightness [full scale].
    light : Light or None
        The light; None estimates a distant one, by :func:`~psstereo.sfs.estimators.estimate_light`.
    albedo : float or None
        Brightness of the surface where it faces the light; None takes it from the brightest part, and under a lamp
        as 1, which leaves the scale of distances free [full scale].
    ambient : float or None
        Level that is added everywhere; None takes it from the darkest part [full scale].
    mask : bool array (h, w), optional
        The object.
    camera : Camera, optional
        Orthographic if absent.

    Returns
    -------
    ShadedImage
        The image; its sources say what was estimated.

    Raises
    ------
    InputError
        If the image tells nothing of what is to be estimated.
    """
    sources: list[Assumption] = []
    level = 0.0 if ambient is None else ambient
    if ambient is None:
        level = estimate_albedo_and_ambient(values, mask)[1]
        sentence = f"The level {level:.4g} of the darkest part was subtracted: it is taken as being in shadow."
        sources.append(Assumption(name="ambient", basis=Basis.ESTIMATED, sentence=sentence))
    if light is None:
        found = estimate_light(values - level, mask)
        light = Directional(direction=found.direction, strength=np.ones(1))
        sentence = (
            f"A sun at azimuth {np.degrees(found.tilt):.1f}° and elevation {90 - np.degrees(found.slant):.1f}°, by the "
            f"statistics of a round object (clearness {found.clearness:.2f})."
        )
        sources.append(Assumption(name="light", basis=Basis.ESTIMATED, sentence=sentence))
    image = ShadedImage(
        image=values, light=light, mask=mask, camera=camera or Orthographic(), ambient=level, sources=tuple(sources)
    )
    return _with_albedo(image, _strength(light)) if albedo is None else replace(image, albedo=albedo)


def _with_albedo(image: ShadedImage, strength: float | None) -> ShadedImage:
    """Take the albedo from the brightest part of the image; for a lamp it is only a matter of scale."""
    if isinstance(image.light, Led):
        sentence = "It is taken as 1: distances from the lamp have a free scale, which the square root of it settles."
        return replace(
            image, sources=(*image.sources, Assumption(name="albedo", basis=Basis.ASSUMED, sentence=sentence))
        )
    if strength is None:
        raise UnsupportedError(
            given=f"The albedo is not given, and the light is of the kind {image.light.name}.",
            needed="Only under a sun the brightest part tells it, if it faces the sun.",
            remedy="Give the albedo: brightness under unit irradiance.",
        )
    top = sum(estimate_albedo_and_ambient(image.image, image.inside)) - image.ambient
    if not top > 0:
        raise InputError(
            given=f"The brightest part of the image is {top:.4g} above the ambient level.",
            needed="Light on the surface.",
            remedy="Check image, mask and ambient level.",
        )
    sentence = f"It is {top / strength:.4g}: the brightest part of the image is taken as facing the light."
    source = Assumption(name="albedo", basis=Basis.ESTIMATED, sentence=sentence)
    return replace(image, albedo=top / strength, sources=(*image.sources, source))


def _strength(light: Light) -> float | None:
    return float(light.strength[0]) if isinstance(light, Directional) else None


def _one_channel(light: Light, gray: str | Sequence[float]) -> Light:
    """Return the light as the mixture of channels that the image holds."""
    if isinstance(light, Directional):
        weights = gray_weights(gray, light.strength.size).matrix[0]
        return Directional(direction=light.direction, strength=np.array([light.strength @ weights]))
    if isinstance(light, Led):
        weights = gray_weights(gray, light.flux.size).matrix[0]
        return replace(light, flux=np.array([light.flux @ weights]))
    raise UnsupportedError(
        given=f"The image's light is of the kind {light.name}.",
        needed="A sun or a lamp.",
        remedy="Choose another image, or give image and light by themselves.",
    )
