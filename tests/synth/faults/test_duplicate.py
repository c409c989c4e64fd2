"""Images saved twice."""

import pytest

from psstereo.errors import InputError, OptionError
from psstereo_synth.faults import Draws, Duplicate


def test_named_images():
    assert Duplicate(image=1, of=3).order(range(5), Draws(0)) == (0, 3, 2, 3, 4)
    assert Duplicate(image=1, of=3).order((4, 3, 2, 1, 0), Draws(7)) == (4, 1, 2, 1, 0)


@pytest.mark.parametrize(
    "fault", [Duplicate(), Duplicate(image=2), Duplicate(of=2), Duplicate(image=0), Duplicate(of=0)]
)
def test_drawn_images(fault):
    seen = set()
    for seed in range(300):
        image, of = fault.pair(4, Draws(seed))
        order = fault.order(range(4), Draws(seed))
        assert image != of
        assert order[image] == of
        assert sorted(set(range(4)) - set(order)) == [image]
        assert fault.image in (None, image)
        assert fault.of in (None, of)
        seen.add((image, of))
    assert len(seen) == (12 if fault == Duplicate() else 3)


def test_two_duplicates_follow_each_other():
    order = Duplicate(image=0, of=1).order(range(3), Draws(0))
    assert Duplicate(image=2, of=0).order(order, Draws(0, 1)) == (1, 1, 1)


@pytest.mark.parametrize("options", [{"image": -1}, {"of": -1}, {"image": 2, "of": 2}], ids=str)
def test_bad_indices_are_refused(options):
    with pytest.raises(OptionError):
        Duplicate(**options)


@pytest.mark.parametrize(("fault", "count"), [(Duplicate(), 1), (Duplicate(image=5), 5), (Duplicate(of=5), 5)])
def test_images_that_do_not_exist_are_refused(fault, count):
    with pytest.raises(InputError, match=f"{count} images"):
        fault.order(range(count), Draws(0))
