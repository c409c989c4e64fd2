"""Every camera, by name."""

from psstereo.camera.camera import Camera
from psstereo.camera.orthographic import Orthographic
from psstereo.camera.pinhole import Pinhole

__all__ = ["CAMERAS"]

CAMERAS: dict[str, type[Camera]] = {
    Orthographic.name: Orthographic,
    Pinhole.name: Pinhole,
}
