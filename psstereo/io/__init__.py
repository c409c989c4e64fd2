"""Files in and out: captures of all known layouts, masks, lights, normal maps and meshes."""

from psstereo.io.camera_file import read_camera
from psstereo.io.capture_toml import TEMPLATE
from psstereo.io.catalogue import READERS
from psstereo.io.conventions import CONVENTIONS, Convention, from_canonical, to_canonical
from psstereo.io.diligent_writer import write_diligent
from psstereo.io.elevation_file import ELEVATION_SUFFIXES, Elevation, read_elevation, write_elevation
from psstereo.io.environment_file import ENVIRONMENT_SUFFIXES, read_environment, write_environment
from psstereo.io.green_convention import GreenVerdict, green_convention
from psstereo.io.light_file import Directions, read_directions
from psstereo.io.lp_file import LpFile, read_lp, write_lp
from psstereo.io.mask_file import read_mask
from psstereo.io.mesh_file import MESH_SUFFIXES, write_mesh
from psstereo.io.normal_map import NormalMap, read_normal_map, write_normal_map
from psstereo.io.prior_file import KnownDepth, read_known_depth
from psstereo.io.read import Recognition, read_capture, recognise
from psstereo.io.reader import Choices, Reader
from psstereo.io.write import write_capture
from psstereo.io.writer import Writer
from psstereo.io.writer_catalogue import WRITERS

__all__ = [
    # captures
    "READERS",
    "TEMPLATE",
    "WRITERS",
    "Choices",
    "Reader",
    "Recognition",
    "Writer",
    "read_capture",
    "recognise",
    "write_capture",
    "write_diligent",
    # parts of captures
    "Directions",
    "LpFile",
    "read_directions",
    "read_lp",
    "read_mask",
    "write_lp",
    # light from all around
    "ENVIRONMENT_SUFFIXES",
    "read_environment",
    "write_environment",
    # cameras and depth
    "ELEVATION_SUFFIXES",
    "Elevation",
    "KnownDepth",
    "read_camera",
    "read_elevation",
    "read_known_depth",
    "write_elevation",
    # normal maps and meshes
    "CONVENTIONS",
    "MESH_SUFFIXES",
    "Convention",
    "GreenVerdict",
    "NormalMap",
    "from_canonical",
    "green_convention",
    "read_normal_map",
    "to_canonical",
    "write_mesh",
    "write_normal_map",
]
