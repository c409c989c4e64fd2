"""Terrain from the sun: a coarse elevation refined by one or several images of sunlit ground."""

from psstereo.sfs.terrain.refine import TerrainOptions, TerrainResult, enlarge, refine_terrain

__all__ = ["TerrainOptions", "TerrainResult", "enlarge", "refine_terrain"]
