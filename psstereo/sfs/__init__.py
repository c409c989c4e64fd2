"""Shape from shading: one image, and every assumption that it takes."""

from psstereo.sfs.assumption import Assumption, Basis
from psstereo.sfs.catalogue import SHADING_METHODS
from psstereo.sfs.image import ShadedImage
from psstereo.sfs.method import ShadingMethod, ShadingResult

__all__ = ["SHADING_METHODS", "Assumption", "Basis", "ShadedImage", "ShadingMethod", "ShadingResult"]
