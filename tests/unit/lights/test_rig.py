import pickle

import numpy as np
import pytest

from psstereo.errors import RigError, UnsupportedError
from psstereo.lights import Directional, Led, Rig, StrengthUnit
from psstereo_synth import ring, spiral


def test_directions_are_normalised_in_order():
    raw = spiral(5) * [[3.0], [1e-200], [1e200], [0.5], [7.0]]
    np.testing.assert_allclose(Rig.distant(raw).directions, spiral(5), rtol=0, atol=4e-16)


def test_the_light_matrix_is_kept_and_cannot_be_changed():
    rig = Rig.distant(ring(4))
    with pytest.raises(ValueError, match="read-only"):
        rig.directions[0, 0] = 5.0


@pytest.mark.parametrize("row", [[0, 0, 0], [np.nan, 0, 1], [0, np.inf, 1], [0, 0, -np.inf]])
def test_a_bad_direction_is_named_by_its_row(row):
    directions = ring(5)
    directions[3] = row
    with pytest.raises(RigError, match=r"^Light 4: The light direction"):
        Rig.distant(directions)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("shape", [(5,), (5, 3)])
def test_a_bad_strength_is_named_by_its_row(bad, shape):
    strengths = np.ones(shape)
    strengths[2, ...] = bad
    with pytest.raises(RigError, match=r"^Light 3: The light strength"):
        Rig.distant(ring(5), strengths)


@pytest.mark.parametrize(
    ("directions", "strengths"),
    [
        (np.ones(3), None),
        (np.ones((4, 2)), None),
        (np.ones((4, 3, 1)), None),
        (np.ones((4, 3)), np.ones(3)),
        (np.ones((4, 3)), np.ones((3, 4))),
        (np.ones((4, 3)), np.ones((4, 1, 1))),
    ],
)
def test_shapes_that_disagree_are_refused(directions, strengths):
    with pytest.raises(RigError):
        Rig.distant(directions, strengths)


def test_one_strength_serves_all_channels():
    assert Rig.distant(ring(4)).strengths(3).tolist() == [[1.0] * 3] * 4
    assert Rig.distant(ring(4), [1, 2, 3, 4]).strengths(2).tolist() == [[1, 1], [2, 2], [3, 3], [4, 4]]
    coloured = np.arange(1.0, 13.0).reshape(4, 3)
    np.testing.assert_array_equal(Rig.distant(ring(4), coloured).strengths(3), coloured)


@pytest.mark.parametrize("channels", [1, 2, 4])
def test_strengths_for_other_channels_are_refused(channels):
    with pytest.raises(RigError, match=f"Light 1 has strengths for 3 channels; the images, {channels}"):
        Rig.distant(ring(4), np.ones((4, 3))).strengths(channels)


def test_condition_is_that_of_the_matrix():
    for directions in (spiral(7), ring(3, tilt=0.1), spiral(20, max_tilt=1e-4)):
        # atol: the small singular value of a narrow cone is known to κ ε
        expected = np.linalg.cond(directions)
        assert Rig.distant(directions).condition() == pytest.approx(expected, rel=1e-15 * expected + 1e-14)
    tilt = 0.3  # closed form of a ring: √(2 cos² / sin²) or its inverse
    assert Rig.distant(ring(6, tilt=tilt)).condition() == pytest.approx(np.sqrt(2) / np.tan(tilt), rel=1e-13)
    assert Rig.distant(ring(2)).condition() == np.inf
    assert Rig.distant(np.zeros((0, 3))).condition() == np.inf
    assert Rig.distant(np.eye(3)[[0, 1, 0]]).condition() == np.inf


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_lights(count):
    with pytest.raises(RigError, match=f"{count} light"):
        Rig.distant(spiral(5)[:count]).require_spanning()


def test_coplanar_and_nearly_coplanar():
    flat = spiral(6) * [1.0, 1.0, 0.0]
    with pytest.raises(RigError, match="one plane"):
        Rig.distant(flat).require_spanning()
    turned = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    with pytest.raises(RigError, match="one plane"):
        Rig.distant(flat @ turned).require_spanning()  # up to rounding
    Rig.distant(flat + np.array([0.0, 0.0, 1e-7])).require_spanning()


def test_select_by_indices_and_by_mask():
    rig = Rig.distant(spiral(5), [1, 2, 3, 4, 5], strength_unit=StrengthUnit.IRRADIANCE, source="file")
    for choice, expected in [
        ([4, 0, 0], [4, 0, 0]),
        (np.array([1, -1]), [1, 4]),
        ([True, False, False, True, False], [0, 3]),
        (np.array([False, True, True, False, False]), [1, 2]),
    ]:
        part = rig.select(choice)
        np.testing.assert_array_equal(part.directions, rig.directions[expected])
        np.testing.assert_array_equal(part.strengths(1)[:, 0], np.array(expected) + 1)
        assert part.strength_unit is StrengthUnit.IRRADIANCE
        assert part.source == "file"


@pytest.mark.parametrize("choice", [[5], [True, False]])
def test_select_refuses_what_is_not_there(choice):
    with pytest.raises(IndexError):
        Rig.distant(spiral(5)).select(choice)


def test_near_lights_have_no_matrix():
    lamp = Led(position=(0, 0, 9), axis=(0, 0, -1), mu=1.0, flux=1.0)
    rig = Rig((*Rig.distant(ring(3)).lights, lamp))
    assert not rig.all_distant
    assert rig.select([0, 1, 2]).all_distant
    for ask in (lambda: rig.directions, lambda: rig.strengths(1), rig.condition):
        with pytest.raises(UnsupportedError, match=r"Light 4 \(led\) is not a distant light"):
            ask()
    with pytest.raises(UnsupportedError, match="…"):
        _ = Rig((lamp,) * 9).directions


def test_a_rig_pickles():
    rig = Rig.distant(ring(4), [1, 2, 3, 4])
    again = pickle.loads(pickle.dumps(rig))
    np.testing.assert_array_equal(again.directions, rig.directions)
    assert len(again) == len(rig) == 4
    assert isinstance(again.lights[0], Directional)
