"""Training of the starting weights: rounds of cameras never seen before, each simulated anew."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch

from models.errors import DegenerateGeometryError
from models.regression.dataset import SyntheticSet, equal_length_batches, walks_of
from models.regression.network import network_for
from models.regression.recipe import DEFAULT, TrainingPlan
from models.regression.training import batch_loss
from models.simulation.poses import random_poses
from models.simulation.walkers import WalkConfig
from studies.regressors.resumable import resume_training, save_training
from studies.simulation.cameras import CameraRange, draw_camera

_RISE = 0.3  # rounds until the learning rate is whole
_HELD_OUT = 1_000_000  # the number of the round that nobody trains on
_USUAL_SHARE = 0.7  # of cameras, at the usual sampling step


@dataclass(frozen=True, slots=True, kw_only=True)
class StartPlan:
    """Plan of a training of starting weights: what is drawn, for how long, and the seed.

    People walk at a mean pace between `speed_mean_mps`, which each camera knows, and differ by a
    standard deviation between `speed_sd_mps`, which none does.
    """

    seed: int
    rounds: int = 32
    cameras: int = 128
    walks_each: int = 320
    batch: int = 128
    learning_rate: float = 0.002
    camera: CameraRange = field(default_factory=CameraRange)
    speed_mean_mps: tuple[float, float] = (1.1, 1.6)
    speed_sd_mps: tuple[float, float] = (0.05, 0.2)
    step_s: tuple[float, float] = (0.15, 0.4)

    def sets(self, number: int) -> Iterator[tuple[TrainingPlan, SyntheticSet]]:
        """The cameras of a round, by its number, with the walks that they see."""
        rng = np.random.default_rng([self.seed, number])
        for _ in range(self.cameras):
            plan = self._draw_plan(rng)
            poses = random_poses(plan.prior_pose, plan.recipe.spread, self.walks_each, rng)
            try:
                yield plan, walks_of(plan, poses, rng)
            except DegenerateGeometryError:
                continue  # its moves leave it no ground

    def held_out(self) -> Iterator[tuple[TrainingPlan, SyntheticSet]]:
        """Cameras that no round has."""
        return self.sets(_HELD_OUT)

    def _draw_plan(self, rng: np.random.Generator) -> TrainingPlan:
        lens, pose = draw_camera(self.camera, rng)
        usual = rng.random() < _USUAL_SHARE
        walk = WalkConfig(
            speed_mean_mps=rng.uniform(*self.speed_mean_mps),
            speed_sd_mps=rng.uniform(*self.speed_sd_mps),
            step_s=self.step_s[1] if usual else rng.uniform(*self.step_s),
        )
        return TrainingPlan(
            intrinsics=lens, prior_pose=pose, recipe=DEFAULT, walk=walk, seed=self.seed
        )


class StartTraining:
    """A training that is done round by round; the same plan comes to the same weights.

    `network` is as far as `done` rounds have brought it, in `spent_s` of CPU, over `walks`. Nothing
    is drawn that a seed and the number of a round do not make again, so that it goes on where it
    was saved.
    """

    def __init__(self, plan: StartPlan) -> None:
        torch.manual_seed(plan.seed)
        self.plan = plan
        self.done, self.walks, self.spent_s = 0, 0, 0.0
        self.network = network_for(DEFAULT)
        self._optimizer = torch.optim.Adam(self.network.parameters(), lr=plan.learning_rate)

    def work_round(self) -> float:
        """The next round; its mean loss."""
        began_s = time.process_time()
        data = joined([seen for _, seen in self.plan.sets(self.done)])
        rng = np.random.default_rng([self.plan.seed, self.done, 1])
        batches = list(equal_length_batches(data.lengths.numpy(), self.plan.batch, rng))
        losses = []
        for step, rows in enumerate(batches):
            self._set_rate(self.done + step / len(batches))
            loss = batch_loss(self.network, data, rows, DEFAULT)
            self._optimizer.zero_grad()
            torch.autograd.backward(loss)
            self._optimizer.step()
            losses.append(float(loss.detach()))
        self.done += 1
        self.walks += len(data)
        self.spent_s += time.process_time() - began_s
        return float(np.mean(losses))

    def save(self, path: Path) -> None:
        """Write what a later process needs to go on, whole or not at all."""
        so_far = {"done": self.done, "walks": self.walks, "spent_s": self.spent_s}
        save_training(path, self.network, self._optimizer, so_far)

    def go_on(self, path: Path) -> None:
        """Take over what `save` wrote of a training of the same plan.

        Raises:
            CheckpointError: the file is damaged or of another network.
        """
        state = resume_training(path, self.network, self._optimizer)
        self.done, self.walks, self.spent_s = state["done"], state["walks"], state["spent_s"]

    def _set_rate(self, rounds: float) -> None:
        falling = 0.5 * (1 + math.cos(math.pi * rounds / self.plan.rounds))
        for group in self._optimizer.param_groups:
            group["lr"] = self.plan.learning_rate * min(1.0, rounds / _RISE + 0.01) * falling


def joined(sets: list[SyntheticSet]) -> SyntheticSet:
    """Several cameras' walks as one set."""
    return SyntheticSet(
        points=torch.cat([each.points for each in sets]),
        lengths=torch.cat([each.lengths for each in sets]),
        height_m=torch.cat([each.height_m for each in sets]),
        quaternion=torch.cat([each.quaternion for each in sets]),
        offsets=torch.cat([each.offsets for each in sets]),
    )
