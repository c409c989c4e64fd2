"""A ready-made pair for matching: hills from two cameras side by side, painted or plain, matte or glossy."""

import tempfile
from pathlib import Path

import numpy as np

from psstereo.brdf import Lambert, Phong
from psstereo.io.pictures import write_png
from psstereo.lights import Directional
from psstereo.types import FloatArray
from psstereo_synth.patterns import Constant, ImagePattern, Pattern
from psstereo_synth.rigs import spiral
from psstereo_synth.scenes import Material, Scene
from psstereo_synth.sensor import Sensor
from psstereo_synth.shapes import GaussianHills
from psstereo_synth.stereo import side_by_side

__all__ = ["CAMERA", "paint", "stereo_rig"]

CAMERA = Sensor(bits=12, full_well=10_000.0, read_noise=5.0)
"""A usual camera: 1 % of noise at full scale."""
_FOCAL = 1.9
"""Focal length in widths of the image."""
_DISTANCE, _BASELINE = 4.0, 1.2
_PARALLAX = 1 / 16
"""Half the disparity of the origin in widths of the image."""
_TEXTURE = 512
_SPECULAR, _EXPONENT = 0.2, 50.0


def stereo_rig(
    size: int,
    *,
    lights: int = 8,
    painted: bool = True,
    glossy: bool = False,
    sensor: Sensor | None = None,
    seed: int = 0,
) -> Scene:
    """Return hills under distant lights, seen by two pinholes side by side.

    Disparities go from about 0.08 to 0.25 widths of the image.

    Parameters
    ----------
    size : int
        Rows and columns of the images.
    lights : int
        Number of lights, spread over 45° about the view.
    painted : bool
        Whether there is a fine random pattern on the surface, or one albedo all over.
    glossy : bool
        Whether a Phong lobe comes on top of the diffuse part.
    sensor : Sensor, optional
        Camera; 16 bits without noise if absent.
    seed : int
        Of the hills and the pattern.

    Returns
    -------
    Scene
        With two viewpoints, the left one first.
    """
    focal = _FOCAL * size
    shift = 0.5 * focal * _BASELINE / _DISTANCE - _PARALLAX * size
    parameters = {"specular": np.array([_SPECULAR]), "exponent": np.array([_EXPONENT])} if glossy else {}
    albedo: Pattern = paint(seed) if painted else Constant(albedo=(0.6,))
    return Scene(
        name="stereo rig",
        summary="Hills from two cameras side by side.",
        surface=GaussianHills(steepness=1.5, seed=seed),
        material=Material(model=Phong if glossy else Lambert, parameters=parameters, albedo=albedo),
        viewpoints=side_by_side((size, size), focal=focal, distance=_DISTANCE, baseline=_BASELINE, shift=shift),
        size=(size, size),
        lights=tuple(
            Directional(direction=direction, strength=np.array([1000.0]))
            for direction in spiral(lights, max_tilt=np.radians(45.0))
        ),
        sensor=sensor or Sensor(bits=16),
    )


def paint(seed: int = 0) -> Pattern:
    """Return a random pattern of all scales, albedo 0.1 to 0.7."""
    with tempfile.TemporaryDirectory(prefix="psstereo-paint-") as folder:
        path = Path(folder) / "paint.png"
        write_png(path, np.rint(255 * (0.1 + 0.6 * _texture(seed))).astype(np.uint8))
        return ImagePattern(path=path, curve="linear")


def _texture(seed: int) -> FloatArray:
    """Return noise of several scales with equal contrast, 0 … 1."""
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(seed)
    total = np.zeros((_TEXTURE, _TEXTURE))
    for scale in (1, 2, 4, 8, 16):
        total += scale * gaussian_filter(rng.standard_normal(total.shape), scale, mode="wrap")
    return np.asarray((total - total.min()) / np.ptp(total))
