"""Every stage, in the order in which they are decided, applied and told."""

from psstereo.plan.stage import Stage
from psstereo.plan.stages.ambient_solving import AmbientSolving
from psstereo.plan.stages.compiled_kernels import CompiledKernels
from psstereo.plan.stages.dark_level import DarkLevel
from psstereo.plan.stages.depth import Depth
from psstereo.plan.stages.discontinuities import Discontinuities
from psstereo.plan.stages.light_directions import LightDirections
from psstereo.plan.stages.light_strengths import LightStrengths
from psstereo.plan.stages.linearisation import Linearisation
from psstereo.plan.stages.mesh import Mesh
from psstereo.plan.stages.near_lamps import NearLamps
from psstereo.plan.stages.observation_mask import ObservationMask
from psstereo.plan.stages.perspective import Perspective
from psstereo.plan.stages.reading import ReadingImages
from psstereo.plan.stages.reflectance import Reflectance
from psstereo.plan.stages.robust_solving import RobustSolving
from psstereo.plan.stages.saturation_gate import SaturationGate
from psstereo.plan.stages.shadow_gate import ShadowGate
from psstereo.plan.stages.tiling import Tiling
from psstereo.plan.stages.verdicts import Verdicts

__all__ = ["STAGES"]

STAGES: dict[str, Stage] = {
    stage.name: stage
    for stage in (
        Linearisation(),
        DarkLevel(),
        LightDirections(),
        LightStrengths(),
        NearLamps(),
        ReadingImages(),
        SaturationGate(),
        ShadowGate(),
        ObservationMask(),
        Tiling(),
        AmbientSolving(),
        RobustSolving(),
        Reflectance(),
        Verdicts(),
        CompiledKernels(),
        Perspective(),
        Depth(),
        Discontinuities(),
        Mesh(),
    )
}
"""By name."""
