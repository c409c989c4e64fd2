"""Each fault is named with a figure near the truth, and good captures are left in peace."""

import numpy as np
import pytest
from scipy.ndimage import shift

from psstereo.lights import Rig
from psstereo.plan.diagnosis import CHECKS, Finding, diagnose
from psstereo.plan.sample import Sample, SamplePixels
from psstereo.stack import MemoryStack
from psstereo_synth.rigs import arc, ring, spiral

TILT = np.radians(55.0)
EIGHT = spiral(8, max_tilt=TILT)
RIGS = {"three": ring(3, tilt=np.radians(35)), "four": ring(4, tilt=np.radians(40)), "eight": EIGHT, "many": spiral(24)}


def named(findings: tuple[Finding, ...], name: str) -> Finding:
    found = {one.name: one for one in findings}
    assert name in found, f"{name} is not among {list(found)}"
    return found[name]


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize(("sphere", "bits"), [(False, 8), (True, 16)])
def test_good_captures_are_left_in_peace(shot, sampled, rig, sphere, bits):
    made = shot(RIGS[rig], sphere=sphere)
    sample = sampled(made.images, RIGS[rig], made.mask, bits=bits)
    assert diagnose(sample) == ()


@pytest.mark.parametrize("rig", RIGS)
def test_exchanged_rows_are_named(shot, sampled, rig):
    order = np.arange(len(RIGS[rig]))
    pair = (0, 1) if rig == "four" else (0, 2)  # opposite lights of a ring of four make a mirror image
    order[list(pair)] = pair[::-1]
    found = diagnose(sampled(shot(RIGS[rig]).images, RIGS[rig][order]))
    one = named(found, "light-order")
    assert one.images == pair
    assert one.severity == "fault"
    assert one.figure > 2
    assert named(found, "not-checked").severity == "note"


def test_a_light_file_sorted_as_text_is_found(shot, sampled):
    rig = spiral(12)
    names = [str(i + 1) for i in range(12)]
    text = sorted(range(12), key=lambda i: names[i])
    one = named(diagnose(sampled(shot(rig).images, rig[text])), "light-order")
    assert set(one.images) == {i for i in range(12) if text[i] != i}


@pytest.mark.parametrize(("signs", "word"), [((1, -1, 1), "y"), ((-1, 1, 1), "x")])
@pytest.mark.parametrize("rig", ["three", "eight"])
def test_mirrored_axes_are_told_apart_on_a_bulging_object(shot, sampled, rig, signs, word):
    made = shot(RIGS[rig], sphere=True)
    found = diagnose(sampled(made.images, RIGS[rig] * signs, made.mask))
    one = named(found, "light-axes")
    assert f"lights' {word} seems" in one.sentence
    # that ring of three is its own mirror image but for two rows
    assert ("rows 2 and 3 are exchanged" in one.remedy) == (rig == "three")


def test_exchanged_axes_are_found(shot, sampled):
    one = named(diagnose(sampled(shot(EIGHT).images, EIGHT[:, [1, 0, 2]])), "light-axes")
    assert "exchanged" in one.sentence


def test_lights_behind_the_object_are_found(shot, sampled):
    one = named(diagnose(sampled(shot(EIGHT).images, EIGHT * [1, 1, -1])), "light-depth")
    assert one.figure > 95


def test_gamma_is_estimated(shot, sampled):
    gamma, made = 2.2, shot(EIGHT)
    one = named(diagnose(sampled(made.images ** (1 / gamma), EIGHT)), "response")
    assert one.figure == pytest.approx(gamma, rel=0.12)


@pytest.mark.parametrize("level", [0.03, 0.08])
def test_ambient_light_is_measured(shot, sampled, level):
    made = shot(spiral(16), texture=0.0)
    one = named(diagnose(sampled(made.images + level, spiral(16))), "ambient")
    assert one.figure == pytest.approx(100 * level / 0.5, rel=0.25)


def test_unequal_strengths_are_measured(shot, sampled):
    factors = np.exp(0.3 * np.random.default_rng(3).standard_normal(8))
    factors /= factors.max()
    one = named(diagnose(sampled(shot(EIGHT).images * factors[:, None, None], EIGHT)), "strengths")
    logs = np.log(factors / factors.mean())
    assert one.figure == pytest.approx(100 * np.sqrt(np.mean(logs**2)), rel=0.15)
    assert int(np.argmin(factors)) in one.images


def test_strengths_that_are_told_are_no_news(shot, sampled):
    factors = np.linspace(0.5, 1.0, 8)
    sample = sampled(shot(EIGHT).images * factors[:, None, None], EIGHT, strengths=factors)
    assert diagnose(sample) == ()


@pytest.mark.parametrize("sphere", [False, True])
def test_near_lamps_are_found_and_their_distance_told(shot, sampled, sphere):
    made = shot(EIGHT, sphere=sphere, lamps=6.0)
    sample = sampled(0.7 * made.images, EIGHT, made.mask)
    one = named(diagnose(sample), "near-light")
    reach = 0.855 if sphere else 0.99  # half of the larger extent
    assert one.figure == pytest.approx(6.0 / (2 * reach), rel=0.25)


class Lamps:
    lamps = True


def test_lamps_at_known_places_are_no_news(shot, sampled):
    made = shot(EIGHT, lamps=4.0)
    assert not {"near-light", "strengths"} & {f.name for f in diagnose(sampled(0.7 * made.images, EIGHT), Lamps())}


@pytest.mark.parametrize("rig", ["three", "eight"])
def test_motion_is_measured(shot, sampled, probe, rig):
    lights = RIGS[rig]
    size = 144
    rng = np.random.default_rng(1)
    detail = rng.standard_normal((size, size))
    made = shot(lights, size=size, texture=0.0)
    painted = made.images * (
        1 + 0.25 * (detail + shift(detail, 1.0, mode="wrap") + shift(detail, (0, 1), mode="wrap")) / 2
    )
    moves = rng.uniform(-1.4, 1.4, (len(lights), 2))
    moved = np.array([shift(one, move, order=3, mode="nearest") for one, move in zip(painted, moves, strict=True)])
    still, found = (
        {f.name: f for f in diagnose(sampled(i, lights), motion=probe(i))} for i in (painted, np.maximum(moved, 0))
    )
    assert "motion" not in still
    true = np.sqrt(((moves - moves.mean(axis=0)) ** 2).sum(axis=1).mean())
    assert found["motion"].figure == pytest.approx(true, rel=0.15)


@pytest.mark.parametrize("rig", ["three", "eight"])
def test_a_flash_that_failed_is_named(shot, sampled, rig):
    images = shot(RIGS[rig]).images.copy()
    images[1] *= 0.03
    one = named(diagnose(sampled(images, RIGS[rig])), "failed-flash")
    assert one.images == (1,)
    assert one.figure == pytest.approx(3, abs=2)


def test_lights_behind_the_object_may_be_dark(shot, sampled):
    lights = np.vstack([EIGHT, [[0.9, 0.0, -0.43589]]])
    assert "failed-flash" not in {f.name for f in diagnose(sampled(shot(lights).images, lights))}


@pytest.mark.parametrize("rig", ["three", "eight"])
def test_an_image_saved_twice_is_named(shot, sampled, rig):
    images = shot(RIGS[rig]).images.copy()
    images[2] = images[0]
    one = named(diagnose(sampled(images, RIGS[rig], noise=0.0)), "duplicate-image")
    assert one.images == (0, 2)


def test_an_image_taken_twice_is_named_in_spite_of_noise(shot, sampled):
    images = shot(EIGHT).images.copy()
    images[5] = images[2]
    assert named(diagnose(sampled(images, EIGHT)), "duplicate-image").images == (2, 5)


def test_equal_images_of_a_plane_are_no_duplicates(sampled):
    lights = ring(6)
    assert "duplicate-image" not in {f.name for f in diagnose(sampled(np.full((6, 64, 64), 0.4), lights, noise=0.0))}


def test_a_light_written_down_twice_is_named(shot, sampled):
    lights = EIGHT.copy()
    lights[6] = lights[1]
    assert named(diagnose(sampled(shot(EIGHT).images, lights)), "duplicate-light").images == (1, 6)


def test_one_light_photographed_twice_is_no_fault(shot, sampled):
    lights = np.vstack([EIGHT, EIGHT[3]])
    assert diagnose(sampled(shot(lights).images, lights)) == ()


def test_saturation_is_counted(shot, sampled):
    made = shot(EIGHT)
    images = 2.2 * made.images
    one = named(diagnose(sampled(images, EIGHT, noise=0.0)), "saturation")
    assert one.figure == pytest.approx(100 * (images >= 0.98).mean(), rel=0.05)


def test_black_that_is_cut_off_is_found(shot, sampled):
    made = shot(spiral(16, max_tilt=np.radians(75)), texture=0.0, sphere=True)
    sample = sampled(np.maximum(made.images - 0.05, 0), spiral(16, max_tilt=np.radians(75)), made.mask, noise=0.0)
    assert named(diagnose(sample), "clipped-black").figure == pytest.approx(10, rel=0.3)


def test_coarse_steps_are_found(shot, sampled):
    one = named(diagnose(sampled(0.03 * shot(EIGHT).images, EIGHT, bits=8, noise=0.0)), "coarse-steps")
    assert 1 < one.figure < 6


def test_background_under_the_mask_is_counted(shot, sampled):
    made = shot(EIGHT, sphere=True)
    one = named(diagnose(sampled(made.images, EIGHT)), "background")
    assert one.figure == pytest.approx(100 * (~made.mask).mean(), rel=0.2)


def test_a_narrow_cone_and_a_plane_are_found(shot, sampled):
    narrow = spiral(8, max_tilt=np.radians(10))
    flat = arc(8) + np.array([0, 0.03, 0])
    flat[::2, 1] -= 0.06
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    for lights, word in ((narrow, "cone of 9°"), (flat, "one plane")):
        assert word in named(diagnose(sampled(shot(lights).images, lights)), "light-cone").sentence


def test_findings_are_sorted_plain_data(shot, sampled):
    found = diagnose(sampled(shot(EIGHT).images ** (1 / 2.2), EIGHT[[2, 1, 0, *range(3, 8)]]))
    order = ["fault", "warning", "note"]
    ranks = [order.index(one.severity) for one in found]
    assert ranks == sorted(ranks)
    for one in found:
        assert one.name in {*CHECKS, "not-checked"}
        assert 0 <= one.confidence <= 1
        assert np.isfinite(one.figure)
        assert one.sentence.endswith(".")
        assert one.remedy.endswith(".")
        assert one.record()["name"] == one.name


def test_a_handful_of_pixels_says_nothing(shot, sampled):
    made = shot(EIGHT)
    mask = np.zeros(made.mask.shape, np.bool_)
    mask[40:43, 50:53] = True
    assert diagnose(sampled(made.images, EIGHT, mask)) == ()


def test_nothing_usable_says_nothing(sampled):
    assert all(f.name in CHECKS for f in diagnose(sampled(np.zeros((8, 32, 32)), EIGHT, noise=0.0)))
    full = diagnose(sampled(np.ones((8, 32, 32)), EIGHT, noise=0.0))
    assert [one.name for one in full] == ["saturation"]


@pytest.mark.parametrize("rig", ["three", "eight"])
@pytest.mark.parametrize("factor", [0.0, -1.0, np.nan, 1e30, 1e-30])
def test_strange_values_neither_warn_nor_alarm(shot, sampled, rig, factor):
    sample = sampled(shot(RIGS[rig], size=48).images, RIGS[rig])
    strange = Sample.fitted(
        factor * sample.values,
        SamplePixels(pixels=sample.pixels, neighbours=sample.neighbours, blocks=sample.blocks),
        MemoryStack(np.zeros((len(RIGS[rig]), 48, 48, 1), np.uint16)),
        Rig.distant(RIGS[rig]),
    )
    assert diagnose(strange) == ()


def test_an_image_without_any_usable_value_is_no_failed_flash(shot, sampled):
    images = shot(EIGHT).images.copy()
    images[3] = 1.0
    found = {one.name for one in diagnose(sampled(images, EIGHT))}
    assert "failed-flash" not in found
    assert "saturation" in found
