"""How good lights are, in figures and in words, and where to put them."""

from psstereo.calibrate.rig.figures import RigFigures, rig_figures
from psstereo.calibrate.rig.proposal import SHAPES, RigProposal, propose_rig
from psstereo.calibrate.rig.rating import RigRating, assess_rig, rate_rig

__all__ = [
    "SHAPES",
    "RigFigures",
    "RigProposal",
    "RigRating",
    "assess_rig",
    "propose_rig",
    "rate_rig",
    "rig_figures",
]
