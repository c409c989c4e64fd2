"""The classic methods, each on the surfaces it is made for, and on where it must refuse."""

import math

import numpy as np
import pytest

from psstereo.errors import OptionError, UnsupportedError
from psstereo.lights import Directional
from psstereo.metrics import angular_error
from psstereo.sfs import ShadedImage
from psstereo.sfs.lee_kuo import LeeKuo
from psstereo.sfs.pentland import Pentland
from psstereo.sfs.tsai_shah import TsaiShah


def lit(height, azimuth, elevation, pixel=1.0):
    down, across = np.gradient(height)
    normals = np.stack([-across, down, np.ones_like(height)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    flat = math.cos(elevation)
    light = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])
    sun = Directional(direction=light, strength=np.ones(1))
    return ShadedImage(image=np.maximum(normals @ light, 0.0), light=sun), normals


def hill():
    rows, columns = np.mgrid[:40, :48].astype(float)
    return 4.0 * np.exp(-((columns - 24.0) ** 2 + (rows - 20.0) ** 2) / 60.0)


def test_pentland_inverts_shallow_waves():
    columns = np.mgrid[:16, :64][1]
    wave = 0.02 * np.sin(2.0 * np.pi * 4.0 * columns / 64.0)
    image, _ = lit(wave, 0.4, math.radians(25.0))
    found = Pentland(damping=1e-6).recover(image).depth.depth
    # Central differences, with which the image was made, see a wave of this length as sin(ω)/ω of its slope.
    omega = 2.0 * np.pi * 4.0 / 64.0
    expected = wave * math.sin(omega) / omega
    assert np.abs(found - expected)[:, 8:-8].max() < 0.03 * wave.max()


def test_pentland_refuses_light_from_the_camera():
    image, _ = lit(hill(), 0.0, math.radians(89.0))
    with pytest.raises(UnsupportedError, match="eikonal"):
        Pentland().recover(image)


def test_tsai_shah_goes_a_newton_step_from_the_flat_surface():
    image, _ = lit(hill(), math.radians(135.0), math.radians(40.0))
    found = TsaiShah(iterations=1).recover(image).depth.depth
    x, y, z = image.light.direction
    # On the flat surface brightness is z, and raising a pixel by 1 changes it by y − x.
    step = (image.image - z) / (y - x)
    np.testing.assert_allclose(found, step - step.mean(), atol=1e-6)


def test_tsai_shah_passes_heights_on_along_the_light():
    image, _ = lit(hill(), math.radians(135.0), math.radians(40.0))
    few, many = (TsaiShah(iterations=count).recover(image).depth.depth for count in (1, 50))
    assert np.ptp(many) > 3.0 * np.ptp(few)


def test_lee_kuo_explains_the_image_and_beats_a_flat_guess():
    image, normals = lit(hill(), 0.6, math.radians(60.0))
    result = LeeKuo().recover(image)
    flat = np.broadcast_to([0.0, 0.0, 1.0], normals.shape)
    error, guess = np.nanmean(angular_error(result.normals.normals, normals)), angular_error(flat, normals).mean()
    assert result.normals.facts["brightness_misfit"] < 0.02
    assert error < 0.7 * guess


@pytest.mark.parametrize(
    ("method", "options"),
    [(Pentland, {"damping": 0.0}), (TsaiShah, {"iterations": 0}), (LeeKuo, {"smoothness": -1.0})],
)
def test_options_out_of_range_are_refused(method, options):
    with pytest.raises(OptionError):
        method(**options)
