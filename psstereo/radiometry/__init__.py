"""Radiometry: radiance, irradiance and the solid angles between them."""

from psstereo.radiometry.cap import cap_half_angle, cap_solid_angle
from psstereo.radiometry.constants import (
    FULL_SPHERE,
    HEMISPHERE,
    SOLAR_CONSTANT,
    SUN_ANGULAR_RADIUS,
    SUN_RADIANCE,
    SUN_SOLID_ANGLE,
)
from psstereo.radiometry.disc import disc_solid_angle, disc_solid_angle_from
from psstereo.radiometry.disc_irradiance import disc_irradiance
from psstereo.radiometry.etendue import disc_etendue, thin_etendue
from psstereo.radiometry.irradiance import incidence_cosine, narrow_irradiance
from psstereo.radiometry.lambert import albedo_from_brdf, brdf_from_albedo, lambertian_exitance, lambertian_radiance
from psstereo.radiometry.medium import transmittance
from psstereo.radiometry.polygon import polygon_solid_angle, spherical_polygon_solid_angle
from psstereo.radiometry.polygon_irradiance import polygon_irradiance
from psstereo.radiometry.radiance import apparent_radiance, field_radius, radiance_from_power
from psstereo.radiometry.sphere import sphere_irradiance, sphere_solid_angle
from psstereo.radiometry.sun import sun_irradiance, sun_radiance
from psstereo.radiometry.triangle import triangle_solid_angle
from psstereo.radiometry.tube import tube_half_angle, tube_power, tube_solid_angle

__all__ = [
    # constants
    "FULL_SPHERE", "HEMISPHERE", "SOLAR_CONSTANT", "SUN_ANGULAR_RADIUS", "SUN_RADIANCE", "SUN_SOLID_ANGLE",
    # solid angles
    "cap_half_angle", "cap_solid_angle", "disc_solid_angle", "disc_solid_angle_from", "polygon_solid_angle",
    "sphere_solid_angle", "spherical_polygon_solid_angle", "triangle_solid_angle",
    # tubes
    "disc_etendue", "thin_etendue", "tube_half_angle", "tube_power", "tube_solid_angle",
    # radiance
    "apparent_radiance", "field_radius", "radiance_from_power",
    # irradiance
    "disc_irradiance", "incidence_cosine", "narrow_irradiance", "polygon_irradiance", "sphere_irradiance",
    "sun_irradiance", "sun_radiance",
    # media
    "transmittance",
    # Lambertian surfaces
    "albedo_from_brdf", "brdf_from_albedo", "lambertian_exitance", "lambertian_radiance",
]  # fmt: skip
