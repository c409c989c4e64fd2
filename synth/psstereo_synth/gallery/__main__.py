"""``python -m psstereo_synth.gallery SHEET.png``: all named scenes on one sheet, one row each."""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.gallery import GALLERY, gallery_scene
from psstereo_synth.rendering import Rendering, render
from psstereo_synth.scenes.file import Changes

_SIZE = 112
_COLUMNS = ("first light", "middle light", "last light", "normals", "visibility of the last")


def draw(path: Path) -> None:
    """Draw three images, the normals and one visibility of each scene.

    Parameters
    ----------
    path : Path
        Picture to write.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(len(_COLUMNS) * 1.2 + 1.5, len(GALLERY) * 1.2), dpi=80)
    axes: Any = figure.subplots(len(GALLERY), len(_COLUMNS), gridspec_kw={"wspace": 0.03, "hspace": 0.03})
    for row, name in enumerate(GALLERY):
        found = render(gallery_scene(name, Changes(size=(_SIZE, _SIZE))))[0]
        for column, picture in enumerate(_pictures(found)):
            place = axes[row, column]
            place.imshow(picture, vmin=0, vmax=1, cmap="gray", interpolation="nearest")
            place.set(xticks=[], yticks=[])
            if row == 0:
                place.set_title(_COLUMNS[column], fontsize=7)
        axes[row, 0].set_ylabel(name, rotation=0, ha="right", va="center", fontsize=8)
    figure.savefig(path, bbox_inches="tight", pil_kwargs={"optimize": True})


def _pictures(found: Rendering) -> list[FloatArray]:
    stack, last = found.capture.stack, len(found.capture.stack) - 1
    shown = []
    for i in (0, last // 2, last):
        light = found.capture.response.linearise(stack.frame(i), stack.white) / stack.white
        shown.append(np.clip(light.mean(axis=2), 0, 1) ** (1 / 2.2))
    assert found.truth.normals is not None
    assert found.truth.visibility is not None
    colours = np.nan_to_num((found.truth.normals + 1) / 2, nan=0.0)
    return [*shown, colours, found.truth.visibility[last]]


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("Name the picture to write: python -m psstereo_synth.gallery SHEET.png")
    draw(Path(sys.argv[1]))
