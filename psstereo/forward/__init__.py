"""The forward model: from a surface, its reflectance and lights to radiance."""

from psstereo.forward.geometry import Geometry
from psstereo.forward.horizon import shadow_height
from psstereo.forward.lambert import lambertian_images
from psstereo.forward.relief_shadows import ReliefShadows
from psstereo.forward.shade import Shading, shade
from psstereo.forward.shadows import Shadows

__all__ = ["Geometry", "ReliefShadows", "Shading", "Shadows", "lambertian_images", "shade", "shadow_height"]
