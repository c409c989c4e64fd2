"""Every way to shape from shading, by name."""

from psstereo.sfs.lee_kuo import LeeKuo
from psstereo.sfs.method import ShadingMethod
from psstereo.sfs.pentland import Pentland
from psstereo.sfs.tsai_shah import TsaiShah

__all__ = ["SHADING_METHODS"]

SHADING_METHODS: dict[str, type[ShadingMethod]] = {
    Pentland.name: Pentland,
    TsaiShah.name: TsaiShah,
    LeeKuo.name: LeeKuo,
}
