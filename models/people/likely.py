"""About how a camera is tilted by now: enough to sort people by, long before a pose is told."""

from dataclasses import replace

import numpy as np

from models.estimation.joint.measures import measure_speeds
from models.estimation.joint.observations import Observations, Steps, steps_where
from models.estimation.parameters import plane_parameters_of
from models.geometry.pose import CameraPose

_TILTS_RAD = np.radians(np.arange(-12.0, 21.0, 4.0))
_MOST_STEPS = 600
_ON_GROUND = 0.98  # of the steps
_SLOWER = 1.0  # of a log: who stands says nothing of it
_ALIKE = 1.15  # the prior's tilt stays unless paces lie closer together by as much


def likely_pose(observations: Observations, prior: CameraPose) -> CameraPose:
    """The prior pose, tilted so that all walk on the ground, and at paces about alike.

    A camera that was tilted down sees people above the horizon of its prior pose, and others run.
    """
    steps = _some(observations.steps)
    if not len(steps.rows):
        return prior
    spreads = [_spread(steps, prior, float(tilt)) for tilt in _TILTS_RAD]
    still = int(np.argmin(np.abs(_TILTS_RAD)))
    best = int(np.argmin(spreads))
    if spreads[still] <= _ALIKE * spreads[best]:
        return prior
    return replace(prior, tilt_rad=_tilted(prior, float(_TILTS_RAD[best])))


def _some(steps: Steps) -> Steps:
    stride = -(-len(steps.rows) // _MOST_STEPS)
    return steps_where(steps, np.arange(len(steps.rows)) % max(stride, 1) == 0)


def _tilted(prior: CameraPose, by_rad: float) -> float:
    return float(np.clip(prior.tilt_rad + by_rad, -np.pi / 2, np.pi / 2))


def _spread(steps: Steps, prior: CameraPose, by_rad: float) -> float:
    """How far apart the log paces are at a tilt; more than any where some are above the horizon."""
    candidate = plane_parameters_of(prior)
    candidate[0] = _tilted(prior, by_rad)
    speeds = measure_speeds(steps, candidate, prior.heading_rad)
    on_ground = float(speeds.valid.mean())
    if on_ground < _ON_GROUND:
        return 10.0 + abs(by_rad) + 10 * (1 - on_ground)
    value = speeds.value[speeds.valid]
    value = value[value > np.median(value) - _SLOWER]
    return float(np.median(np.abs(value - np.median(value))))
