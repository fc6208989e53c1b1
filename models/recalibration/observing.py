"""What is read of tracks: of the walkers among them alone, and of each once."""

from collections.abc import Sequence

from models.estimation.joint.observations import Observations
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.people.people import see_people
from models.trajectory import Trajectory


def observe(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, prior: CameraPose
) -> Observations:
    """The steps and boxes of the walkers among tracks, as `see_people` sorts them."""
    return see_people(trajectories, intrinsics, prior).observations
