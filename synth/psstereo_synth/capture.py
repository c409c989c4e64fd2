"""Synthetic captures: images of a known surface, as a camera would deliver them."""

import numpy as np

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError
from psstereo.forward import lambertian_images
from psstereo.lights import Rig, StrengthUnit
from psstereo.stack import MemoryStack
from psstereo.types import Array, FloatArray
from psstereo_synth.surface import Surface

__all__ = ["expose", "lambertian_capture"]


def lambertian_capture(
    surface: Surface,
    albedo: FloatArray,
    directions: FloatArray,
    strengths: FloatArray | None = None,
    *,
    bits: int | None = 16,
    noise: float = 0.0,
    seed: int = 0,
    name: str = "synthetic",
) -> tuple[Capture, Truth]:
    """Photograph a matte surface under distant suns.

    Parameters
    ----------
    surface : Surface
        What is photographed.
    albedo : float array (h, w) or (h, w, c)
        Albedo πρ [1].
    directions : float array (m, 3)
        Toward the suns [1].
    strengths : float array (m,) or (m, c), optional
        Irradiance L_sun Ω_sun of a surface that faces the sun; 1000 if absent [W m⁻²].
    bits : int or None
        8 or 16 for a sensor that rounds to integers, None for float64 radiances over `radiance_at_white`.
    noise : float
        Standard deviation of Gaussian noise, as a share of full scale [1].
    seed : int
        Of the noise.
    name : str
        Name of the capture.

    Returns
    -------
    capture : Capture
        Images whose brightest value is 0.9 of full scale, with absolute lights.
    truth : Truth
        Normals, heights and albedo.

    Raises
    ------
    InputError
        If no light reaches the surface.
    """
    irradiance = np.full(len(directions), 1000.0) if strengths is None else np.asarray(strengths, np.float64)
    rig = Rig.distant(directions, irradiance, strength_unit=StrengthUnit.IRRADIANCE, source="synthetic suns")
    radiance = lambertian_images(surface.normals, np.asarray(albedo) / np.pi, rig)
    radiance *= surface.mask[..., None]
    white = float(radiance.max()) / 0.9
    if not white > 0:
        raise InputError(
            given="The surface is black under every light.",
            needed="An exposure needs some light.",
            remedy="Check that the albedo is above zero and that the lights stand before the surface.",
        )
    stack = MemoryStack(expose(radiance / white, bits=bits, noise=noise, seed=seed))
    capture = Capture(stack=stack, rig=rig, mask=surface.mask, radiance_at_white=white, name=name)
    return capture, Truth(normals=surface.normals, depth=surface.height, albedo=albedo, source=name)


def expose(images: FloatArray, *, bits: int | None, noise: float = 0.0, seed: int = 0) -> Array:
    """Add noise to linear images and round them as a sensor does.

    Parameters
    ----------
    images : float array (m, h, w, c)
        Linear values, 1 is full scale.
    bits : int or None
        8 or 16, or None to leave float64 values.
    noise : float
        Standard deviation as a share of full scale [1].
    seed : int
        Each image draws from a generator of its own, so that more images leave the first ones as they are.

    Returns
    -------
    array (m, h, w, c)
        uint8, uint16 or float64.

    Raises
    ------
    InputError
        If the number of bits is another.
    """
    if bits not in (8, 16, None):
        raise InputError(
            given=f"A sensor of {bits} bits is asked for.", needed="8, 16, or none for floats.", remedy="Choose one."
        )
    noisy = np.array(images, np.float64)
    if noise > 0:
        for i in range(len(noisy)):
            noisy[i] += np.random.default_rng([seed, i]).normal(0.0, noise, noisy.shape[1:])
    if bits is None:
        return noisy
    top = 2**bits - 1
    return np.asarray(np.rint(np.clip(noisy, 0.0, 1.0) * top), np.uint8 if bits == 8 else np.uint16)
