"""The lecture's statements, a sentence each."""

__all__ = ["STATEMENTS"]

STATEMENTS: dict[str, str] = {
    "tube": "Through a thin tube runs the power L A Ω, which grows as r⁴ and falls as 1/d².",
    "radiance": "Radiance is constant along a ray in clear air, and falls as exp(−σ d) in fog.",
    "room": "Walls, floor and ceiling of a room add up to 4π sr, from anywhere inside.",
    "cosine": "A slanting beam is spread over 1 / n·l of its area, so its irradiance falls with n·l.",
    "skylight": "A skylight gives π L sin²θ on its axis, and L Ω n·l from far away.",
    "laboratory": "A BRDF is measured with one light and one eye at a time, which may change places.",
    "viewpoints": "A matte surface is equally bright from every viewpoint; a glossy one is not.",
    "sun": "The sun gives E = L_sun Ω_sun n·l, while its whole disc is above the horizon.",
}
"""Statements by the name of the example, in the order in which they build on each other."""
