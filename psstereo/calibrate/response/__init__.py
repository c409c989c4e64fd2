"""The camera's tone curve: from exposures of one scene, or from the shading itself."""

from psstereo.calibrate.response.capture import response_of_capture
from psstereo.calibrate.response.exposures import Exposures, response_from_exposures
from psstereo.calibrate.response.fit import ResponseFit
from psstereo.calibrate.response.shading import response_from_shading

__all__ = [
    "Exposures",
    "ResponseFit",
    "response_from_exposures",
    "response_from_shading",
    "response_of_capture",
]
