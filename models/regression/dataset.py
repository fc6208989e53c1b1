"""The synthetic set of one camera: simulated walks with the poses that saw them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from models.geometry.rotation import Index, quaternion_from_rotation
from models.regression.network import network_inputs, offsets_of
from models.regression.recipe import TrainingPlan
from models.simulation.poses import PoseSet, grid_poses, random_poses
from models.simulation.walkers import simulate_walks


@dataclass(frozen=True, slots=True, kw_only=True)
class SyntheticSet:
    """Scaled foot points (B, T, C), lengths (B,) and what the walks were seen from.

    Heights (B,) are in metres, quaternions wxyz (B, 4); `offsets` (B, 3) are `offsets_of`'s.
    """

    points: Tensor
    lengths: Tensor
    height_m: Tensor
    quaternion: Tensor
    offsets: Tensor

    def __len__(self) -> int:
        return int(self.lengths.numel())


def synthetic_set(plan: TrainingPlan, rng: np.random.Generator) -> SyntheticSet:
    """The training set of a plan: some walks for each pose of the recipe.

    Raises:
        DegenerateGeometryError: no pose around the prior sees enough ground.
    """
    recipe = plan.recipe
    if recipe.poses == "grid":
        poses = grid_poses(plan.prior_pose, recipe.spread)
    else:
        poses = random_poses(plan.prior_pose, recipe.spread, recipe.random_poses, rng)
    return walks_of(plan, poses.take(np.repeat(np.arange(len(poses)), recipe.walks_per_pose)), rng)


def held_out_set(plan: TrainingPlan, count: int, rng: np.random.Generator) -> SyntheticSet:
    """Walks seen from poses drawn evenly over the plan's range, none of them on its grid."""
    poses = random_poses(plan.prior_pose, plan.recipe.spread, count, rng)
    return walks_of(plan, poses, rng)


def equal_length_batches(lengths: Index, size: int, rng: np.random.Generator) -> Iterator[Index]:
    """Indices of shuffled batches whose rows all have the same number of points.

    Rows of one length need no padding, which halves the time of a step on a CPU.
    """
    batches: list[Index] = []
    for length in np.unique(lengths):
        rows = rng.permutation(np.flatnonzero(lengths == length))
        batches += np.array_split(rows, max(1, round(rows.size / size)))
    for place in rng.permutation(len(batches)):
        yield batches[place]


def walks_of(plan: TrainingPlan, poses: PoseSet, rng: np.random.Generator) -> SyntheticSet:
    """A simulated walk for each of some poses, as the plan's network reads it."""
    walks = simulate_walks(plan.intrinsics, poses, plan.walk, rng)
    uv = walks.uv
    if plan.recipe.noise_px:
        uv = uv + rng.normal(0, plan.recipe.noise_px, uv.shape)
    seen_by = poses.take(walks.pose_idx)
    quaternion = quaternion_from_rotation(seen_by.rotation)
    offsets = offsets_of(seen_by.height_m, seen_by.tilt_rad, seen_by.roll_rad, plan)
    return SyntheticSet(
        points=network_inputs(uv, plan),
        lengths=torch.from_numpy(walks.lengths),
        height_m=torch.from_numpy(seen_by.height_m.astype(np.float32)),
        quaternion=torch.from_numpy(quaternion.astype(np.float32)),
        offsets=torch.from_numpy(offsets.astype(np.float32)),
    )
