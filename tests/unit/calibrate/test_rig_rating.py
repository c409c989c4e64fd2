"""Ratings of rigs: figures against simulation and closed forms, and sentences that say what is wrong."""

import numpy as np
import pytest

from psstereo.calibrate.rig import assess_rig, rate_rig
from psstereo.calibrate.rig.figures import noise_gain, normals_at, rig_figures
from psstereo.errors import InputError, RigError, UnsupportedError
from psstereo.lights import Ambient, Led, Rig


def ring(count, slant, start=0.0):
    return normals_at(np.full(count, np.radians(slant)), np.radians(start) + np.arange(count) * (2 * np.pi / count))


def lamp(position, towards, mu=1.0, flux=1.0):
    where = np.asarray(position, float)
    return Led(position=where, axis=np.asarray(towards, float) - where, mu=mu, flux=np.array([flux]))


def test_a_ring_has_the_figures_of_its_formula():
    for count, slant in [(3, 54.7356), (12, 30.0), (8, 70.0)]:
        figures = rig_figures(Rig.distant(ring(count, slant)))
        s = np.radians(slant)
        # LᵀL / m = diag(sin² / 2, sin² / 2, cos²): a normal toward the camera errs in x and y
        assert figures.error_per_noise[0] == pytest.approx(np.sqrt(4 / count) / np.sin(s), rel=1e-9)
        values = np.sqrt([np.sin(s) ** 2 / 2, np.cos(s) ** 2])
        assert figures.condition == pytest.approx(max(values) / min(values), rel=1e-9)
        assert figures.best == pytest.approx(np.sqrt(6 / count))
        assert figures.fewest_lit[0] == count
    best = rig_figures(Rig.distant(ring(3, np.degrees(np.arctan(np.sqrt(2))))))
    assert best.error_per_noise[0] == pytest.approx(best.best)  # 0.81° at 1 %


def test_noise_does_to_normals_what_is_predicted():
    random = np.random.default_rng(7)
    directions = normals_at(np.radians(random.uniform(5, 75, 9)), random.uniform(0, 2 * np.pi, 9))
    shares = random.uniform(0.4, 1.0, 9)
    normal = normals_at(np.radians(60.0), np.array(1.0))
    lit = directions @ normal > 0
    assert 3 < lit.sum() < 9
    squares, count = noise_gain(directions, shares, normal)
    sigma, draws = 1e-4, 40_000
    design = (directions * shares[:, None])[lit]
    values = design @ normal + sigma * random.standard_normal((draws, lit.sum()))
    found = np.linalg.lstsq(design, values.T, rcond=None)[0].T
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    angles = np.arctan2(np.linalg.norm(np.cross(found, normal), axis=1), found @ normal)
    assert count == lit.sum()
    assert np.sqrt(np.mean(angles**2)) == pytest.approx(sigma * np.sqrt(squares), rel=0.02)


def test_errors_of_directions_do_what_is_predicted():
    random = np.random.default_rng(8)
    directions, errors = ring(7, 40.0), np.radians(random.uniform(0.05, 0.2, 7))
    predicted = rig_figures(Rig.distant(directions), direction_error=errors).from_directions
    angles = []
    for _ in range(3000):
        noise = random.standard_normal((7, 3)) * errors[:, None] / np.sqrt(2)
        noise -= (noise * directions).sum(axis=1, keepdims=True) * directions
        wrong = directions + noise
        b = np.linalg.lstsq(wrong, directions[:, 2], rcond=None)[0]
        angles.append(np.arctan2(np.hypot(b[0], b[1]), b[2]))
    assert np.sqrt(np.mean(np.square(angles))) == pytest.approx(predicted, rel=0.05)


def test_shadow_counts_are_those_of_attached_shadows():
    figures = rig_figures(Rig.distant(ring(4, 50.0)))
    # a normal tilted by t loses the light opposite of it beyond 40°, and two of them where it stands between lights
    at = np.degrees(figures.tilts)
    assert (figures.fewest_lit[at <= 40] >= 3).all()
    assert figures.fewest_lit[at.searchsorted(45)] == 3
    assert (figures.fewest_lit[at >= 55] == 2).all()
    assert figures.told[0] == 1
    assert figures.told[-1] < 1


def test_lamps_are_seen_from_where_the_object_is():
    there = np.array([10.0, -5.0, -300.0])
    lamps = [lamp(there + 200 * d, there) for d in ring(6, 45.0)]
    figures = rig_figures(Rig(tuple(lamps)))  # their axes meet there
    np.testing.assert_allclose(figures.directions, ring(6, 45.0), atol=1e-9)
    np.testing.assert_allclose(figures.shares, 1.0)
    nearer = rig_figures(Rig(tuple(lamps)), point=there + np.array([0, 0, 50.0]))
    assert nearer.directions[0, 2] < figures.directions[0, 2]
    board = [lamp((x, y, 0.0), (x, y, -1.0)) for x, y in [(-50, 0), (50, 0), (0, 50), (0, -50)]]
    verdict, advice = rate_rig(Rig(tuple(board)))
    assert verdict.startswith("Not rated: The lamps' axes are parallel")
    assert "point" in advice[0]
    verdict, _ = rate_rig(Rig(tuple(board)), point=(0.0, 0.0, -60.0))
    assert verdict.startswith("Good: 4 lights")
    with pytest.raises(RigError, match="does not shine"):
        assess_rig(Rig(tuple(board)), point=(0.0, 0.0, 60.0))


def test_good_rigs_get_a_verdict_and_no_advice():
    verdict, advice = rate_rig(Rig.distant(ring(12, 50.0)))
    assert verdict.startswith("Good: 12 lights, condition 1.2; noise of 1 % turns a normal toward the camera by 0.43°")
    assert "(0.41° at best)" in verdict
    assert advice == ()
    verdict, _ = rate_rig(Rig.distant(ring(12, 50.0)), direction_error=np.full(12, np.radians(0.5)))
    assert verdict.endswith("errors of the directions turn it by 0.2°.")


@pytest.mark.parametrize(
    ("directions", "words"),
    [
        (
            np.concatenate([ring(6, 50.0), normals_at(np.radians(50.0), np.radians([4.0]))]),
            "Lights 1 and 7 are 3.1° apart",
        ),
        (ring(8, 15.0), "No light below 75° above the surface's plane"),
        (ring(8, 84.0), "The lights stand low, 84° or more from the view"),
        (
            normals_at(np.radians([60, 30, 0, 30, 60.0]), np.radians([10, 10, 0, 190, 185.0])),
            "nearly in one plane: add some on the sides that they leave out, at azimuths 9",
        ),
        (normals_at(np.radians([50.0] * 5), np.radians([0, 30, 60, 90, 120.0])), "toward azimuth 2"),
        (ring(3, 50.0), "no light is to spare"),
        (np.concatenate([ring(6, 50.0), [[0.6, 0.0, -0.8]]]), "Light 7 stands at the side or behind"),
        (ring(2, 50.0), "Add lights: three or more"),
    ],
)
def test_advice_names_what_is_wrong(directions, words):
    _, advice = rate_rig(Rig.distant(directions))
    assert any(words in sentence for sentence in advice), advice


def test_many_lights_may_be_near_to_each_other():
    # A thousand lights are 5° apart wherever they stand.
    k = np.arange(1000) + 0.5
    dome = normals_at(np.arccos(1 - k / 1000), k * np.pi * (3 - np.sqrt(5)))
    assert not any("apart" in sentence for sentence in rate_rig(Rig.distant(dome))[1])


def test_weak_and_unsure_lights_are_named():
    strengths = np.ones(8)
    strengths[2] = 0.1
    errors = np.full(8, np.nan)
    errors[4] = np.radians(2.0)
    _, advice = rate_rig(Rig.distant(ring(8, 50.0), strengths), direction_error=errors)
    assert any(s.startswith("Light 3 is weak, down to 0.1") for s in advice)
    assert any("light 5 is known to ±2.0° only" in s for s in advice)


@pytest.mark.parametrize(
    "directions", [ring(2, 40.0), normals_at(np.radians([60, 20, 40.0]), np.radians([0, 0, 180.0]))]
)
def test_too_few_or_coplanar_lights_are_no_rig(directions):
    verdict, advice = rate_rig(Rig.distant(directions))
    assert verdict.startswith("Not enough for normals")
    assert advice
    figures = rig_figures(Rig.distant(directions))
    assert np.isinf(figures.condition)
    assert np.isnan(figures.error_per_noise).all()


def test_three_lights_of_which_one_is_behind():
    verdict, _ = rate_rig(Rig.distant(np.concatenate([ring(2, 40.0, 20.0), [[0.1, 0.7, -0.7]]])))
    assert verdict.startswith("Not enough for normals: of 3 lights 2 reach")


def test_what_cannot_be_is_refused():
    rig = Rig.distant(ring(3, 50.0))
    for errors in (np.ones(2), np.array([1.0, -1.0, 1.0]), np.array([1.0, np.inf, 1.0]), np.ones((3, 1))):
        with pytest.raises(InputError, match="Errors of directions"):
            rate_rig(rig, direction_error=errors)
    with pytest.raises(UnsupportedError):
        rate_rig(Rig((Ambient(radiance=np.ones(1)),) * 3))
    with pytest.raises(RigError):
        assess_rig(Rig(()))
    with pytest.raises(InputError, match="The object is at"):
        assess_rig(Rig((lamp((0, 0, 9), (0, 0, 0)),)), point=(0.0, np.nan, 0.0))
