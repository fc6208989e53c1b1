"""Learn a site, estimate a pose, read the alarm chart: recalibration, values in and values out.

All that these three take and give can be imported from here, and what keeps it as bytes.
"""

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.monitoring.chart import CLOCK, ChartResult, chart_from_bytes, chart_to_bytes
from models.monitoring.config import CREEP_SHARE
from models.monitoring.creep import (
    Creep,
    CreepLog,
    creep_log_from_bytes,
    creep_log_to_bytes,
    creep_result,
)
from models.monitoring.verdict import Drift, DriftLimits
from models.paths.reference import paths_from_bytes, paths_to_bytes
from models.pose.alarms import (
    AlarmRate,
    alarm_chart_result,
    begin_creep_log,
    log_creep,
    raised_by_creep,
    since_alarm,
    without_creep,
)
from models.pose.causes import Cause, reason_of_causes
from models.pose.config import FEWEST_BESIDE
from models.pose.estimating import (
    PartialFailure,
    PoseFinding,
    estimate_pose,
    unless_failed,
    with_time_of_move,
)
from models.pose.hypotheses import Hypothesis, PosePosterior, drift_of, pose_posterior
from models.pose.move_time import MovedBetween
from models.pose.picture import (
    PictureEvidence,
    drift_by_images,
    of_agreeing,
    posterior_by_picture,
    turn_by_pose,
    with_picture,
)
from models.pose.pose_fit import (
    FusedEstimate,
    Rival,
    WarmStart,
    warm_start_from_bytes,
    warm_start_to_bytes,
)
from models.pose.power import PEOPLE, smallest_told
from models.pose.self_calibration import SelfCalibration, self_calibrate
from models.pose.site import CameraSite, assume_site, learn_site
from models.pose.states import WindowState, is_site_changed, state_of
from models.simulation.walkers import WalkConfig
from models.tracks.linking import count_walks, link_pieces
from models.tracks.observations import Observations
from models.tracks.trajectory import Trajectory
from models.tracks.walks import Walks, observe, observe_walks
from models.walking.estimate import JointEstimate
from models.walking.speed_reference import SpeedReference, reference_from_bytes, reference_to_bytes

__all__ = [
    "CLOCK",
    "CREEP_SHARE",
    "FEWEST_BESIDE",
    "JointEstimate",
    "SpeedReference",
    "chart_from_bytes",
    "chart_to_bytes",
    "creep_log_from_bytes",
    "creep_log_to_bytes",
    "paths_from_bytes",
    "paths_to_bytes",
    "reference_from_bytes",
    "reference_to_bytes",
    "AlarmRate",
    "CameraPose",
    "CameraSite",
    "Creep",
    "CreepLog",
    "Drift",
    "DriftLimits",
    "FusedEstimate",
    "Intrinsics",
    "Observations",
    "PartialFailure",
    "PoseFinding",
    "MovedBetween",
    "with_time_of_move",
    "PictureEvidence",
    "of_agreeing",
    "drift_by_images",
    "turn_by_pose",
    "PosePosterior",
    "posterior_by_picture",
    "with_picture",
    "ChartResult",
    "Trajectory",
    "WalkConfig",
    "Walks",
    "WarmStart",
    "Cause",
    "reason_of_causes",
    "assume_site",
    "begin_creep_log",
    "count_walks",
    "drift_of",
    "estimate_pose",
    "learn_site",
    "link_pieces",
    "log_creep",
    "observe",
    "pose_posterior",
    "raised_by_creep",
    "Hypothesis",
    "PEOPLE",
    "Rival",
    "SelfCalibration",
    "self_calibrate",
    "since_alarm",
    "smallest_told",
    "is_site_changed",
    "state_of",
    "WindowState",
    "observe_walks",
    "alarm_chart_result",
    "creep_result",
    "warm_start_from_bytes",
    "warm_start_to_bytes",
    "unless_failed",
    "without_creep",
]
