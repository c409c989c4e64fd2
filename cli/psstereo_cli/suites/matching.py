"""Suite matching: error over numbers of lights, and error and time against OpenCV's StereoSGBM."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.types import Array, BoolArray, FloatArray, Map, Progress

__all__ = ["matching"]

_LIGHTS = (1, 2, 4, 8, 16)
_COUNT = 64
"""Disparities of photographs; a multiple of 16, as OpenCV wants it."""


def matching(
    repeats: int, size: str | None, _lights: int, threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Score the synthetic rig under 1 to 16 lights, and real pairs where they are at hand; time one pair."""
    from psstereo.bench import run_timed
    from psstereo.errors import OptionError
    from psstereo.matching import RectifiedMatcher, ViewImages
    from psstereo_synth.rendering import render
    from psstereo_synth.stereo_rig import CAMERA, stereo_rig

    width, height = dimensions(size or "256x256")
    if width != height:
        raise OptionError(
            given=f"The size is {size!r}.", needed="The rig has square images.", remedy=f"Say {width}x{width}."
        )
    notes = [_constancy_note(glossy) for glossy in (False, True)]
    notes += [_rig_note(width, painted, over) for painted in (True, False)]
    pairs, missing = _pairs()
    notes += missing
    for name, (left, right, truth, visible) in pairs.items():
        notes.append(_pair_note(name, left, right, truth, visible, over))
    if pairs:
        name, (left, right, _, _) = next(iter(pairs.items()))
    else:
        name, shots = "rig", render(stereo_rig(width, lights=1, sensor=CAMERA))
        left, right = ((shot.capture.stack.frame(0) >> 4).astype("uint8") for shot in shots)
    one, two = ViewImages.from_arrays(left), ViewImages.from_arrays(right)
    matcher = RectifiedMatcher(count=_COUNT)
    baseline = "OpenCV StereoSGBM, 8 paths"
    methods: dict[str, Callable[[], object]] = {
        baseline: partial(_opencv, left, right, block=3, cap=31, unique=10, window=100),
        "psstereo, 1 thread": partial(matcher.match, one, two),
        "psstereo, 1 thread, unchecked": partial(replace(matcher, checks=False).match, one, two),
    }
    if threads > 1:
        methods[f"psstereo, {threads} threads"] = partial(matcher.match, one, two, over=over)
    sizes = {"width": left.shape[1], "height": left.shape[0], "disparities": _COUNT, "threads": threads}
    records = run_timed("matching", name, methods, repeats=repeats, sizes=sizes, progress=progress)
    return records, baseline, {"sizes": sizes, "notes": notes}


def _constancy_note(glossy: bool) -> str:
    from psstereo.matching import Noise, compare_values
    from psstereo_synth.stereo import same_points
    from psstereo_synth.stereo_rig import stereo_rig

    points = same_points(stereo_rig(128, lights=1, glossy=glossy))
    noise = Noise(step=1 / 65535)
    found = compare_values(points.image(points.first), points.image(points.second), points.mask, (noise, noise))
    return (
        f"{'glossy' if glossy else 'matte'} rig, 16 bit: {found.within_rounding:.2%} of {found.count} points that both"
        " cameras see are equal within rounding."
    )


def _rig_note(size: int, painted: bool, over: "Map") -> str:
    from psstereo.matching import Noise, RectifiedMatcher, ViewImages, disparity_score
    from psstereo_synth.rendering import render
    from psstereo_synth.stereo import true_disparity
    from psstereo_synth.stereo_rig import CAMERA, stereo_rig

    scene = stereo_rig(size, lights=max(_LIGHTS), painted=painted, sensor=CAMERA)
    truth, shots = true_disparity(scene), render(scene, over=over)
    noise = Noise(step=1 / 4095, electrons=10_000, read=5 / 10_000)
    matcher = RectifiedMatcher.for_linear(first=size // 20, count=size // 4)
    words = []
    for count in _LIGHTS:
        # Spread like the whole rig: every so many of its lights.
        chosen = range(0, max(_LIGHTS), max(_LIGHTS) // count)
        pair = [ViewImages.from_capture(shot.capture, noise=noise, lights=chosen) for shot in shots]
        score = disparity_score(matcher.match(*pair, over=over).disparity, truth.disparity, truth.visible)
        words.append(f"{count}: {score['bad-1']:.2f} %")
    return f"rig {'painted' if painted else 'plain'}, bad-1.0 by number of lights: {', '.join(words)}"


def _pairs() -> tuple[dict[str, tuple["Array", "Array", "FloatArray", "BoolArray"]], list[str]]:
    """Return the real pairs that are at hand, with truth and what both views see, and why others are not."""
    from importlib import import_module

    import numpy as np
    import skimage

    from psstereo.matching import read_disparity, visible_in_right
    from psstereo.stack.decode import decode_image

    found, missing = {}, []
    folder = Path(os.environ.get("PSSTEREO_DATA", "")) / "stereo" / "cones"
    if (folder / "disp2.pgm").is_file():
        images = [np.ascontiguousarray(decode_image(folder / name)) for name in ("im2.png", "im6.png")]
        truth = read_disparity(folder / "disp2.pgm", scale=4)
        found["cones"] = (images[0], images[1], truth, visible_in_right(truth))
    else:
        missing.append("Middlebury's cones were left out: PSSTEREO_DATA names no folder with stereo/cones.")
    if (Path(skimage.__file__).parent / "data" / "motorcycle_disp.npz").is_file():
        left, right, disparity = import_module("skimage.data").stereo_motorcycle()
        truth = np.where(np.isfinite(disparity), disparity, np.nan).astype(np.float64)
        found["motorcycle"] = (left, right, truth, visible_in_right(truth))
    else:
        missing.append("scikit-image's motorcycle was left out: this installation has it only for download.")
    return found, missing


def _opencv(left: "Array", right: "Array", *, block: int, cap: int, unique: int, window: int) -> "FloatArray":
    """Run OpenCV's matcher with eight paths, penalties by its own rule."""
    import cv2
    import numpy as np

    area = (1 if left.ndim == 2 else left.shape[2]) * block**2
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=_COUNT,
        blockSize=block,
        P1=8 * area,
        P2=32 * area,
        disp12MaxDiff=1 if unique else -1,
        preFilterCap=cap,
        uniquenessRatio=unique,
        speckleWindowSize=window,
        speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    found = np.asarray(matcher.compute(left, right), np.float64) / 16
    return np.where(found >= 0, found, np.nan)


def _pair_note(name: str, left: "Array", right: "Array", truth: "FloatArray", visible: "BoolArray", over: "Map") -> str:
    import numpy as np

    from psstereo.matching import RectifiedMatcher, ViewImages, disparity_score, pair_constancy

    pair = [ViewImages.from_arrays(image) for image in (left, right)]
    ours = disparity_score(RectifiedMatcher(count=_COUNT).match(*pair, over=over).disparity, truth, visible)
    grid: list[Mapping[str, float]] = [
        disparity_score(_opencv(left, right, block=block, cap=cap, unique=unique, window=window), truth, visible)
        for block in (3, 5)
        for cap in (15, 31, 63)
        for unique, window in ((0, 0), (5, 0), (10, 100))
    ]
    best = min(grid, key=lambda score: score["bad-2 filled"])
    median = 255 * float(np.nanmedian(pair_constancy(pair[0], pair[1], truth).absolute))
    return (
        f"{name}, bad-2.0 of visible pixels, gaps filled (gaps counted as bad): {ours['bad-2 filled']:.2f} % "
        f"({ours['bad-2']:.2f} %); OpenCV's best of {len(grid)} (blocks 3 and 5, "
        f"caps 15, 31, 63, three ways of leaving out): {best['bad-2 filled']:.2f} % ({best['bad-2']:.2f} %). "
        f"Median difference of brightness at the true match: {median:.1f} of 255."
    )
