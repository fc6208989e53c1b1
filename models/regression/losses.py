"""What a batch costs a network by a recipe."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from models.regression.dataset import SyntheticSet
from models.regression.network import PoseRegressor, pose_loss
from models.regression.recipe import Recipe


def batch_loss(
    network: PoseRegressor, data: SyntheticSet, rows: npt.NDArray[np.int64], recipe: Recipe
) -> Tensor:
    """The mean loss of some rows of a set, by the recipe's target and arithmetic."""
    with torch.autocast("cpu", torch.bfloat16, enabled=in_bfloat16(recipe)):
        output = network(data.points[rows], data.lengths[rows])
    output = output.float()
    if recipe.target == "offsets":
        return nn.functional.smooth_l1_loss(output, data.offsets[rows], beta=0.5)
    return pose_loss(output, data.height_m[rows], data.quaternion[rows], recipe.alpha)


def loss_on(network: PoseRegressor, data: SyntheticSet, recipe: Recipe) -> float:
    """The mean loss of a whole set, which nothing is learned of."""
    with torch.inference_mode():
        return float(batch_loss(network, data, np.arange(len(data)), recipe))


def in_bfloat16(recipe: Recipe) -> bool:
    """Whether products of this recipe are of bfloat16 here; emulated, they would take longer."""
    if recipe.arithmetic != "bfloat16":
        return False
    # The oldest torch that we run on cannot be asked.
    capabilities: Mapping[str, bool] = getattr(torch.cpu, "get_capabilities", dict)()
    return bool(capabilities.get("avx512_bf16") or capabilities.get("amx_bf16"))
