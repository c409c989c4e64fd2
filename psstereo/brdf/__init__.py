"""Reflectance: how a surface turns irradiance into radiance."""

from psstereo.brdf.blinn_phong import BlinnPhong
from psstereo.brdf.brdf import Brdf
from psstereo.brdf.catalogue import BRDFS
from psstereo.brdf.ggx import Ggx
from psstereo.brdf.hemisphere import directional_reflectance, reciprocity_gap
from psstereo.brdf.lambert import Lambert
from psstereo.brdf.lunar_lambert import LunarLambert, lunar_weight
from psstereo.brdf.merl import Merl, read_merl, tabulate, write_merl
from psstereo.brdf.minnaert import Minnaert
from psstereo.brdf.oren_nayar import OrenNayar
from psstereo.brdf.phong import Phong

__all__ = [
    "BRDFS",
    "BlinnPhong",
    "Brdf",
    "Ggx",
    "Lambert",
    "LunarLambert",
    "Merl",
    "Minnaert",
    "OrenNayar",
    "Phong",
    "directional_reflectance",
    "lunar_weight",
    "read_merl",
    "reciprocity_gap",
    "tabulate",
    "write_merl",
]
