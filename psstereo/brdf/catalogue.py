"""Every reflectance model, by name."""

from psstereo.brdf.blinn_phong import BlinnPhong
from psstereo.brdf.brdf import Brdf
from psstereo.brdf.ggx import Ggx
from psstereo.brdf.lambert import Lambert
from psstereo.brdf.lunar_lambert import LunarLambert
from psstereo.brdf.merl import Merl
from psstereo.brdf.minnaert import Minnaert
from psstereo.brdf.oren_nayar import OrenNayar
from psstereo.brdf.phong import Phong

__all__ = ["BRDFS"]

BRDFS: dict[str, type[Brdf]] = {
    Lambert.name: Lambert,
    OrenNayar.name: OrenNayar,
    Phong.name: Phong,
    BlinnPhong.name: BlinnPhong,
    Ggx.name: Ggx,
    Minnaert.name: Minnaert,
    LunarLambert.name: LunarLambert,
    Merl.name: Merl,
}
