"""Posterior mean of a camera's creep by some day: what growth takes out of its tracks.

A log is taken for that of a camera that stands, or of one that creeps along one of the ramps of
`creep`, by half a degree a month, more or less. How much better the one explains it than the other,
and how rare creeps are, says how much of what a creeping camera would have turned by is believed.
So the tracks of a camera that stands are left as they are, and not bent to the noise of its first
map.

Source: Bayesian model averaging; the ratio of the marginal likelihoods of a Gaussian's mean.
"""

import numpy as np

from models.geometry.rotation import Array
from models.monitoring.creep import ANGLES, hold_to_ramps
from models.monitoring.creep_log import CreepLog

_A_MONTH_RAD = np.radians(0.5)
_MONTH_DAYS = 30.0
_CREEPING = 0.1  # of cameras


def believed_turns(log: CreepLog, days: Array, from_s: float | None = None) -> Array:
    """Tilt, roll, log height, heading (N, 4) by which a camera has turned by days (N,).

    Nothing where the log is of too few people. `from_s` as for a creep.
    """
    turns = np.zeros((len(days), 4))
    held = hold_to_ramps(log, from_s)
    if held is None:
        return turns
    months = np.maximum(held.ramps.now - held.ramps.starts, 1.0) / _MONTH_DAYS
    usual = (_A_MONTH_RAD * months) ** 2
    size = usual * held.shown / (1 + usual * held.known)
    ratio = 0.5 * (size * held.shown - np.log1p(usual * held.known))
    odds = _CREEPING / (1 - _CREEPING) / ratio.size * np.exp(np.clip(ratio, -50.0, 50.0))
    believed = odds / (1 + odds.sum())
    turns[:, ANGLES] = ((believed * size) @ held.ramps.at(np.asarray(days))).T
    return turns
