"""Input and output values of an assessment.

Times are seconds since the Unix epoch, angles are radians. Arrays of N entries are by track, in the
order of the tracks' ends.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Index, Mask
from models.monitoring.chart import ChartResult
from models.monitoring.drift import Drift, DriftLimits
from models.monitoring.slow_drift import SlowDrift
from models.pose import config
from models.pose.estimating import PartialFailure, PoseFinding
from models.pose.hypotheses import PosePosterior
from models.pose.pose_fit import WarmStart
from models.reasons import Reason
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations
from models.tracks.trajectory import Trajectory


class CameraState(StrEnum):
    """State of a camera as far as evidence decides it.

    `learning`: too little is known to call the camera stationary. `suspected`: more likely moved
    than not, without an alarm. `unsure`: people walk elsewhere, and the cause is unknown.
    """

    LEARNING = "learning"
    OK = "ok"
    SUSPECTED = "suspected"
    UNSURE = "unsure"
    DRIFTING = "drifting"


class TimeSpan(NamedTuple):
    """The time of a move: after the one, which may be unknown, and before the other."""

    after_s: float | None
    before_s: float | None


NO_TIME = TimeSpan(None, None)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackWindow:
    """The tracks of an assessment.

    `unanswered` (N,) marks tracks that came after an operator's last answer; None means all.
    `before` (N,) is the piece before each track of a walk, as from `link_pieces`; None where the
    pieces were not linked yet.
    """

    trajectories: Sequence[Trajectory]
    unanswered: Mask | None = None
    before: Index | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class UnlearnedSite:
    """A camera at its prior pose before its people are known: a walking speed is assumed."""

    intrinsics: Intrinsics
    prior: CameraPose
    walk: WalkConfig = field(default_factory=WalkConfig)


@dataclass(frozen=True, slots=True, kw_only=True)
class AssessmentLimits:
    """What an alarm depends on.

    `alarms_a_year` are the false alarms allowed, `tracks_a_year` the tracks that come in a year,
    `moved_prior` is the probability of a move before any track. `frame_rate_hz` is named in reasons
    about the clock.
    """

    drift: DriftLimits = field(default_factory=DriftLimits)
    alarms_a_year: float = 1.0
    tracks_a_year: float = 1e5
    moved_prior: float = config.MOVED_PRIOR
    frame_rate_hz: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AssessmentState:
    """What one assessment leaves to the next, with the operators' answers since.

    `drifted` names the parameters beyond their limits since the drift began, `moved_at` is the
    time of that move. `alerted` and `unsure` are whether an alert reports a move, or unused
    paths. `false_alarm` is whether the operator's last answer was "false alarm". `change` is the
    newest change point of the reference. The camera is known to be stationary until
    `stationary_until_s`; the window of the last assessment ended at `assessed_until_s`. `doubts`
    are about the reference. `warm_start` is where the search may begin.
    """

    drifted: tuple[str, ...] = ()
    alerted: bool = False
    unsure: bool = False
    false_alarm: bool = False
    change: TimeSpan | None = None
    moved_at: TimeSpan | None = None
    stationary_until_s: float = 0.0
    assessed_until_s: float | None = None
    doubts: tuple[Reason, ...] = ()
    warm_start: WarmStart | None = None


FIRST_STATE = AssessmentState()


@dataclass(frozen=True, slots=True, kw_only=True)
class Observed:
    """Measurements of a window.

    `walk_idx` (N,) is the last piece of the walk of each track. `pieces` is the reason that names a
    tracker which cuts walks; None where it cuts few. `enough` is whether enough people came since
    the operator's last answer.
    """

    tracks: Observations
    ended_s: tuple[float, ...]
    started_s: tuple[float, ...]
    unanswered: Mask
    walk_idx: Index
    pieces: Reason | None
    enough: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Verdict on a window.

    `streak` is 1 where the window is beyond the limits, -1 where it is below `clear_ratio`.
    `excess` is the largest identifiable drift in units of its limit: 1 and more is beyond.
    `drifted` names the parameters that have been beyond since the drift began; empty where there is
    none. `alarmed` is whether the chart, which the pose confirms, or the slow drift is beyond its
    level.
    """

    streak: int = 0
    excess: float = 0.0
    drifted: tuple[str, ...] = ()
    alarmed: bool = False

    @property
    def drifting(self) -> bool:
        """True while the camera counts as moved."""
        return bool(self.drifted)


NO_VERDICT = Verdict()


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """The conclusion from the evidence.

    `cause` is the reason of a wrong clock or another lens, which explain the tracks instead of a
    move. `moved_at` is the time of the move, as far as it is known.
    """

    state: CameraState
    verdict: Verdict = NO_VERDICT
    cause: Reason | None = None
    moved_at: TimeSpan = NO_TIME


@dataclass(frozen=True, slots=True, kw_only=True)
class Assessment:
    """All that is known of a camera by a window of tracks and other evidence.

    `estimated` is the pose from the newest change on; tracks count from `estimated.first` on.
    `moved_by_tracks` is the probability of a move before factors had their part; None where none
    had. `detectable` (4, 3) are the smallest moves that 60, 250 and 800 people would reveal; None
    of a site that is not learned. `reasons` come in the order of their weight. `failures` are the
    parts that could not be made.
    """

    observed: Observed
    chart: ChartResult | None
    slow_drift: SlowDrift | None
    estimated: PoseFinding
    decision: Decision
    reasons: tuple[Reason, ...]
    factors: tuple[str, ...] = ()
    moved_by_tracks: float | None = None
    detectable: Array | None = None
    failures: tuple[PartialFailure, ...] = ()

    @property
    def state(self) -> CameraState:
        """The camera's state."""
        return self.decision.state

    @property
    def drift(self) -> Drift:
        """Pose less prior pose."""
        return self.estimated.drift

    @property
    def posterior(self) -> PosePosterior:
        """The posterior over what moved."""
        return self.estimated.posterior

    @property
    def warm_start(self) -> WarmStart | None:
        """Where the next assessment's search may begin."""
        return self.estimated.warm_start
