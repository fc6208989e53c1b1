"""Configuration of a training, and the place of its weights; without torch, for other processes."""

import time
from collections.abc import Collection
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from models.durations import HOUR_S
from models.errors import CheckpointError, ShapeError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.simulation.poses import PoseRange
from models.simulation.walkers import WalkConfig

RecipeName = Literal["default", "paper"]
Inputs = Literal["points", "points_and_steps", "levelled"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """Everything about a training but the camera and the seed.

    `poses` tells whether they lie on the paper's grid or are drawn evenly over its range;
    `inputs`, whether the network reads points, points and the steps between them, or these and what
    they would be at the prior pose; `start`, whether its first weights are drawn, or have been
    learned on other cameras; `target`, whether it answers a raw height and quaternion, with the
    paper's loss, or offsets from the prior pose in units of the range; `schedule`, whether the
    learning rate stays or falls to 0 by a half cosine after a short rise; `arithmetic`, whether
    products may be of bfloat16, which is done where the processor multiplies such numbers itself;
    `centred`, whether offsets are taken off at the end by which walks seen from the prior pose are
    answered on average.
    """

    name: RecipeName
    poses: Literal["grid", "random"]
    random_poses: int = 0
    walks_per_pose: int = 10
    inputs: Inputs
    start: Literal["fresh", "pretrained"] = "fresh"
    target: Literal["pose", "offsets"]
    noise_px: float = 0.0
    learning_rate: float
    schedule: Literal["constant", "cosine"]
    arithmetic: Literal["float32", "bfloat16"] = "float32"
    batch: int
    epochs: int
    alpha: float = 1.0
    centred: bool = False
    spread: PoseRange = field(default_factory=PoseRange)


# Xu et al. 2020, section 4.1. The scale of the input is not printed: see `network.scale_points`.
PAPER = Recipe(
    name="paper",
    poses="grid",
    inputs="points",
    target="pose",
    learning_rate=0.01,
    schedule="constant",
    batch=1024,
    epochs=50,
)

# The same network, walkers and range. It begins at weights that have seen 4,096 other cameras, and
# reads walks as they would be if this one stood at its prior pose: so it has learned in seconds
# what the paper's takes ten minutes for.
DEFAULT = Recipe(
    name="default",
    poses="random",
    random_poses=4096,
    inputs="levelled",
    start="pretrained",
    target="offsets",
    noise_px=1.0,
    learning_rate=0.001,
    schedule="cosine",
    arithmetic="bfloat16",
    batch=256,
    epochs=1,
    centred=True,
)

RECIPES: dict[str, Recipe] = {recipe.name: recipe for recipe in (DEFAULT, PAPER)}


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingPlan:
    """One training: this camera, this recipe, these walkers, this seed."""

    intrinsics: Intrinsics
    prior_pose: CameraPose
    recipe: Recipe
    walk: WalkConfig
    seed: int


def plan_training(
    *,
    intrinsics: Intrinsics,
    prior_pose: CameraPose,
    recipe_name: str,
    walk: WalkConfig,
    seed: int,
    epochs: int | None = None,
) -> TrainingPlan:
    """The plan of a named recipe, with its number of epochs replaced where one is given.

    Raises:
        ShapeError: there is no recipe of that name, or no epoch.
    """
    if recipe_name not in RECIPES:
        raise ShapeError(f"recipe: one of {sorted(RECIPES)} is needed, got {recipe_name!r}")
    recipe = RECIPES[recipe_name]
    if epochs is not None:
        if epochs < 1:
            raise ShapeError(f"epochs: must be at least 1, got {epochs}")
        recipe = replace(recipe, epochs=epochs)
    return TrainingPlan(
        intrinsics=intrinsics, prior_pose=prior_pose, recipe=recipe, walk=walk, seed=seed
    )


def plan_to_config(plan: TrainingPlan) -> dict[str, Any]:
    """The plan as JSON, to be kept beside the weights."""
    return asdict(plan)


def plan_from_config(config: dict[str, Any]) -> TrainingPlan:
    """The plan of `plan_to_config`.

    Raises:
        CheckpointError: a field is missing or unknown: another version wrote it.
    """
    try:
        lens, recipe = config["intrinsics"], config["recipe"]
        return TrainingPlan(
            intrinsics=Intrinsics(**{**lens, "distortion": tuple(lens["distortion"])}),
            prior_pose=CameraPose(**config["prior_pose"]),
            recipe=Recipe(**{**recipe, "spread": PoseRange(**recipe["spread"])}),
            walk=WalkConfig(**config["walk"]),
            seed=config["seed"],
        )
    except (KeyError, TypeError) as error:
        raise CheckpointError(f"config: not of this version: {error}") from error


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingProgress:
    """Progress of a training; `loss` is the mean over the last epoch so far."""

    step: int
    steps: int
    loss: float
    eta_s: float


def weights_path(folder: Path, digest: str) -> Path:
    """The file in a folder for weights with this SHA-256."""
    # A name alone: what a database or an archive says leads out of no folder.
    return folder / f"{Path(digest).name}.safetensors"


def unused_weights(folder: Path, used: Collection[str]) -> list[Path]:
    """Files of weights that nobody uses, by their SHA-256, and that are not being written now."""
    written_before_s = time.time() - HOUR_S
    return [
        path
        for path in folder.glob("*")
        if path.name.split(".")[0] not in used and path.stat().st_mtime < written_before_s
    ]
