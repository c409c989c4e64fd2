"""What every reflectance model promises; a new one is tested by being listed in the catalogue."""

import pickle
from functools import cache

import numpy as np
import pytest

from psstereo.brdf import (
    BRDFS,
    BlinnPhong,
    Ggx,
    Lambert,
    LunarLambert,
    Merl,
    Minnaert,
    OrenNayar,
    Phong,
    directional_reflectance,
    reciprocity_gap,
    tabulate,
)
from psstereo.errors import InputError

RED = [0.9, 0.4, 0.1]
Z = np.array([0.0, 0.0, 1.0])


@cache
def table():
    return tabulate(OrenNayar(albedo=RED, roughness=0.4)).table


# A few of each model, the extremes of what it accepts among them.
MAKERS = {
    "lambert": [lambda: Lambert(albedo=1.0), lambda: Lambert(albedo=0.0), lambda: Lambert(albedo=RED)],
    "oren-nayar": [
        lambda: OrenNayar(albedo=[1.0, 0.4, 0.1], roughness=0.2),
        lambda: OrenNayar(albedo=1.0, roughness=0.0),
        lambda: OrenNayar(albedo=1.0, roughness=np.pi / 2),
    ],
    "phong": [
        lambda: Phong(diffuse=0.0, specular=1.0, exponent=[0.0, 0.5, 7.0]),
        lambda: Phong(diffuse=RED, specular=0.1, exponent=1e4),
        lambda: Phong(diffuse=0.0, specular=1.0, exponent=1e12),
    ],
    "blinn-phong": [
        lambda: BlinnPhong(diffuse=0.0, specular=1.0, exponent=[0.0, 0.5, 7.0]),
        lambda: BlinnPhong(diffuse=RED, specular=0.1, exponent=1e4),
        lambda: BlinnPhong(diffuse=0.0, specular=1.0, exponent=1e12),
    ],
    "ggx": [
        lambda: Ggx(albedo=1.0, f0=[0.0, 0.04, 1.0], roughness=1.0),
        lambda: Ggx(albedo=1.0, f0=[0.0, 0.04, 1.0], roughness=[0.3, 0.1, 0.03]),
        lambda: Ggx(albedo=RED, f0=0.04, roughness=1e-3),
    ],
    "minnaert": [
        lambda: Minnaert(albedo=RED, k=0.5),
        lambda: Minnaert(albedo=1.0, k=[1e-6, 1.0, 2.0]),
    ],
    "lunar-lambert": [
        lambda: LunarLambert(albedo=RED),
        lambda: LunarLambert(albedo=1.0, weight=[0.0, 0.5, 1.0]),
    ],
    "merl": [lambda: Merl(table=table()), lambda: Merl(table=table(), lookup="linear")],
}

# One of three channels in which maps (..., c) replace what is the same everywhere.
MAPS = {
    "lambert": lambda a, b: Lambert(albedo=a),
    "oren-nayar": lambda a, b: OrenNayar(albedo=a, roughness=b),
    "phong": lambda a, b: Phong(diffuse=0.5 * a, specular=0.5, exponent=100 * b),
    "blinn-phong": lambda a, b: BlinnPhong(diffuse=0.5, specular=0.5 * a, exponent=100 * b),
    "ggx": lambda a, b: Ggx(albedo=a, f0=0.3, roughness=b),
    "minnaert": lambda a, b: Minnaert(albedo=a, k=b),
    "lunar-lambert": lambda a, b: LunarLambert(albedo=a, weight=b),
}

BAD = {
    "lambert": [{"albedo": -0.1}, {"albedo": 1.1}, {"albedo": np.nan}, {"albedo": []}, {"albedo": [0.5, np.nan]}],
    "oren-nayar": [
        {"albedo": 1.01, "roughness": 0.1},
        {"albedo": 0.5, "roughness": -0.1},
        {"albedo": 0.5, "roughness": np.nan},
        {"albedo": 0.5, "roughness": 20.0},
        {"albedo": [0.5, 0.5], "roughness": [0.1, 0.2, 0.3]},
        {"albedo": np.full((4, 5, 3), 0.5), "roughness": np.full((5, 4, 1), 0.5)},
    ],
    "phong": [
        {"diffuse": 0.6, "specular": 0.5, "exponent": 10},
        {"diffuse": [0.1, 0.6], "specular": 0.5, "exponent": 10},
        {"diffuse": 0.5, "specular": -0.1, "exponent": 10},
        {"diffuse": 0.5, "specular": 0.5, "exponent": -1},
        {"diffuse": 0.5, "specular": 0.5, "exponent": np.inf},
        {"diffuse": 0.5, "specular": 0.5, "exponent": np.nan},
        {"diffuse": [0.5, 0.4], "specular": [0.1, 0.2, 0.3], "exponent": 5},
    ],
    "ggx": [
        {"albedo": -0.5, "f0": 0.04, "roughness": 0.5},
        {"albedo": 0.5, "f0": 1.04, "roughness": 0.5},
        {"albedo": 0.5, "f0": np.nan, "roughness": 0.5},
        {"albedo": 0.5, "f0": 0.04, "roughness": 0.0},
        {"albedo": 0.5, "f0": 0.04, "roughness": -0.5},
        {"albedo": 0.5, "f0": 0.04, "roughness": 1.5},
        {"albedo": 0.5, "f0": 0.04, "roughness": np.nan},
        {"albedo": [0.5, 0.4], "f0": [0.1, 0.2, 0.3], "roughness": 0.5},
    ],
    "minnaert": [
        {"albedo": 2.0, "k": 1.0},
        {"albedo": 0.5, "k": 0.0},
        {"albedo": 0.5, "k": -1.0},
        {"albedo": 0.5, "k": 2.1},
        {"albedo": 0.5, "k": np.nan},
    ],
    "lunar-lambert": [
        {"albedo": 2.0},
        {"albedo": 0.5, "weight": -0.1},
        {"albedo": 0.5, "weight": 1.1},
        {"albedo": 0.5, "weight": np.nan},
        {"albedo": [0.5, 0.4], "weight": [0.1, 0.2, 0.3]},
    ],
    "merl": [
        {"table": np.ones((90, 90, 180))},
        {"table": np.ones((90, 90, 90, 3))},
        {"table": np.ones((90, 90, 180, 0))},
        {"table": np.full((90, 90, 180, 1), np.nan)},
        {"table": np.full((90, 90, 180, 1), -1.0)},
        {"table": np.full((90, 90, 180, 1), np.inf)},
    ],
}
BAD["blinn-phong"] = BAD["phong"]


def test_every_model_is_here():
    assert set(MAKERS) == set(BAD) == set(BRDFS) == set(MAPS) | {"merl"}


@pytest.fixture(params=[(name, i) for name in MAKERS for i in range(len(MAKERS[name]))], ids=str)
def brdf(request):
    name, index = request.param
    return MAKERS[name][index]()


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def directions(count=2000, seed=1):
    """Normals, and lights and eyes above them; a fifth of the half vectors near the normal."""
    rng = np.random.default_rng(seed)
    normals, to_light, to_eye = unit(rng.normal(size=(3, count, 3)))
    to_light[::5] = unit(normals[::5] + 0.5 * to_light[::5])
    mirrored = 2 * (to_light * normals).sum(axis=-1, keepdims=True) * normals - to_light
    to_eye[::5] = unit(mirrored[::5] + 0.1 * to_eye[::5])
    to_light, to_eye = (np.sign((v * normals).sum(axis=-1, keepdims=True)) * v for v in (to_light, to_eye))
    return normals, to_light, to_eye


def test_name_and_channels(brdf):
    assert BRDFS[brdf.name] is type(brdf)
    value = brdf.evaluate(*directions(7))
    assert value.shape == (7, brdf.channels)
    assert value.dtype == np.float64


def test_reflects_something_and_nothing_negative(brdf):
    value = brdf.evaluate(*directions())
    assert np.nanmin(value) >= 0.0
    known = np.isfinite(value).mean()
    assert known == 1.0 if brdf.name != "merl" else known > 0.95
    black = brdf.name == "lambert" and brdf.albedo.max() == 0.0
    assert (brdf.evaluate(Z, Z, Z) > 0.0).all() or black


def test_reciprocal(brdf):
    assert brdf.reciprocal
    assert reciprocity_gap(brdf) <= 1e-12
    normals, to_light, to_eye = directions()
    there, back = brdf.evaluate(normals, to_light, to_eye), brdf.evaluate(normals, to_eye, to_light)
    np.testing.assert_allclose(there, back, rtol=1e-12, atol=0.0)


INCIDENCES = np.radians([0.0, 0.01, 20.0, 45.0, 60.0, 75.0, 85.0, 88.0, 89.0, 89.5, 89.9])


CONSERVING = [(name, i) for name in MAKERS if BRDFS[name].conserving for i in range(len(MAKERS[name]))]


@pytest.mark.parametrize(("name", "index"), CONSERVING)
def test_reflects_no_more_than_it_receives(name, index):
    brdf = MAKERS[name][index]()
    # At 128 points the quadrature of lobes of radius 1e-6 is off by 7e-6, of others by less.
    reflected = directional_reflectance(brdf, INCIDENCES, count=128)
    assert reflected.shape == (len(INCIDENCES), brdf.channels)
    assert reflected.max() <= 1.0 + 1e-5


@pytest.mark.parametrize("name", [name for name in MAKERS if not BRDFS[name].conserving and name != "merl"])
def test_what_does_not_claim_to_conserve_energy_does_not(name):
    shares = [directional_reflectance(make(), INCIDENCES[[0, -1]], count=64).max() for make in MAKERS[name]]
    assert max(shares) > 1.0


def test_nothing_from_under_the_surface(brdf):
    normals, to_light, to_eye = directions(200)
    for light, eye in ((-to_light, to_eye), (to_light, -to_eye), (-to_light, -to_eye)):
        assert (brdf.evaluate(normals, light, eye) == 0.0).all()
    along = np.array([1.0, 0.0, 0.0])
    assert (brdf.evaluate(Z, along, Z) == 0.0).all()
    assert (brdf.evaluate(Z, Z, along) == 0.0).all()
    assert (brdf.evaluate(Z, along, -along) == 0.0).all()


def test_what_is_not_known_stays_so(brdf):
    vectors = np.stack([Z, unit(np.array([0.1, 0.2, 1.0])), unit(np.array([-0.3, 0.2, 1.0]))])
    for which in range(3):
        for component in range(3):
            broken = vectors.copy()
            broken[which, component] = np.nan
            assert np.isnan(brdf.evaluate(*broken)).all()
    # One of many leaves the others alone.
    normals, to_light, to_eye = directions(50)
    whole = brdf.evaluate(normals, to_light, to_eye)
    normals[7] = np.nan
    value = brdf.evaluate(normals, to_light, to_eye)
    assert np.isnan(value[7]).all()
    np.testing.assert_array_equal(np.delete(value, 7, axis=0), np.delete(whole, 7, axis=0))


def test_vectors_of_any_shape(brdf):
    normals, to_light, to_eye = (v.reshape(4, 5, 3) for v in directions(20))
    whole = brdf.evaluate(normals, to_light, to_eye)
    assert whole.shape == (4, 5, brdf.channels)
    np.testing.assert_allclose(brdf.evaluate(normals[1], to_light[1], to_eye[1]), whole[1], rtol=1e-12)
    one = brdf.evaluate(normals[1, 2], to_light[1, 2], to_eye[1, 2])
    assert one.shape == (brdf.channels,)
    np.testing.assert_allclose(one, whole[1, 2], rtol=1e-12)
    spread = brdf.evaluate(normals[0, 0], to_light[:, :1], unit(np.array([0.1, 0.1, 1.0]) + normals[:1, 0]))
    assert spread.shape == (4, 1, brdf.channels)
    np.testing.assert_array_equal(brdf.evaluate(normals, to_light, normals[0, 0]).shape, whole.shape)


def test_turning_everything_changes_nothing(brdf):
    rng = np.random.default_rng(3)
    normals, to_light, to_eye = directions()
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    value = brdf.evaluate(normals, to_light, to_eye)
    turned = brdf.evaluate(normals @ turn.T, to_light @ turn.T, to_eye @ turn.T)
    # Rounding of the vectors themselves moves half vectors by 1e-16 or so; near grazing incidence more in proportion.
    exponent = max(1.0, float(np.max(getattr(brdf, "exponent", 1.0))))
    tolerance = 1e-12 * np.sqrt(exponent)
    scale = np.nanmax(value)
    safe = ((normals * to_light).sum(axis=-1) > 0.01) & ((normals * to_eye).sum(axis=-1) > 0.01)
    assert np.count_nonzero(safe) > 1800
    np.testing.assert_allclose(turned[safe], value[safe], rtol=tolerance, atol=1e-16 * scale)


def test_diffuse_albedo_has_the_shape_of_the_surface(brdf):
    albedo = brdf.diffuse_albedo
    assert albedo.shape == (brdf.channels,)
    if brdf.name == "merl":
        assert np.isnan(albedo).all()
    else:
        assert ((albedo >= 0.0) & (albedo <= 1.5)).all()


def test_pickles_and_cannot_be_changed(brdf):
    again = pickle.loads(pickle.dumps(brdf))
    scene = directions(30)
    np.testing.assert_array_equal(again.evaluate(*scene), brdf.evaluate(*scene))
    arrays = [value for value in vars(brdf).values() if isinstance(value, np.ndarray)]
    assert arrays
    for value in arrays:
        with pytest.raises(ValueError, match="read-only"):
            value[...] = 0
    with pytest.raises(AttributeError):
        brdf.surprise = 1


@pytest.mark.parametrize("name", sorted(MAPS))
def test_maps_vary_over_the_surface(name):
    rng = np.random.default_rng(5)
    a, b = rng.uniform(0.1, 0.9, (4, 5, 3)), rng.uniform(0.1, 0.9, (4, 5, 1))
    brdf = MAPS[name](a, b)
    normals, to_light, to_eye = (v.reshape(4, 5, 3) for v in directions(20))
    whole = brdf.evaluate(normals, to_light, to_eye)
    assert whole.shape == (4, 5, 3)
    assert brdf.channels == 3
    assert brdf.diffuse_albedo.shape == (4, 5, 3)
    for i, j in ((0, 0), (2, 3), (3, 4)):
        alone = MAPS[name](a[i, j], b[i, j])
        value = alone.evaluate(normals[i, j], to_light[i, j], to_eye[i, j])
        np.testing.assert_allclose(whole[i, j], value, rtol=1e-12)
        np.testing.assert_allclose(brdf.diffuse_albedo[i, j], alone.diffuse_albedo, rtol=1e-15)
    mask = rng.uniform(size=(4, 5)) > 0.4
    part = brdf.at(mask)
    assert part.diffuse_albedo.shape == (np.count_nonzero(mask), 3)
    np.testing.assert_array_equal(part.evaluate(normals[mask], to_light[mask], to_eye[mask]), whole[mask])
    rows = part.at(slice(2, 5))
    np.testing.assert_array_equal(
        rows.evaluate(normals[mask][2:5], to_light[mask][2:5], to_eye[mask][2:5]), whole[mask][2:5]
    )
    with pytest.raises(InputError, match="varies over the surface"):
        directional_reflectance(brdf, 0.3)


@pytest.mark.parametrize("name", sorted(MAPS))
def test_the_caller_keeps_its_arrays(name):
    a, b = np.full((2, 2, 1), 0.5), np.full((2, 2, 1), 0.5)
    brdf = MAPS[name](a, b)
    before = brdf.evaluate(Z, Z, Z)
    a[...], b[...] = 0.9, 0.9  # still writeable
    np.testing.assert_array_equal(brdf.evaluate(Z, Z, Z), before)


def test_what_is_the_same_everywhere_stays_so(brdf):
    assert brdf.at(np.zeros((4, 5), bool)) is brdf


@pytest.mark.parametrize(("name", "index"), [(name, i) for name in BAD for i in range(len(BAD[name]))])
def test_parameters_that_mean_nothing_are_refused(name, index):
    with pytest.raises(InputError) as caught:
        BRDFS[name](**BAD[name][index])
    assert caught.value.given
    assert caught.value.needed
    assert caught.value.remedy
