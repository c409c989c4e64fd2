"""The balloon in an outline, and what it is worth as a prior."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.camera import Pinhole
from psstereo.errors import InputError, UnsupportedError
from psstereo.lights import Directional
from psstereo.metrics import angular_error
from psstereo.sfs import SHADING_METHODS, ShadedImage
from psstereo.sfs.silhouette import inflated, with_silhouette


def ball(size=48, radius=20.0):
    rows, columns = np.mgrid[:size, :size] - (size - 1) / 2.0
    inside = columns**2 + rows**2 < radius**2
    height = np.sqrt(np.maximum(radius**2 - columns**2 - rows**2, 0.0))
    normals = np.stack([columns, -rows, height], axis=-1) / radius
    sun = Directional(direction=np.array([0.3, 0.2, 0.93]), strength=np.ones(1))
    image = ShadedImage(
        image=np.where(inside, np.maximum(normals @ sun.direction, 0.0), np.nan), light=sun, mask=inside
    )
    return image, np.where(inside, height, np.nan), np.where(inside[..., None], normals, np.nan)


def test_a_disc_becomes_half_a_sphere():
    image, height, _ = ball()
    square = (inflated(image.mask) ** 2 + 20.0**2 - height**2)[image.mask]  # of the sphere's radius: the outline's
    np.testing.assert_allclose(square, 20.6**2, rtol=0.05)


def test_a_strip_becomes_a_cylinder():
    strip = np.zeros((400, 30), bool)
    strip[2:-2, 5:25] = True  # 20 wide: the outline lies 10.5 from its middle
    across = inflated(strip)[200, 5:25]
    place = np.arange(20) - 9.5
    np.testing.assert_allclose(across, np.sqrt(2.0 * (10.5**2 - place**2)), rtol=1e-3)


def test_the_outline_helps_where_no_height_is_known():
    image, _, normals = ball()
    method = SHADING_METHODS["variational"]()
    plain, told = method.recover(image), method.recover(with_silhouette(image))
    without, with_it = (np.nanmean(angular_error(one.normals.normals, normals)) for one in (plain, told))
    assert with_it < 0.5 * without
    assert "silhouette" in {one.name for one in told.assumptions}


def test_what_has_no_outline_is_refused():
    image, height, _ = ball()
    with pytest.raises(InputError, match="no mask"):
        with_silhouette(replace(image, image=np.nan_to_num(image.image), mask=None))
    with pytest.raises(InputError, match="a prior"):
        with_silhouette(with_silhouette(image))
    with pytest.raises(UnsupportedError, match="pinhole"):
        with_silhouette(replace(image, camera=Pinhole(fx=60.0, fy=60.0, cx=24.0, cy=24.0)))
    assert np.isfinite(height).any()
