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
from models.paths.path_tests import gains_along_paths, sums_by_group
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


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreContext:
    """Values of a whole window that the scores of each of its tracks depend on.

    `origin_s` is the start of a bin of time of walking groups, `busyness` (16,) that of unseen
    ground at each pose that tracks are scored at.
    """

    origin_s: float
    busyness: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackScores:
    """Scores (N, 14) of the tracks (N,) that walk, and the label (N,) of each one's group."""

    people: Index
    label: Index
    values: Array
    context: ScoreContext

    @property
    def groups(self) -> GroupScores:
        """Mean scores of the walking groups."""
        return mean_by_group(self.people, self.label, self.values)


def mean_by_group(people: Index, label: Index, values: Array) -> GroupScores:
    """Mean scores of walking groups by tracks (N,), labels (N,) and scores (N, 14) of tracks."""
    sums, number, last = sums_by_group(people, label, values)
    return GroupScores(values=sums / number[:, None], last=last)


def score_groups(
    observations: Observations, usual: Usual, walkers: Walkers | None = None
) -> GroupScores:
    """Scores of all walking groups among tracks, at the prior pose.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    return score_tracks(observations, usual, walkers=walkers).groups


def score_tracks(
    observations: Observations,
    usual: Usual,
    context: ScoreContext | None = None,
    walkers: Walkers | None = None,
) -> TrackScores:
    """Scores of tracks at the prior pose; of a part of a window by the `context` of the whole.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    check_in_time(observations)
    if walkers is None:
        origin_s = None if context is None else context.origin_s
        walkers = walkers_of(observations, array_of(usual.prior), origin_s)
    return _scored(observations, walkers, usual, np.zeros(4), 1.0, context)


def scores_at(
    observations: Observations,
    walkers: Walkers,
    usual: Usual,
    beside: Array,
    stretch: float = 1.0,
) -> Array:
    """Scores (P, 14) at a pose beside the prior: some tilt, roll, log height, heading (4,) on.

    By a clock whose times are longer by a factor `stretch`, everybody is as much slower.
    """
    return _scored(observations, walkers, usual, beside, stretch, None).groups.values


def _scored(
    observations: Observations,
    walkers: Walkers,
    usual: Usual,
    beside: Array,
    stretch: float,
    context: ScoreContext | None,
) -> TrackScores:
    at = array_of(usual.prior) + beside
    people = np.unique(walkers.steps.rows.owner_idx)
    if not people.size:
        unknown = ScoreContext(origin_s=0.0, busyness=np.full(2 * len(_STEPS), np.nan))
        return TrackScores(
            people=people,
            label=people,
            values=np.zeros((0, SCORES)),
            context=context or unknown,
        )
    parameters = plane_parameters_of(usual.prior) + beside[:3]
    observations = replace(observations, steps=_slowed(observations.steps, stretch))
    walkers = replace(walkers, steps=_slowed(walkers.steps, stretch))
    slopes = per_track(
        channels_of(observations, usual.speed_reference, usual.prior), parameters
    ).gradient
    bounded = _bounded(observations, walkers, usual, parameters)
    given = None if context is None else context.busyness
    gains, busyness = gains_along_paths(walkers, usual.paths, at, _STEPS, given)
    if context is None:
        origin_s = float(walkers.steps.rows.time_s.min())
        context = ScoreContext(origin_s=origin_s, busyness=busyness)
    return TrackScores(
        people=people,
        label=walkers.group_idx[people],
        values=np.concatenate([-slopes, bounded, gains], axis=1)[people],
        context=context,
    )


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
