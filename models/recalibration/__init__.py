"""Learn a site, estimate a pose, read the alarm chart: recalibration, values in and values out.

All that these three take and give can be imported from here.
"""

from models.drift.chart import Reading
from models.drift.creep import Creep, read_creep
from models.drift.creep_log import CreepLog
from models.drift.verdict import Drift, DriftLimits
from models.estimation.joint.observations import Observations
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.people.linking import count_walks, link_pieces
from models.people.walks import Walks, observe, observe_walks
from models.recalibration.alarms import AlarmRate, read_alarm_chart
from models.recalibration.anchoring import begin_creep_log, log_creep, without_creep
from models.recalibration.doubts import LastPose
from models.recalibration.estimating import PoseFinding, SecondLook, drift_of, estimate_pose
from models.recalibration.lacks import Lack
from models.recalibration.learning import assume_site, learn_site
from models.recalibration.packing import last_pose_from_bytes, last_pose_to_bytes
from models.recalibration.site import CameraSite
from models.simulation.walkers import WalkConfig
from models.trajectory import Trajectory

__all__ = [
    "AlarmRate",
    "CameraPose",
    "CameraSite",
    "Creep",
    "CreepLog",
    "Drift",
    "DriftLimits",
    "Intrinsics",
    "Lack",
    "LastPose",
    "Observations",
    "PoseFinding",
    "Reading",
    "SecondLook",
    "Trajectory",
    "WalkConfig",
    "Walks",
    "assume_site",
    "begin_creep_log",
    "count_walks",
    "drift_of",
    "estimate_pose",
    "last_pose_from_bytes",
    "last_pose_to_bytes",
    "learn_site",
    "link_pieces",
    "log_creep",
    "observe",
    "observe_walks",
    "read_alarm_chart",
    "read_creep",
    "without_creep",
]
