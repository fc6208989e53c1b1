"""Learn a site and estimate a pose: values in, values out, and their form as bytes."""

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.monitoring.chart import CLOCK, ChartResult, chart_from_bytes, chart_to_bytes
from models.monitoring.drift import Drift, DriftLimits
from models.monitoring.slow_drift import (
    SlowDrift,
    SlowDriftLog,
    slow_drift_log_from_bytes,
    slow_drift_log_to_bytes,
)
from models.paths.reference import paths_from_bytes, paths_to_bytes
from models.pose.causes import Cause
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
    Alternative,
    FusedEstimate,
    WarmStart,
    warm_start_from_bytes,
    warm_start_to_bytes,
)
from models.pose.power import PEOPLE, smallest_told
from models.pose.self_calibration import SelfCalibration, self_calibrate
from models.pose.site import Baseline, CameraSite, assume_site, learn_site
from models.simulation.walkers import WalkConfig
from models.tracks.linking import LinkScale, count_walks, linked
from models.tracks.observations import Observations
from models.tracks.trajectory import Trajectory
from models.tracks.walks import Walks, observe, observe_walks
from models.walking.estimate import JointEstimate
from models.walking.speed_reference import SpeedReference, reference_from_bytes, reference_to_bytes

__all__ = [
    "CLOCK",
    "FEWEST_BESIDE",
    "JointEstimate",
    "LinkScale",
    "SpeedReference",
    "chart_from_bytes",
    "chart_to_bytes",
    "slow_drift_log_from_bytes",
    "slow_drift_log_to_bytes",
    "paths_from_bytes",
    "paths_to_bytes",
    "reference_from_bytes",
    "reference_to_bytes",
    "CameraPose",
    "Baseline",
    "CameraSite",
    "SlowDrift",
    "SlowDriftLog",
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
    "assume_site",
    "count_walks",
    "drift_of",
    "estimate_pose",
    "learn_site",
    "linked",
    "observe",
    "pose_posterior",
    "Hypothesis",
    "PEOPLE",
    "Alternative",
    "SelfCalibration",
    "self_calibrate",
    "smallest_told",
    "observe_walks",
    "warm_start_from_bytes",
    "warm_start_to_bytes",
    "unless_failed",
]
