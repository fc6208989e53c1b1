"""Training of the set network on simulated sites."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from torch import Tensor

from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.regression.set_features import (
    FEATURES,
    MIRRORED,
    usual_speeds,
    walking,
    window_features,
)
from models.regression.set_network import SetNetwork
from models.simulation.crowds import FlowConfig
from models.simulation.flows import simulate_sites
from models.simulation.poses import PoseSet
from models.simulation.walkers import WalkConfig, Walks
from models.trajectory import Windows

SCALE = np.array([0.1, 0.1, 0.2])  # radians of tilt and roll, log height


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPlan:
    """One training of a set network: the camera, the sites, the seed.

    Poses are drawn evenly, `angle_rad` and `log_height` either side of the prior pose.
    """

    intrinsics: Intrinsics
    prior_pose: CameraPose
    walk: WalkConfig
    seed: int
    flow: FlowConfig = field(default_factory=FlowConfig)
    angle_rad: float = math.radians(18)
    log_height: float = 0.45
    near_share: float = 0.3
    prior_sd: tuple[float, float, float] = (math.radians(1.0), math.radians(1.2), 0.03)
    sites: int = 7000
    no_reference_share: float = 0.15
    people: int = 64
    fewest_people: int = 12
    epochs: int = 25
    batch: int = 64
    learning_rate: float = 0.002

    def with_epochs(self, epochs: int) -> "SetPlan":
        """The same training, so many times over its sets.

        Raises:
            ShapeError: no epoch.
        """
        if epochs < 1:
            raise ShapeError(f"epochs: must be at least 1, got {epochs}")
        return replace(self, epochs=epochs)


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedSets:
    """Sites seen twice: features (S, W, F), masks of the windows (S, W), true offsets (S, 3).

    `offsets` are tilt, roll, log height of the second look from the prior pose; `reference` is the
    first look, at the prior pose.
    """

    seen: Array
    seen_mask: Mask
    reference: Array
    reference_mask: Mask
    offsets: Array


def simulated_sets(plan: SetPlan, sites: int, rng: np.random.Generator) -> SimulatedSets:
    """Sites seen from the prior pose and again from poses around it."""
    offsets = rng.uniform(-1, 1, (sites, 3)) * (plan.angle_rad, plan.angle_rad, plan.log_height)
    offsets[::2] *= plan.near_share  # where the estimate ends, it has to be sharp
    # The prior pose is what the site says it is: both looks share how far it is off.
    wrong = rng.normal(0, 1, (sites, 3)) * plan.prior_sd
    views = [_around(plan.prior_pose, wrong), _around(plan.prior_pose, wrong + offsets)]
    first, second = simulate_sites(plan.intrinsics, views, plan.people, plan.flow, plan.walk, rng)
    assumed = np.full(sites, plan.walk.speed_mean_mps)
    reference, there = _padded(plan, first, assumed)
    # As many as the site gave while its pose was known; some sites gave none.
    known = np.exp(rng.uniform(math.log(plan.fewest_people), math.log(plan.people), (sites, 1)))
    known[rng.random(sites) < plan.no_reference_share] = 0
    there &= np.arange(plan.people) < known
    speed = usual_speeds(reference, there, plan.walk.speed_mean_mps)
    reference, _ = _padded(plan, first, speed)
    seen, seen_there = _padded(plan, second, speed)
    seen_there &= walking(seen, seen_there)
    there &= walking(reference, there)
    enough = seen_there.sum(1) >= plan.fewest_people // 2
    return SimulatedSets(
        seen=seen[enough],
        seen_mask=seen_there[enough],
        reference=reference[enough],
        reference_mask=there[enough],
        offsets=offsets[enough],
    )


def _around(prior: CameraPose, offsets: Array) -> PoseSet:
    """The poses that are offsets (S, 3) of tilt, roll, log height away from the prior pose."""
    return PoseSet(
        height_m=prior.height_m * np.exp(offsets[:, 2]),
        tilt_rad=np.clip(prior.tilt_rad + offsets[:, 0], -math.pi / 2, math.pi / 2),
        roll_rad=prior.roll_rad + offsets[:, 1],
        heading_rad=prior.heading_rad,
        x_m=prior.x_m,
        y_m=prior.y_m,
    )


def _padded(plan: SetPlan, walks: Walks, speed_mps: Array) -> tuple[Array, Mask]:
    """Features (S, W, F) of walks by site, for each site's speed (S,), and which are there."""
    rows = window_features(
        Windows(uv=walks.uv, lengths=walks.lengths, owner_idx=walks.pose_idx),
        plan.intrinsics,
        plan.prior_pose,
        plan.prior_pose,
        speed_mps[walks.pose_idx],
        plan.walk.step_s,
    )
    features = np.zeros((speed_mps.size, plan.people, FEATURES), dtype=np.float64)
    there = np.zeros((speed_mps.size, plan.people), dtype=np.bool_)
    place = np.arange(len(walks)) - np.searchsorted(walks.pose_idx, walks.pose_idx)
    features[walks.pose_idx, place] = rows
    there[walks.pose_idx, place] = True
    return features, there


def train_set(plan: SetPlan, on_progress: Callable[[float], None] = lambda _: None) -> SetNetwork:
    """A trained set network; the same plan gives the same weights."""
    rng = np.random.default_rng([plan.seed, 2])
    torch.manual_seed(plan.seed)
    data = simulated_sets(plan, plan.sites, rng)
    seen, seen_mask = _tensor(data.seen), _tensor(data.seen_mask)
    ref, ref_mask = _tensor(data.reference), _tensor(data.reference_mask)
    truth = _tensor(data.offsets / SCALE)
    # A site in the mirror is a site, rolled the other way.
    sides = torch.ones(2, FEATURES)
    sides[1, list(MIRRORED)] = -1
    turns = torch.tensor([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])
    network = SetNetwork()
    there = seen[seen_mask > 0]
    network.centre.copy_(there.mean(0))
    network.spread.copy_(there.std(0) + 1e-3)
    optimizer = torch.optim.AdamW(network.parameters(), lr=plan.learning_rate, weight_decay=0.01)
    per_epoch = math.ceil(len(truth) / plan.batch)
    steps = per_epoch * plan.epochs
    rate = torch.optim.lr_scheduler.LambdaLR(
        optimizer,
        lambda step: min(1.0, (step + 1) / 50) * 0.5 * (1 + math.cos(math.pi * step / steps)),
    )
    step = 0
    for _ in range(plan.epochs):
        for rows in np.array_split(rng.permutation(len(truth)), per_epoch):
            people = int(math.exp(rng.uniform(math.log(plan.fewest_people), math.log(plan.people))))
            columns = rng.permutation(plan.people)[:people]
            mirror = rng.random() < 0.5
            mean, log_sd = network(
                seen[rows][:, columns] * sides[int(mirror)],
                seen_mask[rows][:, columns],
                ref[rows] * sides[int(mirror)],
                ref_mask[rows],
            )
            loss = gaussian_loss(mean, log_sd, truth[rows] * turns[int(mirror)])
            optimizer.zero_grad()
            torch.autograd.backward(loss)
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimizer.step()
            rate.step()
            step += 1
            on_progress(step / steps)
    network.eval()
    return network


def _tensor(array: Array | Mask) -> Tensor:
    return torch.from_numpy(array.astype(np.float32))


def gaussian_loss(mean: Tensor, log_sd: Tensor, truth: Tensor) -> Tensor:
    """Mean negative log likelihood of the truth (S, 3) under independent normal answers."""
    z = (truth - mean) * torch.exp(-log_sd)
    loss: Tensor = (0.5 * torch.square(z) + log_sd).mean()
    return loss
