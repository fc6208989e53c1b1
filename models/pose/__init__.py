"""Learn a site, estimate a pose, read the alarm chart: recalibration, values in and values out.

All that these three take and give can be imported from here.
"""

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.monitoring.chart import ChartResult
from models.monitoring.creep import Creep, CreepLog, creep_result
from models.monitoring.verdict import Drift, DriftLimits
from models.pose.alarms import (
    AlarmRate,
    alarm_chart_result,
    begin_creep_log,
    log_creep,
    without_creep,
)
from models.pose.estimating import (
    PartialFailure,
    PoseFinding,
    SecondLook,
    drift_of,
    estimate_pose,
    unless_failed,
)
from models.pose.pose_fit import (
    FusedEstimate,
    WarmStart,
    warm_start_from_bytes,
    warm_start_to_bytes,
)
from models.pose.site import CameraSite, assume_site, learn_site
from models.simulation.walkers import WalkConfig
from models.tracks.linking import count_walks, link_pieces
from models.tracks.observations import Observations
from models.tracks.trajectory import Trajectory
from models.tracks.walks import Walks, observe, observe_walks

__all__ = [
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
    "ChartResult",
    "SecondLook",
    "Trajectory",
    "WalkConfig",
    "Walks",
    "WarmStart",
    "assume_site",
    "begin_creep_log",
    "count_walks",
    "drift_of",
    "estimate_pose",
    "learn_site",
    "link_pieces",
    "log_creep",
    "observe",
    "observe_walks",
    "alarm_chart_result",
    "creep_result",
    "warm_start_from_bytes",
    "warm_start_to_bytes",
    "unless_failed",
    "without_creep",
]
