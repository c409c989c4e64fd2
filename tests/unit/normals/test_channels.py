import numpy as np
import pytest

from psstereo.flags import Flag
from psstereo.normals import PixelNormals
from psstereo.normals.channels import combine_channels


def channel(scaled, flags=0, uncertainty=0.01):
    scaled = np.atleast_2d(np.asarray(scaled, float))
    count = len(scaled)
    return PixelNormals(
        scaled, np.full(count, uncertainty), np.full(count, int(flags), np.uint16), np.full(count, 9, np.uint16)
    )


LOST = channel([np.nan] * 3, Flag.TOO_FEW_LIGHTS | Flag.UNUSABLE_SAMPLE, np.nan)


def test_one_solved_channel_is_enough():
    normals, albedo, uncertainty, flags = combine_channels([LOST, channel([0.0, 0.3, 0.4], Flag.SHADOWED), LOST])
    np.testing.assert_allclose(normals, [[0.0, 0.6, 0.8]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(albedo, [[np.nan, 0.5, np.nan]], rtol=1e-15)
    np.testing.assert_allclose(uncertainty, [0.01], rtol=1e-15)
    assert flags[0] == Flag.SHADOWED | Flag.UNUSABLE_SAMPLE  # remarks stay, the fatal bit does not


def test_no_solved_channel_keeps_the_reasons():
    other = channel([np.nan] * 3, Flag.NO_SIGNAL, np.nan)
    normals, albedo, uncertainty, flags = combine_channels([LOST, other, LOST])
    assert np.isnan(normals).all()
    assert np.isnan(albedo).all()
    assert np.isnan(uncertainty).all()
    assert flags[0] == Flag.NO_SIGNAL | Flag.TOO_FEW_LIGHTS | Flag.UNUSABLE_SAMPLE
    same = combine_channels([LOST, channel([np.nan] * 3, Flag.TOO_FEW_LIGHTS | Flag.NO_SIGNAL, np.nan)])[3]
    assert same[0] == Flag.TOO_FEW_LIGHTS | Flag.UNUSABLE_SAMPLE  # what all channels share


def test_angles_add_as_independent_errors_do():
    """n moves by Σ ρ² δ / Σ ρ²; equal channels divide the angle by √3."""
    same = [channel([0.0, 0.0, 0.5])] * 3
    np.testing.assert_allclose(combine_channels(same)[2], 0.01 / np.sqrt(3), rtol=1e-14)
    two = [channel([0.0, 0.0, 0.5], uncertainty=0.01), channel([0.0, 0.0, 1.0], uncertainty=0.02)]
    expected = np.hypot(0.25 * 0.01, 1.0 * 0.02) / 1.25
    np.testing.assert_allclose(combine_channels(two)[2], expected, rtol=1e-14)
    unknown = [channel([0.0, 0.0, 0.5], uncertainty=np.nan), channel([0.0, 0.0, 1.0])]
    assert np.isnan(combine_channels(unknown)[2]).all()


@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e30])
def test_scale_does_not_matter(scale):
    b = np.random.default_rng(0).uniform(0.1, 1, (3, 50, 3))
    first = combine_channels([channel(c) for c in b])
    second = combine_channels([channel(c * scale) for c in b])
    np.testing.assert_allclose(second[0], first[0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(second[1], first[1] * scale, rtol=1e-14)


def test_channels_that_cancel_are_no_answer():
    normals, _, _, flags = combine_channels([channel([0, 0, 0.5]), channel([0, 0, -0.5])])
    assert np.isfinite(normals).all() or flags[0] & Flag.NOT_FINITE
