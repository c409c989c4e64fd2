import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.brdf import Lambert, Minnaert, directional_reflectance

Z = np.array([0.0, 0.0, 1.0])


def toward(tilt, azimuth):
    return np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])


@settings(deadline=None)
@given(st.floats(0.0, 1.57), st.floats(0.0, 1.57), st.floats(0.0, 2 * np.pi), st.floats(0.01, 2.0))
def test_is_the_formula(light, eye, azimuth, k):
    value = Minnaert(albedo=0.4, k=k).evaluate(Z, toward(light, 0.0), toward(eye, azimuth)).item()
    assert value == pytest.approx(0.4 * (k + 1) / (2 * np.pi) * (np.cos(light) * np.cos(eye)) ** (k - 1), rel=1e-12)


def test_with_k_of_one_it_is_lambert():
    scene = Z, toward(1.1, 0.0), toward(0.4, 2.0)
    np.testing.assert_allclose(
        Minnaert(albedo=[0.2, 0.9], k=1.0).evaluate(*scene), Lambert(albedo=[0.2, 0.9]).evaluate(*scene), rtol=1e-15
    )


def test_share_reflected_is_in_closed_form():
    angles = np.radians([0.0, 30.0, 60.0, 85.0, 89.9])
    k = np.array([0.1, 0.5, 0.9, 1.0, 1.5, 2.0])
    shares = directional_reflectance(Minnaert(albedo=0.8, k=k), angles)
    np.testing.assert_allclose(shares, 0.8 * np.cos(angles)[:, None] ** (k - 1), rtol=1e-6)


def test_range_of_validity():
    """Just inside it reflects less than it receives, just outside more."""
    brdf = Minnaert(albedo=[0.1, 0.5, 0.9], k=[0.3, 0.5, 0.8])
    limits = brdf.valid_to()
    assert ((limits > 0.1) & (limits < np.pi / 2)).all()
    for channel, limit in enumerate(limits):
        inside, outside = directional_reflectance(brdf, [limit - 1e-3, limit + 1e-3])[:, channel]
        assert inside < 1.0 < outside


def test_range_of_validity_at_its_ends():
    limits = Minnaert(albedo=[1.0, 1.0, 0.7, 0.0, 1e-300], k=[0.5, 1.0, 2.0, 0.5, 0.5]).valid_to()
    np.testing.assert_array_equal(limits, [0.0, np.pi / 2, np.pi / 2, np.pi / 2, np.pi / 2])
    # Nearly 1: cos = 1 − 2e-12, whose arccos has no digits to spare.
    close = Minnaert(albedo=1 - 1e-12, k=0.5).valid_to().item()
    assert close == pytest.approx(2e-6, rel=1e-4)
    assert Minnaert(albedo=np.full((2, 3, 1), 0.5), k=[0.5, 0.6]).valid_to().shape == (2, 3, 2)


def test_with_k_of_two_it_never_reflects_more_than_it_receives():
    shares = directional_reflectance(Minnaert(albedo=1.0, k=[1.0, 1.3, 2.0]), np.radians([0.0, 45.0, 89.9]))
    assert shares.max() <= 1.0 + 1e-9


def test_cosines_too_small_to_multiply():
    """1e-200 squared is no number any more; its power −0.5 + … is."""
    low = np.array([1.0, 0.0, 1e-200])
    value = Minnaert(albedo=1.0, k=0.5).evaluate(Z, low, low).item()
    assert value == pytest.approx(1.5 / (2 * np.pi) * 1e200, rel=1e-10)


def test_diffuse_albedo_is_what_is_seen_along_the_normal():
    brdf = Minnaert(albedo=[0.8, 0.1], k=[0.6, 1.7])
    np.testing.assert_allclose(np.pi * brdf.evaluate(Z, Z, Z), brdf.diffuse_albedo, rtol=1e-15)
