import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo_synth import spiral
from psstereo_synth.caps import cap_capture


def test_normals_fill_the_cap_evenly():
    capture, truth = cap_capture(spiral(5), (200, 200), tilt=1.2, noise=0.0)
    z = truth.normals[..., 2].ravel()
    np.testing.assert_allclose(np.linalg.norm(truth.normals, axis=-1), 1.0, atol=1e-15)
    assert z.min() > np.cos(1.2)
    assert z.mean() == pytest.approx((1 + np.cos(1.2)) / 2, abs=0.005)  # evenly over the sphere is evenly in z
    assert abs(truth.normals[..., :2].mean()) < 0.01
    images = capture.stack.read()[..., 0]
    shade = np.maximum(np.einsum("mk,hwk->mhw", capture.rig.directions, truth.normals), 0)
    np.testing.assert_allclose(images, shade, atol=1e-12)


def test_noise_is_a_share_of_the_brightness_and_a_seed_repeats_it():
    clean, _ = cap_capture(spiral(5), (100, 100), tilt=0.3, noise=0.0, seed=4)
    noisy, _ = cap_capture(spiral(5), (100, 100), tilt=0.3, noise=0.05, seed=4)
    again, _ = cap_capture(spiral(5), (100, 100), tilt=0.3, noise=0.05, seed=4)
    assert (noisy.stack.read() - clean.stack.read()).std() == pytest.approx(0.05, rel=0.02)
    np.testing.assert_array_equal(noisy.stack.read(), again.stack.read())


@pytest.mark.parametrize(("tilt", "noise"), [(-0.1, 0), (4, 0), (np.nan, 0), (1, -1), (1, np.inf), (1, np.nan)])
def test_nonsense_is_refused(tilt, noise):
    with pytest.raises(InputError, match="tilt"):
        cap_capture(spiral(5), (3, 3), tilt=tilt, noise=noise)
