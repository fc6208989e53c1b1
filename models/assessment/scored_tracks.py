"""Scored tracks of a window: the monitor of a window that has a few new tracks.

`monitor` scores a whole window. Here the new tracks alone are scored, with the few tracks before
them that may belong to the same walk or walking group (`tail_of`), and join the scores that the
whole window had. Both use the same scoring and the same chart. The scores of a track depend on some
values of its whole window (`WindowContext`): these stay as they were when the whole window was
scored last.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.assessment.assess import Monitored
from models.assessment.monitor import alarm_rate_of, result_of_groups
from models.assessment.observe import MOST_PIECES
from models.assessment.values import AssessmentLimits
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Index
from models.monitoring.chart import ChartResult, DriftChart, Ratios, ratios_of
from models.monitoring.group_scores import (
    SCORES,
    ScoreContext,
    TrackScores,
    Usual,
    mean_by_group,
    score_tracks,
)
from models.pose.site import CameraSite
from models.rows import rows_of
from models.tracks.config import PIECE_GAP_S
from models.tracks.linking import LinkScale, linked
from models.tracks.trajectory import Trajectory
from models.tracks.walks import observe_walks
from models.walking.config import GROUP_BIN_S

# A link to a new track depends on its rivals, which may have ended some gaps earlier.
_TAIL_S = 3 * PIECE_GAP_S + GROUP_BIN_S


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowContext:
    """Values of a whole window that each of its tracks is linked and scored by."""

    links: LinkScale | None
    scores: ScoreContext


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoredTracks:
    """Scores of N tracks in the order of their ends.

    `key` (N,) names a track, `walk` (N,) the last piece of its walk, `group` (N,) one track of its
    walking group; `started_s` and `ended_s` (N,) are its times. `values` (N, 14) are NaN for tracks
    without a step of their own.
    """

    key: Index
    walk: Index
    group: Index
    started_s: Array
    ended_s: Array
    values: Array

    @property
    def walks(self) -> int:
        """Number of walks."""
        return int((self.walk == self.key).sum())

    def without(self, keys: Index) -> "ScoredTracks":
        """The tracks except some."""
        return rows_of(self, ~np.isin(self.key, keys))

    def merged(self, newer: "ScoredTracks") -> "ScoredTracks":
        """The tracks with those of another value added, which replace tracks of the same keys."""
        if not newer.key.size:
            return self
        older = self.without(newer.key)
        whole = ScoredTracks(
            key=np.concatenate([older.key, newer.key]),
            walk=np.concatenate([older.walk, newer.walk]),
            group=np.concatenate([older.group, newer.group]),
            started_s=np.concatenate([older.started_s, newer.started_s]),
            ended_s=np.concatenate([older.ended_s, newer.ended_s]),
            values=np.concatenate([older.values, newer.values]),
        )
        return rows_of(whole, np.lexsort((whole.started_s, whole.ended_s)))

    def newest(self, people: int, ended_from_s: float) -> "ScoredTracks":
        """The fewest newest tracks that are of so many walks; none that ended before a time.

        Five times as many tracks as walks are enough in any case.
        """
        ends_walk = (self.walk == self.key)[::-1]
        count = int(np.searchsorted(np.cumsum(ends_walk), people)) + 1
        count = min(count, MOST_PIECES * people)
        kept = self.ended_s >= ended_from_s
        kept[: max(self.key.size - count, 0)] = False
        return rows_of(self, kept)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChartBasis:
    """What tracks are scored and charted by: usual speeds and paths, the chart, its ratios."""

    intrinsics: Intrinsics
    usual: Usual
    chart: DriftChart
    ratios: Ratios


def chart_basis(site: CameraSite) -> ChartBasis | None:
    """The basis of a site; None without paths or a chart."""
    if site.paths is None or site.chart is None:
        return None
    return ChartBasis(
        intrinsics=site.intrinsics,
        usual=site.usual(site.paths, site.chart),
        chart=site.chart,
        ratios=ratios_of(site.chart),
    )


def scored_window(monitored: Monitored, keys: Index) -> ScoredTracks | None:
    """Scored tracks of a whole window, by the keys (N,) of its tracks.

    None without a chart, during a slow drift, and if some tracks came before an operator's answer:
    then the next run scores the whole window again.
    """
    scores, observed = monitored.scores, monitored.observed
    if scores is None or monitored.drifts_slowly or not observed.unanswered.all():
        return None
    times = np.array(observed.started_s), np.array(observed.ended_s)
    return _by_key(keys, observed.walk_idx, times, scores)


def tail_of(scored: ScoredTracks, started_s: float) -> Index:
    """Keys of the tracks that may belong to a walk or group of a track that started at a time.

    Walks and walking groups are in it as a whole or not at all.
    """
    chosen = scored.ended_s >= started_s - _TAIL_S
    while True:
        more = np.isin(scored.walk, scored.walk[chosen])
        more |= np.isin(scored.group, scored.group[chosen])
        if more.sum() == chosen.sum():
            return scored.key[chosen]
        chosen = more


def score_part(
    keys: Index, trajectories: Sequence[Trajectory], basis: ChartBasis, context: WindowContext
) -> ScoredTracks:
    """Scored tracks of a part of a window, by the context of the whole.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    prior = basis.usual.prior
    before = linked(trajectories, basis.intrinsics, prior, context.links).before
    walks = observe_walks(trajectories, basis.intrinsics, prior, before)
    scores = score_tracks(walks.observations, basis.usual, context.scores)
    ended_s = walks.observations.ended_s
    started_s = np.array([track.time_s[0] for track in trajectories])
    return _by_key(keys, walks.walk_idx, (started_s, ended_s), scores)


def _by_key(
    keys: Index, walk_idx: Index, times: tuple[Array, Array], scores: TrackScores
) -> ScoredTracks:
    group, values = keys.copy(), np.full((keys.size, SCORES), np.nan)
    group[scores.people], values[scores.people] = keys[scores.label], scores.values
    return ScoredTracks(
        key=keys,
        walk=keys[walk_idx],
        group=group,
        started_s=times[0],
        ended_s=times[1],
        values=values,
    )


def chart_of_scored(
    scored: ScoredTracks, basis: ChartBasis, limits: AssessmentLimits
) -> ChartResult | None:
    """Chart result of scored tracks, all after the operator's last answer; None of too few."""
    people = np.flatnonzero(np.isfinite(scored.values[:, 0]))
    groups = mean_by_group(people, scored.group[people], scored.values[people])
    rate = alarm_rate_of(limits)
    return result_of_groups(basis.chart, groups, rate, scored.key.size, basis.ratios)
