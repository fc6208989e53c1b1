"""Makes the starting weights: one command, one seed, some ten minutes of one core.

    python -m studies start-weights --seed 0

Each round is kept beside the weights, so that the same command goes on where it was ended.
"""

import argparse
import hashlib
import json
import platform
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from models.geometry.rotation import angle_between
from models.regression.checkpoint import START, START_FORMAT
from models.regression.network import PoseRegressor, pose_from_output
from models.serialization import to_bytes
from studies.regressors.start_training import StartPlan, StartTraining


def held_out_figures(network: PoseRegressor, plan: StartPlan) -> dict[str, Any]:
    """Median errors of single walks before cameras that no round has; `prior` is of no answer."""
    network.eval()
    off: dict[str, list[np.ndarray]] = {"off_m": [], "off_deg": [], "prior_m": [], "prior_deg": []}
    for camera, data in plan.held_out():
        with torch.inference_mode():
            output = network(data.points, data.lengths).double().numpy()
        height_m, q = pose_from_output(output, camera)
        prior, true_q = camera.prior_pose, data.quaternion.double().numpy()
        true_m = data.height_m.double().numpy()
        off["off_m"].append(np.abs(height_m - true_m))
        off["off_deg"].append(np.degrees(angle_between(q, true_q)))
        off["prior_m"].append(np.abs(prior.height_m - true_m))
        off["prior_deg"].append(np.degrees(angle_between(prior.quaternion_wxyz, true_q)))
    medians = {name: round(float(np.median(np.concatenate(of))), 2) for name, of in off.items()}
    return {"cameras": len(off["off_m"]), "walks": sum(map(len, off["off_m"])), **medians}


def store_start(network: PoseRegressor, path: Path, making: Mapping[str, Any]) -> None:
    """Write the weights in half precision, and beside them as JSON how they were made."""
    arrays = {
        name: np.asarray(value).astype(np.float16) for name, value in network.state_dict().items()
    }
    data = to_bytes(START_FORMAT, arrays)
    path.write_bytes(data)
    record = {**making, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    making_of(path).write_text(json.dumps(record, indent=2) + "\n")


def making_of(path: Path) -> Path:
    """Path of the record of how a file of weights was made."""
    return path.with_name("start.json")


def main(arguments: Sequence[str]) -> None:
    """Train, write the weights and how they were made; a line for each round."""
    parser = argparse.ArgumentParser("studies start-weights", description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=StartPlan(seed=0).rounds)
    parser.add_argument("--output", type=Path, default=START)
    chosen = parser.parse_args(arguments)
    torch.set_num_threads(1)
    plan = StartPlan(seed=chosen.seed, rounds=chosen.rounds)
    training, kept = StartTraining(plan), chosen.output.with_suffix(".training")
    if kept.exists():
        training.go_on(kept)
    while training.done < plan.rounds:
        loss = training.work_round()
        training.save(kept)
        sys.stdout.write(
            f"round {training.done} of {plan.rounds}: loss {loss:.4f}, "
            f"{training.spent_s:.0f} CPU-s\n"
        )
        sys.stdout.flush()
    making = {
        "command": f"python -m studies start-weights {' '.join(arguments)}".strip(),
        "seed": plan.seed,
        "rounds": plan.rounds,
        "walks": training.walks,
        "cpu_s": round(training.spent_s),
        "torch": torch.__version__,
        "numpy": np.__version__,
        "machine": platform.machine(),
        "held_out": held_out_figures(training.network, plan),
    }
    store_start(training.network, chosen.output, making)
    kept.unlink()
