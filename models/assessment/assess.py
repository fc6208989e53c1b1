"""The conductor: has the camera moved, and where is it now?

Five stages in a row, a file each: observe (tracks to measurements), monitor (drift chart and slow
drift), estimate (pose by speeds, paths, modes, change and factors), decide (state, alarm, cause,
time) and explain (reasons). The service, `surefoot.estimate` and the studies call `assess`, so the
same tracks get the same answer everywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from models.assessment.decide import change_in, decide
from models.assessment.estimate import detectable_moves, raised_by_slow_drift, since_alarm
from models.assessment.explain import explain
from models.assessment.monitor import Charted, chart_of, slow_drift_of
from models.assessment.observe import observe_window
from models.assessment.values import (
    FIRST_STATE,
    Assessment,
    AssessmentLimits,
    AssessmentState,
    CameraState,
    Observed,
    TrackWindow,
    UnlearnedSite,
)
from models.errors import TooFewTrajectoriesError
from models.monitoring.chart import ChartResult
from models.monitoring.group_scores import TrackScores
from models.monitoring.slow_drift import SlowDrift
from models.pose.estimating import (
    PartialFailure,
    PoseFinding,
    estimate_pose,
    unless_failed,
    with_time_of_move,
)
from models.pose.factors import Factor
from models.pose.pose_fit import WarmStart
from models.pose.site import CameraSite, assume_site
from models.reasons import Reason
from models.walking.config import FEWEST_WALKERS

MAP = "flow_map"  # if this part fails, the site has no map of paths
_LATER = 0.25  # of the tracks: so many may have come after a momentary factor that still counts
_USUAL_LIMITS = AssessmentLimits()


@dataclass(frozen=True, slots=True, kw_only=True)
class DatedFactor:
    """A factor of one moment, with the reason that goes with it, if any.

    It counts while at most a quarter of the tracks ended later: a move since then would hardly show
    in so few, while a move after which more people came must not wait for the next image.
    """

    factor: Factor
    at_s: float
    reason: Reason | None = None

    def counts(self, ended_s: Sequence[float]) -> bool:
        """True if it is new enough beside tracks that ended at such times."""
        return sum(each > self.at_s for each in ended_s) <= _LATER * len(ended_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Monitored:
    """Results of the first two stages: measurements, the drift chart and the slow drift.

    `site` is the one to estimate by: with the first map of paths if the camera drifts slowly.
    `mapped` is whether it has a map of paths. The chart was made of `scores`; None without a
    chart.
    """

    observed: Observed
    site: CameraSite
    mapped: bool
    chart: ChartResult | None
    slow_drift: SlowDrift | None
    scores: TrackScores | None = None
    failures: tuple[PartialFailure, ...] = ()

    @property
    def suspicious(self) -> bool:
        """True if the chart is above its watch level, which is below its alarm level."""
        return self.chart is not None and self.chart.suspicious

    @property
    def drifts_slowly(self) -> bool:
        """True if the slow drift is beyond its level."""
        return self.slow_drift is not None and self.slow_drift.moved


def monitor(
    window: TrackWindow,
    site: CameraSite | UnlearnedSite,
    limits: AssessmentLimits = _USUAL_LIMITS,
    failures: Sequence[PartialFailure] = (),
) -> Monitored:
    """Observe and monitor a window: the cheap half of an assessment.

    Raises:
        TooFewTrajectoriesError: fewer than five people walk.
        ShapeError: tracks that are not in the order of their ends.
    """
    failed = list(failures)
    observed = observe_window(window, site.intrinsics, site.prior, limits.drift.people)
    if observed.tracks.walkers < FEWEST_WALKERS:
        raise TooFewTrajectoriesError(
            f"tracks: at least {FEWEST_WALKERS} people who walk are needed, "
            f"got {observed.tracks.walkers}"
        )
    if isinstance(site, UnlearnedSite):
        site = assume_site(observed.tracks, site.intrinsics, site.prior, site.walk)
    mapped = site.paths is not None or any(each.part == MAP for each in failed)
    slow_drift = unless_failed(failed, "anchor", partial(slow_drift_of, site, limits.alarms_a_year))
    if slow_drift is not None and slow_drift.moved and site.baseline is not None:
        site = replace(site, paths=site.baseline.paths, chart=site.baseline.chart)
    charted = _chart(observed, site, limits, 0, failed)
    return Monitored(
        observed=observed,
        site=site,
        mapped=mapped,
        chart=None if charted is None else charted.result,
        slow_drift=slow_drift,
        scores=None if charted is None else charted.scores,
        failures=tuple(failed),
    )


def assess(
    window: TrackWindow | Monitored,
    site: CameraSite | UnlearnedSite,
    state: AssessmentState = FIRST_STATE,
    limits: AssessmentLimits = _USUAL_LIMITS,
    factors: Sequence[DatedFactor] = (),
    failures: Sequence[PartialFailure] = (),
) -> Assessment:
    """Assess a camera by the tracks of a window, in the order of their ends.

    A window that was `monitor`ed by the same limits is not observed again. `state` is what the
    assessment before left. `failures` are of parts that could not be read: without a part that is
    not needed, the rest goes on.

    Raises:
        TooFewTrajectoriesError: fewer than five people walk.
        ShapeError: tracks that are not in the order of their ends.
    """
    if not isinstance(window, Monitored):
        window = monitor(window, site, limits, failures)
    observed, site, chart = window.observed, window.site, window.chart
    failed, drifts_slowly = list(window.failures), window.drifts_slowly
    begin = begin_at(state.warm_start, suspicious=window.suspicious, drifts_slowly=drifts_slowly)

    found = estimate_pose(observed.tracks, site, begin, alerted=state.alerted)
    failed.extend(found.failures)
    moved_prior = limits.moved_prior
    if drifts_slowly:
        moved_prior = raised_by_slow_drift(moved_prior, observed.tracks, limits.alarms_a_year)
    warm_start = found.warm_start
    if warm_start is not None:
        warm_start = replace(warm_start, charted=window.suspicious, drifts_slowly=drifts_slowly)
    found = replace(found, moved_prior=moved_prior, warm_start=warm_start)
    if found.first:
        charted = _chart(observed, site, limits, found.first, failed)
        chart = None if charted is None else charted.result
    alarmed = partial(since_alarm, found, observed.tracks, site, chart)
    found = unless_failed(failed, "chart", alarmed) or found
    counting = _counting(factors, observed, found, chart)
    moved_by_tracks = found.posterior.moved if counting else None
    if counting:
        # The chart, which may have raised the prior, is evidence of the same move.
        parts = tuple(each.factor for each in counting)
        found = replace(found, moved_prior=moved_prior, factors=parts)
    timed = partial(with_time_of_move, found, observed.tracks, site)
    found = unless_failed(failed, "time of the move", timed) or found
    assessment = conclude(
        observed,
        found,
        chart,
        window.slow_drift,
        mapped=window.mapped,
        state=state,
        limits=limits,
        factors=counting,
    )
    return replace(
        assessment,
        moved_by_tracks=moved_by_tracks,
        detectable=detectable_moves(found, site),
        failures=tuple(failed),
    )


def conclude(
    observed: Observed,
    found: PoseFinding,
    chart: ChartResult | None = None,
    slow_drift: SlowDrift | None = None,
    *,
    mapped: bool,
    state: AssessmentState = FIRST_STATE,
    limits: AssessmentLimits = _USUAL_LIMITS,
    factors: Sequence[DatedFactor] = (),
) -> Assessment:
    """Decide and explain, the last two stages. `assess` calls it, and tests of decisions do."""
    decision = decide(observed, found, chart, slow_drift, mapped=mapped, state=state, limits=limits)
    by_factors = [each.reason for each in factors if each.reason and found.posterior.pictured]
    return Assessment(
        observed=observed,
        chart=chart,
        slow_drift=slow_drift,
        estimated=found,
        decision=decision,
        reasons=explain(
            observed,
            found,
            chart,
            slow_drift,
            decision,
            state=state,
            limits=limits,
            by_factors=tuple(by_factors),
        ),
        factors=tuple(each.factor.name for each in factors),
    )


def next_state(state: AssessmentState, found: Assessment) -> AssessmentState:
    """The state for the next assessment of a camera, if no operator answers in between."""
    decision = found.decision
    return replace(
        state,
        drifted=decision.verdict.drifted,
        alerted=decision.verdict.drifting,
        unsure=decision.state == CameraState.UNSURE,
        change=change_in(found.observed, found.estimated) or state.change,
        moved_at=decision.moved_at,
        assessed_until_s=found.observed.ended_s[-1],
        warm_start=found.warm_start,
    )


def _chart(
    observed: Observed,
    site: CameraSite,
    limits: AssessmentLimits,
    first_idx: int,
    failed: list[PartialFailure],
) -> Charted | None:
    return unless_failed(failed, "chart", partial(chart_of, observed, site, limits, first_idx))


def begin_at(
    warm_start: WarmStart | None, *, suspicious: bool, drifts_slowly: bool
) -> WarmStart | None:
    """Where a search may begin; None if the one before was made on another basis.

    The basis is whether the chart is `suspicious`, and whether the first map is in use because the
    camera `drifts_slowly`.
    """
    if warm_start is None or warm_start.charted != suspicious:
        return None
    return warm_start if warm_start.drifts_slowly == drifts_slowly else None


def _counting(
    factors: Sequence[DatedFactor],
    observed: Observed,
    found: PoseFinding,
    chart: ChartResult | None,
) -> list[DatedFactor]:
    """The factors that count beside all tracks that the pose may be estimated by."""
    first = found.first
    if chart is not None and chart.moved:
        first = max(first, chart.track_idx)
    return [each for each in factors if each.counts(observed.ended_s[first:])]
