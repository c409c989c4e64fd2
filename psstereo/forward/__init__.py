"""The forward model: from a scene to images."""

from psstereo.forward.lambert import lambertian_images

__all__ = ["lambertian_images"]
