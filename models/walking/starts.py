"""Starts of the fit: a coarse look at all poses in reach, so that one bad start cannot fool us.

Ours: at each tilt and roll of a grid, log height = usual log speed - quantile of log speed at
height 1.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.geometry.rotation import Array
from models.walking import config
from models.walking.fit import Channel
from models.walking.mixed.model import composite_log_likelihoods


def starts(channels: Sequence[Channel], centre: Array, count: int) -> list[Array]:
    """The best few poses (3,) of a grid around a centre, at least 5 deg apart, and the centre.

    For each tilt and roll of the grid the log height is that which brings a middle quantile of the
    speeds to the site's usual one. Places and directions are not looked at: this is only a start.
    """
    found = []
    offsets = np.linspace(-config.START_REACH_RAD, config.START_REACH_RAD, config.START_PLACES)
    for tilt in centre[0] + offsets:
        for roll in centre[1] + offsets:
            found += _at(channels, np.array([tilt, roll, centre[2]]))
    found.sort(key=lambda pair: -pair[0])
    chosen: list[Array] = []
    for _, candidate in found:
        if len(chosen) == count:
            break
        apart = [np.abs((candidate - other)[:2]).max() for other in chosen]
        if all(far > config.START_DISTANCE_RAD for far in apart):
            chosen.append(candidate)
    return [*chosen, centre]


def _at(channels: Sequence[Channel], candidate: Array) -> list[tuple[float, Array]]:
    measures = [channel.measure(candidate=candidate, sloped=False) for channel in channels]
    speeds = measures[0]
    values = speeds.value[speeds.valid]
    if not values.size or values.size / speeds.valid.size < config.START_VALID:
        return []
    usual = channels[0].learned.usual
    found = []
    for quantile in _quantiles(values):
        taller = usual - quantile
        total = 0.0
        for channel, measured in zip(channels, measures, strict=True):
            moved = replace(measured, value=measured.value + taller)
            residual = moved.value - channel.learned.usual
            each = composite_log_likelihoods(residual, moved, channel.learned.components)
            total += float(each.sum())
        found.append((total, candidate + [0.0, 0.0, taller]))
    return found


def _quantiles(values: Array) -> list[float]:
    """The speeds' quantiles, as numpy's, which takes three times as long for so few."""
    places = np.array(config.START_QUANTILES) * (values.size - 1)
    found = np.interp(places, np.arange(values.size), np.sort(values))
    return [float(quantile) for quantile in found]
