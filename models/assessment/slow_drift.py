"""Slow drift: whole days scored against the first map and chart of a reference.

The map that estimates use grows by habits alone: the drift that is estimated so far is taken out of
the tracks that it grows by. What remains in it by mistake does not move the baseline, so the slow
drift is still found (`models.monitoring.slow_drift`).
"""

from collections.abc import Sequence

import numpy as np

from models.durations import DAY_S
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.monitoring.group_scores import score_groups
from models.monitoring.slow_drift import SlowDriftLog, add_day, begin_log, posterior_mean_turns
from models.pose import config
from models.pose.site import CameraSite
from models.simulation.poses import PoseOffset, offset_trajectory
from models.tracks.observations import Observations, of_tracks
from models.tracks.trajectory import Trajectory


def begin_slow_drift_log(first: CameraSite, to_s: float) -> SlowDriftLog | None:
    """The log of a site as it was first learned, of tracks up to a time; None without a chart."""
    if first.paths is None or first.chart is None:
        return None
    return begin_log(first.chart, to_s)


def log_slow_drift(log: SlowDriftLog, tracks: Observations, first: CameraSite) -> SlowDriftLog:
    """The log with the days of tracks that it does not have yet; these have to be whole days.

    `first` is the site as it was first learned, never grown.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    if first.paths is None or first.chart is None or not tracks.tracks:
        return log
    usual = first.usual(first.paths, first.chart)
    day_idx = np.floor(tracks.ended_s / DAY_S).astype(np.int64)
    # Each day by itself, so that it matters not which days were at hand together.
    for day in np.setdiff1d(day_idx, log.day_idx):
        scores = score_groups(of_tracks(tracks, np.flatnonzero(day_idx == day)), usual)
        log = add_day(log, first.chart, int(day), scores)
    return log


def without_slow_drift(
    tracks: Sequence[Trajectory],
    intrinsics: Intrinsics,
    prior: CameraPose,
    log: SlowDriftLog,
    from_s: float | None = None,
) -> list[Trajectory | None]:
    """Each track as it would be seen had the camera not crept; None where it would be out of sight.

    Since `from_s` the camera has moved only by slow drift.
    """
    ended_s = np.array([track.time_s[-1] for track in tracks])
    turns = posterior_mean_turns(log, ended_s / DAY_S, from_s)

    def seen(track: Trajectory, turn: Array) -> Trajectory | None:
        if np.abs(turn).max() < config.NO_TURN_RAD:
            return track
        tilt, roll, _, heading = (float(angle) for angle in turn)
        stood = PoseOffset(tilt_rad=tilt, roll_rad=roll, heading_rad=heading).apply(prior)
        return offset_trajectory(track, intrinsics, stood, prior)

    return [seen(track, turn) for track, turn in zip(tracks, turns, strict=True)]
