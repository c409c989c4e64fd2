"""Cameras: how pixels and points in space belong together."""

from psstereo.camera.camera import Camera
from psstereo.camera.catalogue import CAMERAS
from psstereo.camera.lens import Lens, Undistortion
from psstereo.camera.orthographic import Orthographic
from psstereo.camera.pinhole import Pinhole
from psstereo.camera.pose import Pose

__all__ = ["CAMERAS", "Camera", "Lens", "Orthographic", "Pinhole", "Pose", "Undistortion"]
