"""What a regressor says on average of a camera that has not moved, taken off its answers."""

import numpy as np
import torch

from models.regression.dataset import walks_of
from models.regression.network import PoseRegressor
from models.regression.recipe import TrainingPlan
from models.simulation.poses import repeated_pose

_WALKS = 4000


def centre(network: PoseRegressor, plan: TrainingPlan, rng: np.random.Generator) -> None:
    """Have the mean over walks seen from the prior pose be that pose, to the answers' own units.

    The best answer to one walk is off on average: what a walk leaves open reaches further to one
    side than to the other (Town Centre: 0.3 m, 0.4 deg). A mean over people would keep that.
    """
    seen = walks_of(plan, repeated_pose(plan.prior_pose, _WALKS), rng)
    with torch.no_grad():
        mean = network(seen.points, seen.lengths).mean(0)
        for branch, off in ((network.height, mean[:1]), (network.orientation, mean[1:])):
            branch[-1].bias -= off
