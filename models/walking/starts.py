"""Where to begin: a coarse look at all poses in reach, so that one bad start cannot fool us.

Ours: at each tilt and roll of a grid, log height = usual log speed - quantile of log speed at
height 1.
"""

from collections.abc import Sequence

import numpy as np

from models.geometry.rotation import Array
from models.walking.fit import Channel
from models.walking.mixed_model import composite_log_likelihoods

_REACH_RAD = np.radians(20)
_PLACES = 11  # of each angle: 4 deg apart
_APART_RAD = np.radians(5)
_LEAST_VALID = 0.9
_SPEED_QUANTILES = (0.4, 0.6, 0.75)  # of all speeds, standing people's too, to be the usual one


def starts(channels: Sequence[Channel], centre: Array, count: int) -> list[Array]:
    """The best few poses (3,) of a grid around a centre, at least 5 deg apart, and the centre.

    For each tilt and roll of the grid the log height is that which brings a middle quantile of the
    speeds to the site's usual one. Places and directions are not looked at: this is only a start.
    """
    found = []
    offsets = np.linspace(-_REACH_RAD, _REACH_RAD, _PLACES)
    for tilt in centre[0] + offsets:
        for roll in centre[1] + offsets:
            found += _at(channels, np.array([tilt, roll, centre[2]]))
    found.sort(key=lambda pair: -pair[0])
    chosen: list[Array] = []
    for _, candidate in found:
        if len(chosen) == count:
            break
        if all(np.abs((candidate - other)[:2]).max() > _APART_RAD for other in chosen):
            chosen.append(candidate)
    return [*chosen, centre]


def _at(channels: Sequence[Channel], candidate: Array) -> list[tuple[float, Array]]:
    measures = [channel.measure(candidate=candidate, sloped=False) for channel in channels]
    speeds = measures[0]
    values = speeds.value[speeds.valid]
    if not values.size or values.size / speeds.valid.size < _LEAST_VALID:
        return []
    usual = channels[0].learned.usual
    found = []
    for quantile in _quantiles(values):
        taller = usual - quantile
        total = 0.0
        for channel, measured in zip(channels, measures, strict=True):
            learned, value = channel.learned, measured.value + taller
            residual = value - learned.usual
            each = composite_log_likelihoods(
                residual, value, measured.valid, measured.rows, learned.spread
            )
            total += float(each.sum())
        found.append((total, candidate + [0.0, 0.0, taller]))
    return found


def _quantiles(values: Array) -> list[float]:
    """The speeds' quantiles, as numpy's, which takes three times as long for so few."""
    places = np.array(_SPEED_QUANTILES) * (values.size - 1)
    found = np.interp(places, np.arange(values.size), np.sort(values))
    return [float(quantile) for quantile in found]
