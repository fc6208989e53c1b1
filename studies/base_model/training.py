"""Training of the base model: rounds of cameras never seen before, each simulated anew."""

import math
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from models.geometry.rotation import Array, Mask
from studies.base_model.features import FEATURES, MIRRORED
from studies.base_model.network import SetNetwork, bent
from studies.base_model.sets import (
    FEWEST_SEGMENTS,
    SimulatedSets,
    SiteRange,
    simulated_sets,
)
from studies.regressors.resumable import resume_training, save_training
from studies.simulation.cameras import CameraRange

_DEGREES_OF_FREEDOM = 5.0
_SHARE_OF_EQUATIONS = 0.3  # of the loss: their answer is right before it is corrected
_LEAST_LOG_SD = -4.0  # of the equations' answer
_WEIGHT_DECAY = 0.01
_RISE = 0.5  # rounds until the learning rate is whole
_HELD_OUT = 1_000_000  # the number of the round that nobody trains on


@dataclass(frozen=True, slots=True, kw_only=True)
class BasePlan:
    """One training of the base model: what is drawn, for how long, and the seed."""

    seed: int
    rounds: int = 30
    cameras: int = 32
    sites_each: int = 32
    people: int = 96
    passes: int = 6
    batch: int = 64
    learning_rate: float = 0.002
    camera: CameraRange = field(default_factory=CameraRange)
    site: SiteRange = field(default_factory=SiteRange)

    def sets(self, number: int) -> SimulatedSets:
        """The sets of a round, by its number."""
        return simulated_sets(
            self.camera,
            self.site,
            count=self.cameras,
            sites_each=self.sites_each,
            people=self.people,
            rng=np.random.default_rng([self.seed, number]),
        )

    def held_out(self) -> SimulatedSets:
        """Sets of as many cameras as a round's, which no round has."""
        return self.sets(_HELD_OUT)


class BaseTraining:
    """A training that is done round by round; the same plan comes to the same weights.

    `network` is as far as `done` rounds have brought it, in `spent_s` of CPU. Nothing is drawn that
    a seed and the number of a round do not make again, so that it goes on where it was saved.
    """

    def __init__(self, plan: BasePlan) -> None:
        torch.manual_seed(plan.seed)
        self.plan = plan
        self.done = 0
        self.spent_s = 0.0
        self.network = SetNetwork()
        self._optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=plan.learning_rate, weight_decay=_WEIGHT_DECAY
        )

    def work_round(self) -> float:
        """The next round; its mean loss."""
        began_s = time.process_time()
        plan, data = self.plan, self.plan.sets(self.done)
        rng = np.random.default_rng([plan.seed, self.done, 1])
        if not self.done:
            _take_scale(self.network, data)
        self.network.train()
        losses = []
        steps = plan.passes * math.ceil(len(data.offsets) / plan.batch)
        batches = [
            rows
            for _ in range(plan.passes)
            for rows in np.array_split(rng.permutation(len(data.offsets)), steps // plan.passes)
        ]
        for step, rows in enumerate(batches):
            self._set_rate(self.done + step / steps)
            loss = _loss(self.network, data, rows, rng)
            self._optimizer.zero_grad()
            torch.autograd.backward(loss)
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
            self._optimizer.step()
            losses.append(float(loss.detach()))
        self.done += 1
        self.spent_s += time.process_time() - began_s
        self.network.eval()
        return float(np.mean(losses))

    def save(self, path: Path) -> None:
        """Write what a later process needs to go on, whole or not at all."""
        so_far = {"done": self.done, "spent_s": self.spent_s}
        save_training(path, self.network, self._optimizer, so_far)

    def go_on(self, path: Path) -> None:
        """Take over what `save` wrote of a training of the same plan.

        Raises:
            CheckpointError: the file is damaged or of another network.
        """
        state = resume_training(path, self.network, self._optimizer)
        self.done, self.spent_s = state["done"], state["spent_s"]

    def _set_rate(self, rounds: float) -> None:
        """The learning rate rises for half a round and falls to 0 by a half cosine."""
        share = rounds / self.plan.rounds
        factor = min(1.0, 0.02 + rounds / _RISE) * 0.5 * (1 + math.cos(math.pi * share))
        for group in self._optimizer.param_groups:
            group["lr"] = self.plan.learning_rate * factor


def _loss(
    network: SetNetwork,
    data: SimulatedSets,
    rows: npt.NDArray[np.int64],
    rng: np.random.Generator,
) -> Tensor:
    """The loss of some sets: as many people as is drawn, in the mirror every other time."""
    people = data.seen.shape[1]
    # Many more often than few.
    count = round(FEWEST_SEGMENTS * (people / FEWEST_SEGMENTS) ** math.sqrt(rng.random()))
    columns = np.sort(rng.permutation(people)[:count])
    # A site in the mirror is a site, and the camera leans the other way.
    sides, lean = torch.ones(FEATURES), torch.ones(3)
    if rng.random() < 0.5:
        sides[list(MIRRORED)], lean[1] = -1, -1
    mean, log_sd, solved = network(
        as_tensor(data.seen[rows][:, columns]) * sides,
        as_tensor(data.seen_mask[rows][:, columns]),
        as_tensor(data.reference[rows]) * sides,
        as_tensor(data.reference_mask[rows]),
    )
    truth = as_tensor(data.offsets[rows]) * lean
    first = student_loss(solved, log_sd.detach().clamp(min=_LEAST_LOG_SD), truth)
    return student_loss(mean, log_sd, truth) + _SHARE_OF_EQUATIONS * first


def student_loss(mean: Tensor, log_sd: Tensor, truth: Tensor) -> Tensor:
    """Mean negative log likelihood of the truth (S, 3) under independent Student-t answers.

    Of 5 degrees of freedom, less a constant: what nobody can tell must not outweigh the rest.
    """
    z = (truth - mean) * torch.exp(-log_sd)
    tail = 0.5 * (_DEGREES_OF_FREEDOM + 1) * torch.log1p(torch.square(z) / _DEGREES_OF_FREEDOM)
    loss: Tensor = (tail + log_sd).mean()
    return loss


def _take_scale(network: SetNetwork, data: SimulatedSets) -> None:
    """Set the features' centre and spread to those of the first round."""
    read = bent(as_tensor(data.seen[data.seen_mask]))
    network.centre.copy_(read.mean(0))
    network.spread.copy_(read.std(0) + 1e-3)


def as_tensor(array: Array | Mask) -> Tensor:
    """An array of any numbers as float32."""
    return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32))
