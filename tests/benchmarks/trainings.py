"""What a training costs and comes to: `python -m tests.benchmarks.trainings [--seeds 3]`.

By each recipe, for the camera of the tests, one after the other in one process with one thread:
seconds of CPU, simulation and check included, and median errors of single walks that were held out.
The paper's exact recipe takes a quarter of an hour; `--only default` goes without it. Exits with 1
where the default one costs more than 30 CPU-seconds, or a tenth of the paper's.
"""

import argparse
import json
import math
import sys
import time

import torch

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.regression.recipe import RECIPES, plan_training
from models.regression.training import train
from models.simulation.walkers import WalkConfig

_LIMIT_S, _LIMIT_SHARE = 30.0, 0.1
_LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
_POSE = CameraPose(
    height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1), heading_rad=math.radians(40)
)


def main() -> int:
    """Train, and print a line of JSON for each training; 1 where the default one costs too much."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seeds", type=int, default=3)
    asked.add_argument("--only", choices=sorted(RECIPES))
    wanted = asked.parse_args()
    torch.set_num_threads(1)
    spent: dict[str, list[float]] = {}
    for name in [wanted.only] if wanted.only else sorted(RECIPES):
        for seed in range(1 if name == "paper" else wanted.seeds):
            plan = plan_training(
                intrinsics=_LENS, prior_pose=_POSE, recipe_name=name, walk=WalkConfig(), seed=seed
            )
            begun_s = time.process_time()
            _, metrics = train(plan)
            cpu_s = time.process_time() - begun_s
            spent.setdefault(name, []).append(cpu_s)
            said = {
                "recipe": name,
                "seed": seed,
                "cpu_s": round(cpu_s, 1),
                "simulation_s": round(metrics.simulation_s, 1),
                "off_m": round(metrics.median_height_error_m, 3),
                "off_deg": round(metrics.median_angle_error_deg, 2),
                "prior_m": round(metrics.prior_height_error_m, 2),
                "prior_deg": round(metrics.prior_angle_error_deg, 2),
            }
            sys.stdout.write(json.dumps(said) + "\n")
            sys.stdout.flush()
    most_s = max(spent.get("default", [0.0]))
    too_much = most_s > _LIMIT_S or most_s > _LIMIT_SHARE * max(spent.get("paper", [math.inf]))
    return 1 if too_much else 0


if __name__ == "__main__":
    sys.exit(main())
