"""Assess a camera: has it moved, and where is it now. `assess` is the one way to that answer."""

from models.assessment.assess import DatedFactor, Monitored, assess, conclude, monitor, next_state
from models.assessment.decide import change_in, is_site_changed
from models.assessment.monitor import AlarmRate, alarm_chart_result, tracks_a_year
from models.assessment.observe import MOST_PIECES
from models.assessment.reasons import reason_of_drift
from models.assessment.scored_bytes import (
    context_from_bytes,
    context_to_bytes,
    scored_from_bytes,
    scored_to_bytes,
)
from models.assessment.scored_tracks import (
    ChartBasis,
    ScoredTracks,
    WindowContext,
    chart_basis,
    chart_of_scored,
    score_part,
    scored_window,
    tail_of,
)
from models.assessment.slow_drift import begin_slow_drift_log, log_slow_drift, without_slow_drift
from models.assessment.values import (
    NO_TIME,
    Assessment,
    AssessmentLimits,
    AssessmentState,
    CameraState,
    Decision,
    TimeSpan,
    TrackWindow,
    UnlearnedSite,
    Verdict,
)
from models.assessment.verdict import judge, may_be_alerted

__all__ = [
    "MOST_PIECES",
    "NO_TIME",
    "AlarmRate",
    "Assessment",
    "AssessmentLimits",
    "AssessmentState",
    "CameraState",
    "DatedFactor",
    "Decision",
    "Monitored",
    "TimeSpan",
    "TrackWindow",
    "UnlearnedSite",
    "Verdict",
    "alarm_chart_result",
    "assess",
    "begin_slow_drift_log",
    "change_in",
    "conclude",
    "is_site_changed",
    "judge",
    "log_slow_drift",
    "may_be_alerted",
    "monitor",
    "next_state",
    "tracks_a_year",
    "reason_of_drift",
    "without_slow_drift",
    "ChartBasis",
    "ScoredTracks",
    "WindowContext",
    "chart_basis",
    "chart_of_scored",
    "score_part",
    "scored_window",
    "tail_of",
    "context_from_bytes",
    "context_to_bytes",
    "scored_from_bytes",
    "scored_to_bytes",
]
