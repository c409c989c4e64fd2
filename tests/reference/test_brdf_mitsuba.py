"""Reflectance against Mitsuba 3, which works in single precision and includes the cosine to the light."""

import numpy as np
import pytest

from psstereo.brdf import Ggx, Lambert

Z = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def mi():
    mitsuba = pytest.importorskip("mitsuba", reason="the extra 'test' brings Mitsuba")
    mitsuba.set_variant("scalar_rgb")
    return mitsuba


def radiance(mi, bsdf, to_light, to_eye):
    """Return ρ n·l of each pair of directions as Mitsuba has it."""
    values = []
    for light, eye in zip(to_light, to_eye, strict=True):
        surface = mi.SurfaceInteraction3f()
        surface.wi = mi.Vector3f(*eye.tolist())
        values.append(np.array(bsdf.eval(mi.BSDFContext(), surface, mi.Vector3f(*light.tolist()))))
    return np.stack(values).astype(np.float64)


def directions(count, spread, seed=0):
    """Lights and eyes in single precision; half of the eyes within `spread` of the mirror direction."""
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(2, count, 3))
    vectors /= np.linalg.norm(vectors, axis=-1, keepdims=True)
    to_light, to_eye = vectors
    to_eye[::2] = to_light[::2] * [-1, -1, 1] + spread * rng.normal(size=to_eye[::2].shape)
    vectors[..., 2] = np.abs(vectors[..., 2])
    vectors /= np.linalg.norm(vectors, axis=-1, keepdims=True)
    return tuple(vectors.astype(np.float32).astype(np.float64))


def masking(vectors, roughness):
    """Smith's Λ of GGX."""
    tan_square = (1 - vectors[:, 2] ** 2) / vectors[:, 2] ** 2
    return (np.sqrt(1 + roughness**4 * tan_square) - 1) / 2


@pytest.mark.parametrize("roughness", [1.0, 0.7, 0.4, 0.2, 0.1])
def test_ggx_is_that_of_mitsuba(mi, roughness):
    """Mirrors that reflect everything; Mitsuba masks light and eye separately, which is undone by Λ."""
    bsdf = mi.load_dict(
        {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": roughness * roughness}
    )
    to_light, to_eye = directions(400, roughness**2)
    theirs = radiance(mi, bsdf, to_light, to_eye)
    light, eye = masking(to_light, roughness), masking(to_eye, roughness)
    separate = (1 + light + eye) / ((1 + light) * (1 + eye))
    rho = Ggx(albedo=0.0, f0=1.0, roughness=roughness).evaluate(Z, to_light, to_eye)[:, 0]
    np.testing.assert_allclose(theirs, np.tile((rho * separate * to_light[:, 2])[:, None], (1, 3)), rtol=3e-6)


def test_lambert_is_that_of_mitsuba(mi):
    bsdf = mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.2, 0.5, 0.9]}})
    to_light, to_eye = directions(100, 1.0)
    rho = Lambert(albedo=[0.2, 0.5, 0.9]).evaluate(Z, to_light, to_eye)
    np.testing.assert_allclose(radiance(mi, bsdf, to_light, to_eye), rho * to_light[:, 2:], rtol=1e-6)
