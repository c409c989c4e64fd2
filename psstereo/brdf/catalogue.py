"""Every reflectance model, by name."""

from psstereo.brdf.brdf import Brdf
from psstereo.brdf.lambert import Lambert

__all__ = ["BRDFS"]

BRDFS: dict[str, type[Brdf]] = {
    Lambert.name: Lambert,
}
