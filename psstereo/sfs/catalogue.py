"""Every way to shape from shading, by name."""

from psstereo.sfs.eikonal import Eikonal
from psstereo.sfs.lee_kuo import LeeKuo
from psstereo.sfs.method import ShadingMethod
from psstereo.sfs.pentland import Pentland
from psstereo.sfs.tsai_shah import TsaiShah
from psstereo.sfs.variational import Variational

__all__ = ["SHADING_METHODS"]

SHADING_METHODS: dict[str, type[ShadingMethod]] = {
    Variational.name: Variational,
    Eikonal.name: Eikonal,
    Pentland.name: Pentland,
    TsaiShah.name: TsaiShah,
    LeeKuo.name: LeeKuo,
}
