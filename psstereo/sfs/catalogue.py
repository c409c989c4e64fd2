"""Every way to shape from shading, by name."""

from psstereo.sfs.method import ShadingMethod

__all__ = ["SHADING_METHODS"]

SHADING_METHODS: dict[str, type[ShadingMethod]] = {}
