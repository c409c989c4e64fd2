"""Reflectance: how a surface turns irradiance into radiance."""

from psstereo.brdf.brdf import Brdf
from psstereo.brdf.catalogue import BRDFS
from psstereo.brdf.lambert import Lambert

__all__ = ["BRDFS", "Brdf", "Lambert"]
