"""What every fault promises; a new one is tested by being listed in the catalogue."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields

import numpy as np
import pytest

from psstereo.errors import OptionError
from psstereo.lights import Led, Rig, StrengthUnit
from psstereo_synth import spiral
from psstereo_synth.faults import (
    FAULTS,
    AmbientLeak,
    Blur,
    DeadPixels,
    Draws,
    Duplicate,
    Fault,
    Flicker,
    LightError,
    Motion,
    WrongOrder,
    apply_order,
    apply_radiance,
    apply_rig,
    apply_values,
)
from psstereo_synth.sensor import Sensor

# One way to make each, and the step at which it strikes.
MAKERS = {
    "motion": (Motion(rms=0.7), "radiance"),
    "wrong-order": (WrongOrder(kind="shuffle"), "rig"),
    "light-error": (LightError(direction=0.02, strength=0.1), "rig"),
    "duplicate": (Duplicate(), "order"),
    "dead-pixels": (DeadPixels(dead=0.02, hot=0.03), "values"),
    "ambient-leak": (AmbientLeak(level=(0.1, 0.2, 0.3)), "radiance"),
    "blur": (Blur(sigma=1.2), "radiance"),
    "flicker": (Flicker(rms=0.1), "radiance"),
}
DRAWN = {"motion", "wrong-order", "light-error", "duplicate", "dead-pixels", "flicker"}

NOTHING = [
    Motion(rms=0.0),
    Motion(rms=0.0, kind="walk"),
    LightError(),
    DeadPixels(dead=0.0, hot=0.0),
    AmbientLeak(level=0.0),
    Blur(sigma=0.0),
    Flicker(rms=0.0),
]

COUNT = 9
RIG = Rig.distant(spiral(COUNT), np.linspace(1, 2, COUNT), strength_unit=StrengthUnit.IRRADIANCE, source="a test")
IMAGE = np.random.default_rng(0).uniform(0.1, 1.0, (21, 17, 3))
VALUES = (IMAGE * 4095).astype(np.uint16)
IMAGE.flags.writeable = VALUES.flags.writeable = False


@pytest.fixture(params=sorted(FAULTS))
def fault(request):
    assert request.param in MAKERS, "say how to make one"
    return MAKERS[request.param][0]


def lights_of(rig):
    return np.column_stack([rig.directions, rig.strengths(1)])


def everything(fault, draws):
    """Return all that a fault does to a capture."""
    return {
        "rig": lights_of(fault.rig(RIG, draws)),
        "order": np.array(fault.order(range(COUNT), draws)),
        "radiance": np.stack([fault.radiance(IMAGE, i, draws) for i in range(COUNT)]),
        "values": np.stack([fault.values(VALUES, i, 4095.0, draws) for i in range(COUNT)]),
    }


def test_every_fault_is_in_the_catalogue():
    assert set(Fault.__subclasses__()) == set(FAULTS.values())
    for name, kind in FAULTS.items():
        assert kind.name == name


def test_a_summary_is_a_sentence(fault):
    assert fault.summary[0].isupper()
    assert fault.summary.endswith(".")
    assert len(fault.summary.split()) >= 5
    assert len(fault.summary) <= 100


def test_it_strikes_at_its_step_and_leaves_the_others_alone(fault):
    draws = Draws(3, 1)
    step = MAKERS[fault.name][1]
    done = everything(fault, draws)
    plain = everything(Fault(), draws)
    for what, result in done.items():
        assert np.array_equal(result, plain[what]) == (what != step), what
    order = list(range(COUNT))
    assert step == "rig" or fault.rig(RIG, draws) is RIG
    assert step == "order" or fault.order(order, draws) is order
    assert step == "radiance" or fault.radiance(IMAGE, 1, draws) is IMAGE
    assert step == "values" or fault.values(VALUES, 1, 4095.0, draws) is VALUES


@pytest.mark.parametrize("fault", NOTHING, ids=lambda f: f.name)
def test_a_fault_of_no_size_returns_what_it_is_given(fault):
    draws = Draws(0)
    assert fault.rig(RIG, draws) is RIG
    assert fault.radiance(IMAGE, 4, draws) is IMAGE
    assert fault.values(VALUES, 4, 4095.0, draws) is VALUES


def test_results_keep_shape_and_meaning(fault):
    draws = Draws(1)
    rig = fault.rig(RIG, draws)
    assert (len(rig), rig.strength_unit, rig.source) == (COUNT, StrengthUnit.IRRADIANCE, "a test")
    order = fault.order(tuple(range(COUNT)), draws)
    assert len(order) == COUNT
    assert set(order) <= set(range(COUNT))
    radiance = fault.radiance(IMAGE, 3, draws)
    assert radiance.shape == IMAGE.shape
    assert radiance.dtype == np.float64
    assert (radiance >= 0).all()
    for image, white in ((VALUES, 4095.0), ((IMAGE * 255).astype(np.uint8), 255.0), (IMAGE, 1.0)):
        values = fault.values(image, 3, white, draws)
        assert values.shape == image.shape
        assert values.dtype == image.dtype
        assert values.max() <= white


def test_the_seed_decides_in_any_order_and_on_any_thread(fault):
    draws = Draws(5, 2)
    done = everything(fault, draws)
    again = everything(fault, Draws(5, 2))
    for what in done:
        np.testing.assert_array_equal(again[what], done[what])
    backwards = {i: fault.radiance(IMAGE, i, draws) for i in reversed(range(COUNT))}
    with ThreadPoolExecutor(4) as pool:
        threaded = list(pool.map(lambda i: fault.values(fault.radiance(IMAGE, i, draws), i, 1.0, draws), range(COUNT)))
    for i in range(COUNT):
        assert backwards[i].tobytes() == done["radiance"][i].tobytes()
        assert threaded[i].tobytes() == fault.values(done["radiance"][i], i, 1.0, draws).tobytes()


def test_another_seed_and_another_place_differ(fault):
    step = MAKERS[fault.name][1]
    first, seed, place = (everything(fault, d)[step] for d in (Draws(5, 2), Draws(6, 2), Draws(5, 3)))
    drawn = fault.name in DRAWN
    assert np.array_equal(first, seed) != drawn
    assert np.array_equal(first, place) != drawn


def test_nothing_given_is_changed(fault):
    image, values, order = IMAGE.copy(), VALUES.copy(), list(range(COUNT))
    before = lights_of(RIG).copy()
    fault.radiance(image, 2, Draws(0))
    fault.values(values, 2, 4095.0, Draws(0))
    fault.order(order, Draws(0))
    fault.rig(RIG, Draws(0))
    np.testing.assert_array_equal(image, IMAGE)
    np.testing.assert_array_equal(values, VALUES)
    np.testing.assert_array_equal(lights_of(RIG), before)
    assert order == list(range(COUNT))
    fault.values(VALUES, 0, 4095.0, Draws(0))  # read-only arrays are fine


def test_faults_are_values(fault):
    again = pickle.loads(pickle.dumps(fault))
    assert again == fault
    assert hash(again) == hash(fault)
    with pytest.raises(AttributeError):
        fault.extra = 1


# Sizes of each fault; those without have indices, which their own tests spoil.
SIZES = {name: [f.name for f in fields(MAKERS[name][0]) if "float" in str(f.type)] for name in MAKERS}


def test_the_sizes_are_found():
    assert SIZES["light-error"] == ["direction", "position", "strength"]
    assert sorted(name for name, sizes in SIZES.items() if not sizes) == ["duplicate", "wrong-order"]


@pytest.mark.parametrize("bad", [-0.1, np.nan, np.inf])
@pytest.mark.parametrize(("name", "size"), [(name, size) for name, sizes in SIZES.items() for size in sizes])
def test_sizes_that_cannot_be_are_refused(name, size, bad):
    with pytest.raises(OptionError) as caught:
        FAULTS[name](**{size: bad})
    assert caught.value.given
    assert caught.value.remedy


def test_bad_seeds_are_refused():
    with pytest.raises(OptionError, match="seeded"):
        apply_radiance((Flicker(),), IMAGE, 0, -1)


class TestSeveral:
    """Faults at once, as a renderer meets them."""

    FAULTS = (
        Motion(rms=0.4, kind="walk"),
        Flicker(rms=0.05),
        AmbientLeak(level=0.02),
        Flicker(rms=0.05),
        DeadPixels(dead=0.01, hot=0.01),
        Duplicate(image=6, of=2),
        LightError(direction=0.01),
        WrongOrder(kind="cycle"),
    )

    def capture(self, seed=0, over=map):
        sensor = Sensor(bits=12, white=1.2, full_well=4000.0, read_noise=5.0, seed=seed)
        order = apply_order(self.FAULTS, COUNT, seed)

        def image(k):
            radiance = apply_radiance(self.FAULTS, IMAGE * (0.5 + 0.05 * k), k, seed)
            return apply_values(self.FAULTS, sensor.expose(radiance, k), k, sensor.white_value, seed)

        return order, np.stack(list(over(image, order))), apply_rig(self.FAULTS, RIG, seed)

    def test_a_duplicate_has_the_same_noise(self):
        order, images, _ = self.capture()
        assert order == (0, 1, 2, 3, 4, 5, 2, 7, 8)
        np.testing.assert_array_equal(images[6], images[2])
        for i in (0, 1, 3, 4, 5, 7, 8):
            assert (images[i] != images[2]).mean() > 0.9

    def test_threads_do_not_matter(self):
        _, images, _ = self.capture()
        for threads in (1, 4):
            with ThreadPoolExecutor(threads) as pool:
                assert self.capture(over=pool.map)[1].tobytes() == images.tobytes()
        assert self.capture(seed=1)[1].tobytes() != images.tobytes()

    def test_the_same_kind_twice_draws_twice(self):
        first, second = (Flicker(rms=0.05).factors(500, Draws(0, place)) for place in (1, 3))
        assert abs(np.corrcoef(first, second)[0, 1]) < 0.15
        both = apply_radiance((Fault(), self.FAULTS[1], Fault(), self.FAULTS[3]), IMAGE, 4, 0)
        np.testing.assert_allclose(both, IMAGE * first[4] * second[4], rtol=1e-14)

    def test_the_rig_gets_its_errors_and_then_its_order(self):
        _, _, rig = self.capture()
        alone = LightError(direction=0.01).rig(RIG, Draws(0, 6))
        np.testing.assert_array_equal(rig.directions, np.roll(alone.directions, 1, axis=0))

    def test_no_faults_do_nothing(self):
        assert apply_rig((), RIG, 0) is RIG
        assert apply_order((), 3, 0) == (0, 1, 2)
        assert apply_radiance((), IMAGE, 0, 0) is IMAGE
        assert apply_values((), VALUES, 0, 4095.0, 0) is VALUES


def test_lamps_can_go_wrong_too():
    lamps = tuple(
        Led(position=np.array([i, 0, 5.0]), axis=np.array([0, 0, -1.0]), mu=1.0, flux=1.0 + i) for i in range(4)
    )
    rig = apply_rig((LightError(position=0.01, strength=0.1), WrongOrder(rows=(0, 3))), Rig(lamps), 2)
    assert [round(float(light.position[0])) for light in rig.lights] == [3, 1, 2, 0]
