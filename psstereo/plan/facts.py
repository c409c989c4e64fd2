"""Facts about a capture: plain numbers that decisions rest on."""

from dataclasses import dataclass

from psstereo.plan.diagnosis.finding import Finding
from psstereo.plan.trials import Trial

__all__ = ["Facts"]


@dataclass(frozen=True, kw_only=True)
class Facts:
    """What is known of a capture before it is solved.

    Shares are of the sample's observations, or of its pixels where that is said; what was not looked at, or cannot be
    told, is None.

    Attributes
    ----------
    images, height, width, channels : int
        Of the stack.
    bits : int
        Of a raw value.
    floating : bool
        Whether raw values are floating-point numbers.
    saturates : bool
        Whether raw values end at full scale.
    pixels : int
        Pixels under the mask.
    components : int
        Connected pieces of the mask.
    perspective : bool
        Whether the camera is a pinhole.
    linear : bool
        Whether raw values are proportional to light.
    response : str
        Name of the camera's curve.
    dark_frame : bool
        Whether there is a dark image to subtract.
    lamps : bool
        Whether a light stands at a place near the object.
    rank : int or None
        Dimensions that the light directions span.
    condition : float or None
        Condition of the light matrix.
    cone_deg : float or None
        Largest angle between a light and the mean direction [deg].
    tilt_deg : float or None
        Mean angle between a light and the line of sight [deg].
    strength_ratio : float or None
        Strongest over weakest light.
    strengths_absolute : bool
        Whether strengths are irradiances.
    sample_bytes : int
        Size of all samples [byte].
    memory_limit : int or None
        Bound that was given [byte].
    in_memory : bool
        Whether samples stay in memory.
    workers : int
        Pieces of work done at the same time.
    kept_apart : bool
        Whether each channel is solved on its own.
    masked_by_hand : bool
        Whether observations were left out by hand.
    surveyed : int
        Pixels of the sample; 0 if nothing was surveyed.
    unusable : float or None
        Share that is NaN: saturated, out of range, left out.
    saturated : float or None
        Share with a channel at full scale.
    shadowed : float or None
        Share in attached shadow, by a least-squares fit.
    dark_outliers, bright_outliers : float or None
        Shares of lit observations that lie below or above that fit by more than eight times the noise.
    noise : float or None
        Standard deviation of what is unrelated between neighbouring pixels, over the albedo.
    residual : float or None
        Root-mean-square residual of least squares, over the albedo.
    misfit : float or None
        Share of the pixels whose residuals are much alike at their neighbours: Lambert's law is broken there.
    ambient : float or None
        Level that all images of a pixel share, over the albedo.
    ambient_error : float or None
        Its standard error.
    colour_spread : float or None
        Root-mean-square distance of pixels' chromaticities from their mean.
    turning : float or None
        Share of neighbouring pixels between which the normal turns at once.
    decode_seconds : float or None
        Time to decode one image on one thread [s].
    sample_seconds : float or None
        Time of the least-squares fit of the sample [s].
    trials : tuple of Trial
        Solvers tried on a few pixels.
    findings : tuple of Finding
        What is wrong with the capture.
    """

    images: int
    height: int
    width: int
    channels: int
    bits: int
    floating: bool
    saturates: bool
    pixels: int
    components: int
    perspective: bool
    linear: bool
    response: str
    dark_frame: bool
    lamps: bool
    rank: int | None = None
    condition: float | None = None
    cone_deg: float | None = None
    tilt_deg: float | None = None
    strength_ratio: float | None = None
    strengths_absolute: bool = False
    sample_bytes: int = 0
    memory_limit: int | None = None
    in_memory: bool = True
    workers: int = 1
    kept_apart: bool = False
    masked_by_hand: bool = False
    surveyed: int = 0
    unusable: float | None = None
    saturated: float | None = None
    shadowed: float | None = None
    dark_outliers: float | None = None
    bright_outliers: float | None = None
    noise: float | None = None
    residual: float | None = None
    misfit: float | None = None
    ambient: float | None = None
    ambient_error: float | None = None
    colour_spread: float | None = None
    turning: float | None = None
    decode_seconds: float | None = None
    sample_seconds: float | None = None
    trials: tuple[Trial, ...] = ()
    findings: tuple[Finding, ...] = ()

    def trial(self, solver: str) -> Trial | None:
        """Return how a solver did, None if it was not tried."""
        return next((one for one in self.trials if one.solver == solver), None)
