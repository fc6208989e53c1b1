"""Scores of a walking group for small moves of a camera: by how people walk, and where.

Each walking group has fourteen scores. Three are slopes of the joint estimator's likelihood along
tilt, roll and log height: sharp, but who walks far too slowly counts as someone who stands, so that
it says little after a large move. Three more are the same without that: how far off a pace is, held
within bounds. Eight are how much likelier their places and ways were a little further on than a
little back, along tilt, roll, log height and heading, by a large step and by a small one. What of
these tells a move, and how well, is learned of the site (`chart_learning`). The method:
`docs/method/monitoring.md`.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.geometry.pose import CameraPose, array_of, plane_parameters_of
from models.geometry.rotation import Array, Index
from models.monitoring import config
from models.paths.config import REACH
from models.paths.likelihood import PathModel, Walkers, walkers_of
from models.paths.path_tests import along_paths, groups_in_time, sums_of_groups
from models.tracks.observations import Observations, Steps, check_in_time
from models.walking.field import Learned
from models.walking.fit import per_track
from models.walking.measures import Measured, measure_speeds, measure_statures
from models.walking.speed_reference import SpeedReference, channels_of

SCORES = 14
_STEPS = np.concatenate([share * np.diag(REACH) for share in config.STEP_SHARES])


@dataclass(frozen=True, slots=True, kw_only=True)
class Usual:
    """Usual speeds and paths before a camera, seen from the prior pose."""

    prior: CameraPose
    speed_reference: SpeedReference
    paths: PathModel


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupScores:
    """Scores (P, 14) of walking groups in the order of their last tracks (P,)."""

    values: Array
    last: Index


def score_groups(
    observations: Observations, usual: Usual, walkers: Walkers | None = None
) -> GroupScores:
    """The scores of all walking groups among tracks, at the prior pose.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    check_in_time(observations)
    if walkers is None:
        walkers = walkers_of(observations, array_of(usual.prior))
    _, _, last = groups_in_time(walkers)
    return GroupScores(values=scores_at(observations, walkers, usual, np.zeros(4)), last=last)


def scores_at(
    observations: Observations,
    walkers: Walkers,
    usual: Usual,
    beside: Array,
    stretch: float = 1.0,
) -> Array:
    """Scores (P, 14) at a pose beside the prior: some tilt, roll, log height, heading (4,) on.

    By a clock whose times are longer by a factor, everybody is as much slower.
    """
    at = array_of(usual.prior) + beside
    if not walkers.people:
        return np.zeros((0, SCORES))
    parameters = plane_parameters_of(usual.prior) + beside[:3]
    observations = replace(observations, steps=_slowed(observations.steps, stretch))
    walkers = replace(walkers, steps=_slowed(walkers.steps, stretch))
    slopes = per_track(
        channels_of(observations, usual.speed_reference, usual.prior), parameters
    ).gradient
    scores = np.concatenate(
        [
            -slopes,
            _bounded(observations, walkers, usual, parameters),
            along_paths(walkers, usual.paths, at, _STEPS),
        ],
        axis=1,
    )
    sums, people, _ = sums_of_groups(walkers, scores)
    return np.asarray(sums / people[:, None])


def _slowed(steps: Steps, stretch: float) -> Steps:
    return replace(steps, seconds=steps.seconds * stretch)


def _bounded(
    observations: Observations, walkers: Walkers, usual: Usual, parameters: Array
) -> Array:
    """Weighted residuals of paces, and of statures where boxes have them, bounded."""
    heading, speed_reference = usual.prior.heading_rad, usual.speed_reference
    speeds = measure_speeds(walkers.steps, parameters, heading)
    scores = _off(speeds, speed_reference.speeds, walkers.tracks) / config.PACE_SD**2
    if speed_reference.statures is not None:
        tops = measure_statures(observations.tops, parameters, heading)
        scores = (
            scores + _off(tops, speed_reference.statures, walkers.tracks) / config.STATURE_SD**2
        )
    return scores


def _off(measured: Measured, learned: Learned, tracks: int) -> Array:
    """Mean (tracks, 3) of what is measured less what is usual, times its slopes by the pose."""
    features = learned.field.features(measured)
    residual = np.where(measured.valid, measured.value - features @ learned.mean, 0.0)
    slopes = measured.d_value - learned.field.slopes(measured, features, learned.mean)
    pull = -np.clip(residual, -config.LARGEST_RESIDUAL, config.LARGEST_RESIDUAL)[:, None] * slopes
    sums = np.zeros((tracks, 3))
    np.add.at(sums, measured.rows.owner_idx, pull * measured.valid[:, None])
    number = np.bincount(measured.rows.owner_idx, measured.valid, tracks)
    return np.asarray(sums / np.maximum(number, 1)[:, None])
