"""Every reader, by name; where several recognise a folder the first in this order reads it."""

from psstereo.io.beethoven import MatStack
from psstereo.io.capture_toml import CaptureToml
from psstereo.io.diligent import Diligent
from psstereo.io.harvard import PsBox
from psstereo.io.image_folder import ImageFolder
from psstereo.io.input_tif import Face16
from psstereo.io.lp_file import RtiLp
from psstereo.io.meshroom import Meshroom
from psstereo.io.near_led import NearLed
from psstereo.io.npz_stack import NpzStack
from psstereo.io.psm import Psm
from psstereo.io.reader import Reader
from psstereo.io.sdm_unips import SdmUniPs
from psstereo.io.yale import YaleB

__all__ = ["READERS"]

READERS: dict[str, Reader] = {
    reader.name: reader
    for reader in (
        CaptureToml(),
        Meshroom(),
        SdmUniPs(),
        Diligent(),
        PsBox(),
        NearLed(),
        YaleB(),
        Face16(),
        RtiLp(),
        Psm(),
        NpzStack(),
        MatStack(),
        ImageFolder(),
    )
}
