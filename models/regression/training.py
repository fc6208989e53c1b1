"""Training of a regressor for one camera, with progress, and its check on held-out walks."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from models.errors import CalibrationError
from models.geometry.rotation import Array, Index, angle_between
from models.regression.checkpoint import starting_network
from models.regression.dataset import (
    SyntheticSet,
    equal_length_batches,
    held_out_set,
    synthetic_set,
    walks_of,
)
from models.regression.network import PoseRegressor, pose_from_output, pose_loss
from models.regression.recipe import Recipe, TrainingPlan, TrainingProgress
from models.simulation.poses import repeated_pose

_HELD_OUT_WALKS = 2000
_CENTRING_WALKS = 4000
_MUST_BEAT = 0.8  # of the error that answering the prior pose always would make


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutMetrics:
    """Errors on simulated walks of poses the training did not see, one walk at a time.

    `prior_*` are the errors of always answering the prior pose: the network has to beat them.
    """

    walks: int
    final_loss: float
    median_height_error_m: float
    median_angle_error_deg: float
    prior_height_error_m: float
    prior_angle_error_deg: float
    simulation_s: float
    training_s: float

    @property
    def passed(self) -> bool:
        """True where the network learned something from the walks."""
        return (
            math.isfinite(self.final_loss)
            and self.median_height_error_m < _MUST_BEAT * self.prior_height_error_m
            and self.median_angle_error_deg < _MUST_BEAT * self.prior_angle_error_deg
        )


class HeldOutCheckError(CalibrationError):
    """The trained network did not beat the prior pose on held-out walks."""


def train(
    plan: TrainingPlan,
    on_progress: Callable[[TrainingProgress], None] = lambda _: None,
    on_epoch: Callable[[PoseRegressor], None] = lambda _: None,
) -> tuple[PoseRegressor, HeldOutMetrics]:
    """A trained regressor and its held-out metrics; the same plan gives the same weights.

    `on_progress` is called after every step, `on_epoch` with the network as each epoch left it;
    what they raise ends the training.

    Raises:
        DegenerateGeometryError: the camera sees no ground to walk on.

    Source: Xu et al. 2020, section 4.1 (Adam 0.9, 0.999; batches; epochs).
    """
    recipe = plan.recipe
    rng = np.random.default_rng(plan.seed)
    torch.manual_seed(plan.seed)
    started = time.monotonic()
    data = synthetic_set(plan, rng)
    simulated = time.monotonic()

    network = starting_network(recipe)
    optimizer = torch.optim.Adam(network.parameters(), lr=recipe.learning_rate, betas=(0.9, 0.999))
    lengths = data.lengths.numpy()
    per_epoch = len(list(equal_length_batches(lengths, recipe.batch, np.random.default_rng(0))))
    steps = per_epoch * recipe.epochs
    rate = _schedule(recipe.schedule, steps)
    scheduler = torch.optim.lr_scheduler.LambdaLR(optimizer, rate)
    step, loss_mean = 0, math.nan
    for _ in range(recipe.epochs):
        losses: list[float] = []
        for rows in equal_length_batches(lengths, recipe.batch, rng):
            loss = batch_loss(network, data, rows, recipe)
            optimizer.zero_grad()
            torch.autograd.backward(loss)
            optimizer.step()
            scheduler.step()
            losses.append(float(loss.detach()))
            step, loss_mean = step + 1, float(np.mean(losses))
            per_step_s = (time.monotonic() - simulated) / step
            on_progress(
                TrainingProgress(
                    step=step, steps=steps, loss=loss_mean, eta_s=per_step_s * (steps - step)
                )
            )
        on_epoch(network)
    network.eval()
    if recipe.centred:
        _centre(network, plan, np.random.default_rng([plan.seed, 2]))
    held_out = held_out_set(plan, _HELD_OUT_WALKS, np.random.default_rng([plan.seed, 1]))
    return network, _metrics(
        network,
        held_out,
        plan,
        final_loss=loss_mean,
        simulation_s=simulated - started,
        training_s=time.monotonic() - simulated,
    )


def batch_loss(network: PoseRegressor, data: SyntheticSet, rows: Index, recipe: Recipe) -> Tensor:
    """The mean loss of some rows of a set, by the recipe's target and arithmetic."""
    with torch.autocast("cpu", torch.bfloat16, enabled=_in_bfloat16(recipe)):
        output = network(data.points[rows], data.lengths[rows])
    output = output.float()
    if recipe.target == "offsets":
        return nn.functional.smooth_l1_loss(output, data.offsets[rows], beta=0.5)
    return pose_loss(output, data.height_m[rows], data.quaternion[rows], recipe.alpha)


def check_held_out(metrics: HeldOutMetrics) -> None:
    """Pass silently, or refuse a network that learned nothing.

    Raises:
        HeldOutCheckError: with the errors and what they had to beat.
    """
    if not metrics.passed:
        raise HeldOutCheckError(
            f"held-out check: median errors {metrics.median_height_error_m:.2f} m and "
            f"{metrics.median_angle_error_deg:.2f} deg; needed below {_MUST_BEAT} times those of "
            f"the prior pose, {metrics.prior_height_error_m:.2f} m and "
            f"{metrics.prior_angle_error_deg:.2f} deg"
        )


def _centre(network: PoseRegressor, plan: TrainingPlan, rng: np.random.Generator) -> None:
    """Have the mean over walks seen from the prior pose be that pose, to the answers' own units.

    The best answer to one walk is off on average: what a walk leaves open reaches further to one
    side than to the other (Town Centre: 0.3 m, 0.4 deg). A mean over people would keep that.
    """
    seen = walks_of(plan, repeated_pose(plan.prior_pose, _CENTRING_WALKS), rng)
    with torch.no_grad():
        mean = network(seen.points, seen.lengths).mean(0)
        for branch, off in ((network.height, mean[:1]), (network.orientation, mean[1:])):
            branch[-1].bias -= off


def _in_bfloat16(recipe: Recipe) -> bool:
    """True where products of this recipe are of bfloat16 here; emulated, they would take longer."""
    if recipe.arithmetic != "bfloat16":
        return False
    # The oldest torch that we run on cannot be asked.
    capabilities: Mapping[str, bool] = getattr(torch.cpu, "get_capabilities", dict)()
    return bool(capabilities.get("avx512_bf16") or capabilities.get("amx_bf16"))


def _metrics(
    network: PoseRegressor,
    data: SyntheticSet,
    plan: TrainingPlan,
    *,
    final_loss: float,
    simulation_s: float,
    training_s: float,
) -> HeldOutMetrics:
    with torch.inference_mode():
        output = network(data.points, data.lengths).double().numpy()
    true_q = data.quaternion.double().numpy()
    true_height = data.height_m.double().numpy()
    height, q = pose_from_output(output, plan)
    prior = plan.prior_pose

    def angle_deg(quaternions: Array) -> float:
        return float(np.degrees(np.median(angle_between(quaternions, true_q))))

    return HeldOutMetrics(
        walks=len(data),
        final_loss=final_loss,
        median_height_error_m=float(np.median(np.abs(height - true_height))),
        median_angle_error_deg=angle_deg(q),
        prior_height_error_m=float(np.median(np.abs(prior.height_m - true_height))),
        prior_angle_error_deg=angle_deg(prior.quaternion_wxyz),
        simulation_s=simulation_s,
        training_s=training_s,
    )


def _schedule(name: str, steps: int) -> Callable[[int], float]:
    """The factor of the learning rate at each step."""
    if name == "cosine":
        return lambda step: min(1.0, (step + 1) / 50) * 0.5 * (1 + math.cos(math.pi * step / steps))
    return lambda step: 1.0
