"""Every writer of captures, by name."""

from psstereo.io.capture_writer import CaptureWriter
from psstereo.io.diligent_writer import DiligentWriter
from psstereo.io.lp_writer import LpWriter
from psstereo.io.luces_writer import LucesWriter
from psstereo.io.meshroom_writer import MeshroomWriter
from psstereo.io.near_ps_writer import NearPsWriter
from psstereo.io.sdm_unips_writer import SdmUniPsWriter
from psstereo.io.writer import Writer

__all__ = ["WRITERS"]

WRITERS: dict[str, Writer] = {
    writer.name: writer
    for writer in (
        CaptureWriter(),
        DiligentWriter(),
        LpWriter(),
        SdmUniPsWriter(),
        LucesWriter(),
        NearPsWriter(),
        MeshroomWriter(),
    )
}
