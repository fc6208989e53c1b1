"""Makes the base model: one command, one seed, a quarter of an hour of one core.

    python -m studies base-model --seed 0

Each round is kept beside the weights, so that the same command goes on where it was ended.
"""

import argparse
import platform
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from models.geometry.rotation import Array
from models.quantiles import Z90
from studies.base_model.network import SetNetwork
from studies.base_model.sets import SimulatedSets
from studies.base_model.stored import SHIPPED, store_base_model
from studies.base_model.training import BasePlan, BaseTraining, as_tensor

_UNITS = np.array([180 / np.pi, 180 / np.pi, 100.0])  # degrees, and per cent of the height
_NEAR_RAD = 0.1
_AT_ONCE = 256


def held_out_figures(network: SetNetwork, data: SimulatedSets) -> dict[str, Any]:
    """Errors on sets: medians of leaning ahead, to the right (deg), height (%), and coverage.

    One look each, from where each set is looked at; `moved` is what they would be of no answer.
    """
    mean, sd = _answers(network, data)
    error = np.abs(mean - data.offsets)
    known = data.reference_mask.any(1)
    near = np.hypot(data.offsets[:, 0], data.offsets[:, 1]) < _NEAR_RAD
    parts = {
        "with a reference, within 6 deg": known & near,
        "with a reference, farther off": known & ~near,
        "without a reference": ~known,
    }
    return {
        name: {
            "sets": int(part.sum()),
            "off": _medians(error[part]),
            "moved": _medians(np.abs(data.offsets[part])),
            "covered": np.round((error[part] <= Z90 * sd[part]).mean(0), 2).tolist(),
        }
        for name, part in parts.items()
    }


def _answers(network: SetNetwork, data: SimulatedSets) -> tuple[Array, Array]:
    means, log_sds = [], []
    with torch.inference_mode():
        for rows in np.array_split(np.arange(len(data.offsets)), -(-len(data.offsets) // _AT_ONCE)):
            parts = (data.seen, data.seen_mask, data.reference, data.reference_mask)
            mean, log_sd, _ = network(*(as_tensor(part[rows]) for part in parts))
            means.append(mean.double().numpy())
            log_sds.append(log_sd.double().numpy())
    return np.concatenate(means), np.exp(np.concatenate(log_sds))


def _medians(errors: Array) -> list[float]:
    return [round(float(each), 2) for each in np.median(errors, axis=0) * _UNITS]


def main(arguments: Sequence[str]) -> None:
    """Train, write the weights and how they were made; a line for each round."""
    parser = argparse.ArgumentParser("studies base-model", description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=BasePlan(seed=0).rounds)
    parser.add_argument("--output", type=Path, default=SHIPPED)
    chosen = parser.parse_args(arguments)
    torch.set_num_threads(1)
    plan = BasePlan(seed=chosen.seed, rounds=chosen.rounds)
    training, kept = BaseTraining(plan), chosen.output.with_suffix(".training")
    if kept.exists():
        training.go_on(kept)
    while training.done < plan.rounds:
        loss = training.work_round()
        training.save(kept)
        sys.stdout.write(
            f"round {training.done} of {plan.rounds}: loss {loss:.3f}, "
            f"{training.spent_s:.0f} CPU-s\n"
        )
        sys.stdout.flush()
    making = {
        "command": f"python -m studies base-model {' '.join(arguments)}".strip(),
        "seed": plan.seed,
        "rounds": plan.rounds,
        "sets": 2 * plan.rounds * plan.cameras * plan.sites_each,
        "cpu_s": round(training.spent_s),
        "torch": torch.__version__,
        "numpy": np.__version__,
        "machine": platform.machine(),
        "held_out": held_out_figures(training.network, plan.held_out()),
    }
    store_base_model(training.network, chosen.output, making)
    kept.unlink()
