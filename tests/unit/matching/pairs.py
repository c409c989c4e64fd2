"""Pairs of random texture with known disparity."""

import numpy as np

from psstereo.matching import ViewImages


def texture(shape, seed=0, *, smooth=1.0):
    """Return values from 0.2 to 0.8, smoothed over about `smooth` pixels."""
    from scipy.ndimage import gaussian_filter

    noise = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), smooth)
    return 0.2 + 0.6 * (noise - noise.min()) / np.ptp(noise)


def shifted_pair(shape=(40, 60), disparity=5, seed=0, margin=20):
    """Return left and right images of a plane whose points move by whole pixels."""
    wide = texture((shape[0], shape[1] + 2 * margin), seed)
    left = wide[:, margin : margin + shape[1]]
    return left, wide[:, margin + disparity : margin + disparity + shape[1]]


def two_planes(shape=(40, 64), far=4, near=9, seed=1):
    """Return a pair with a square in front of a plane, its disparity, and where both views see the point."""
    back = texture((shape[0], shape[1] + 40), seed)
    front = texture(shape, seed + 1)
    left, right = back[:, 20 : 20 + shape[1]].copy(), back[:, 20 + far : 20 + far + shape[1]].copy()
    disparity = np.full(shape, float(far))
    rows, columns = slice(10, 30), slice(25, 45)
    left[rows, columns] = front[rows, columns]
    right[rows, columns.start - near : columns.stop - near] = front[rows, columns]
    disparity[rows, columns] = near
    visible = np.ones(shape, bool)
    visible[:, :far] = False
    # What lies behind the square's left edge in the right view.
    visible[rows, columns.start - (near - far) : columns.start] = False
    return left, right, disparity, visible


def views(left, right, *, noise=None):
    """Return two images as views."""
    return (
        ViewImages.from_arrays(left, noise=noise, name="left"),
        ViewImages.from_arrays(right, noise=noise, name="right"),
    )
