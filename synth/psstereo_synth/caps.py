"""Matte pixels whose normals fill a cap: for statistics over many pixels, without a surface to go with them."""

import numpy as np

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError
from psstereo.forward import lambertian_images
from psstereo.lights import Rig
from psstereo.stack import MemoryStack
from psstereo.types import FloatArray
from psstereo_synth.capture import expose

__all__ = ["cap_capture"]


def cap_capture(
    directions: FloatArray, shape: tuple[int, int], *, tilt: float, noise: float, seed: int = 0
) -> tuple[Capture, Truth]:
    """Photograph matte pixels that show 1 where they face a light, with Gaussian noise and without rounding.

    Not for depth: the normals are independent of each other, and no surface has them.

    Parameters
    ----------
    directions : float array (m, 3)
        Toward the lights [1].
    shape : (int, int)
        Rows and columns; each pixel has a normal of its own.
    tilt : float
        The normals are spread evenly over the sphere up to this angle from the view direction [rad].
    noise : float
        Standard deviation of the noise over the brightness of a pixel that faces the light [1].
    seed : int
        Of normals and noise.

    Returns
    -------
    capture : Capture
        float64 images, negative values included.
    truth : Truth
        Its normals.

    Raises
    ------
    InputError
        If the tilt is not between 0 and π, or the noise negative or not finite.
    """
    if not 0 <= tilt <= np.pi or not 0 <= noise < np.inf:
        raise InputError(
            given=f"The tilt is {tilt} and the noise {noise}.",
            needed="A tilt from 0 to π, and noise that is finite and not negative.",
            remedy="Give the tilt in radians and the noise as a share.",
        )
    rng = np.random.default_rng(seed)
    drop = 2 * np.sin(tilt / 2) ** 2 * rng.random(shape)  # 1 − z, exact for small angles
    turn, z = 2 * np.pi * rng.random(shape), 1 - drop
    radius = np.sqrt(drop * (2 - drop))
    normals = np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=-1)
    rig = Rig.distant(directions, source="synthetic suns")
    images = lambertian_images(normals, np.ones(shape), rig)
    stack = MemoryStack(expose(images, bits=None, noise=noise, seed=seed))
    return Capture(stack=stack, rig=rig, name="cap"), Truth(normals=normals, source="cap")
