"""The named scenes."""

import tomllib
from pathlib import Path

from psstereo.catalogue import choose
from psstereo_synth.scenes import Scene
from psstereo_synth.scenes.file import Changes, read_scene

__all__ = ["GALLERY", "gallery_scene", "summaries"]

_NAMES = (
    "matte-sphere",
    "hills",
    "terrain-day",
    "glossy",
    "metallic",
    "three-lights",
    "narrow-cone",
    "coplanar-suns",
    "cliff",
    "room",
    "near-leds",
    "two-views",
    "low-light",
)
"""From easy to cruel."""

GALLERY: dict[str, Path] = {name: Path(__file__).with_name(f"{name}.toml") for name in _NAMES}
"""Scene files by name."""


def gallery_scene(name: str, changes: Changes | None = None) -> Scene:
    """Return a named scene.

    Parameters
    ----------
    name : str
        One of :data:`GALLERY`.
    changes : Changes, optional
        Size, number of lights and seed to take instead of the scene's own.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    OptionError
        If there is no such scene; the nearest names are offered.
    """
    return read_scene(choose(GALLERY, name, "scene"), changes)


def summaries() -> dict[str, str]:
    """Return what each scene tests, without building it."""
    return {name: tomllib.loads(path.read_text(encoding="utf-8"))["summary"] for name, path in GALLERY.items()}
