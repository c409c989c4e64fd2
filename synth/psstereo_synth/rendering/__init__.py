"""Rendering: from scenes to captures with known truth."""

from psstereo_synth.rendering.render import Rendering, render

__all__ = ["Rendering", "render"]
