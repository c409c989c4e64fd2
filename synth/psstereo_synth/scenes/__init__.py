"""Scenes: what synthetic captures are made of, and files that describe them."""

from psstereo_synth.scenes.material import Material
from psstereo_synth.scenes.scene import Scene, Viewpoint

__all__ = ["Material", "Scene", "Viewpoint"]
