"""Learn a site, estimate a pose, read the alarm chart: recalibration, values in and values out.

All that these three take and give can be imported from here.
"""

from models.drift.chart import Reading
from models.drift.verdict import Drift, DriftLimits
from models.estimation.joint.observations import Observations
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.people.kinds import Kind
from models.people.linking import count_walks
from models.people.people import People, Seen, see_people
from models.recalibration.alarms import AlarmRate, read_alarm_chart
from models.recalibration.estimating import PoseFinding, SecondLook, drift_of, estimate_pose
from models.recalibration.lacks import Lack
from models.recalibration.learning import assume_site, learn_site
from models.recalibration.observing import observe
from models.recalibration.site import CameraSite
from models.simulation.walkers import WalkConfig
from models.trajectory import Trajectory

__all__ = [
    "AlarmRate",
    "CameraPose",
    "CameraSite",
    "Drift",
    "DriftLimits",
    "Intrinsics",
    "Kind",
    "Lack",
    "Observations",
    "People",
    "PoseFinding",
    "Reading",
    "SecondLook",
    "Seen",
    "Trajectory",
    "WalkConfig",
    "assume_site",
    "count_walks",
    "drift_of",
    "estimate_pose",
    "learn_site",
    "observe",
    "read_alarm_chart",
    "see_people",
]
