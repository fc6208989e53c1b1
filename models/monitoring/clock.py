"""A jump in scale alone: the camera's clock or frame rate, rather than the camera."""

import math

from models.geometry.plane_parameters import ANGLES, PLANE_PARAMETERS
from models.geometry.pose import CameraPose
from models.monitoring.chart import CLOCK, Reading
from models.monitoring.verdict import Drift
from models.reasons import Reason, TracksCode

_SIGMAS = 4.0
_LEAST_LOG = math.log(1.08)
_STILL_SIGMAS = 2.0
_STILL_RAD = math.radians(1.0)
_USUAL_RATE_HZ = 25.0
_HEIGHT = 2
_GROUPS_FOR_POSE = 24


def may_be_clock(reading: Reading) -> bool:
    """True where an alarm may be of the clock, after too few walking groups for the pose to decide.

    An alarm about a scale that waits for a few more people can be called what it is.
    """
    return reading.parameter in (_HEIGHT, CLOCK) and reading.walking_groups < _GROUPS_FOR_POSE


def clock_fault(drift: Drift, prior: CameraPose, frame_rate_hz: float | None) -> Reason | None:
    """Reason of a change of scale with unchanged angles; None where there is none.

    Times that are too long by a factor make people slow, and only a higher camera makes them walk
    as before: the height grows by that factor and nothing else does. A camera that was raised
    without turning looks the same.

    Args:
        drift: the estimate against the prior pose.
        prior: that pose.
        frame_rate_hz: what the camera is said to have; 25 frames a second where nobody says.
    """
    if not set(PLANE_PARAMETERS) <= set(drift.identifiable):
        return None
    factor = 1 + drift.by.height_m / prior.height_m
    relative_sd = drift.sd.height_m / (factor * prior.height_m)
    if abs(math.log(factor)) <= max(_SIGMAS * relative_sd, _LEAST_LOG):
        return None
    for angle, sd in (drift.of(name) for name in ANGLES if name in drift.identifiable):
        if abs(angle) > min(_STILL_SIGMAS * sd, _STILL_RAD):
            return None
    values = {"factor": factor, "rate_hz": frame_rate_hz or _USUAL_RATE_HZ}
    return Reason(code=TracksCode.SCALE_CHANGED, values=values)
