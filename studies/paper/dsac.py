"""Table 2: DSAC++ on pictures of single walks, and the same with places that are known.

The second says that what fails is not the search for a pose: given where in the world each patch
lies, it is exact.
"""

from collections.abc import Sequence
from pathlib import Path
from statistics import mean, median

import numpy as np

from models.errors import CalibrationError
from models.geometry.pose import CameraPose, pose_from_matrices
from models.regression.recipe import TrainingPlan
from models.simulation.poses import repeated_pose
from models.tracks.scenes import load_scene
from models.tracks.trajectory import cut_windows
from studies.baselines.differentiable_ransac import best_pose, rotation_of_turn
from studies.baselines.posenet import draw_walks
from studies.baselines.scene_coordinates import (
    mean_places_off,
    patch_pixels,
    patch_set,
    patches_of,
    pose_seen,
    train_end_to_end,
    train_places,
)
from studies.paper.measures import centred_plan
from studies.paper.part import (
    Figures,
    OnShare,
    PaperCase,
    PaperPart,
    PaperResult,
    markdown,
)
from studies.protocol.cases import angle_deg

_PUBLISHED = {"town_centre": "12.99, 123.97"}
_PICTURES, _HELD_OUT, _END_TO_END = 2000, 300, 500
_EPOCHS = 6
_HYPOTHESES = 64
_ALPHA = 1.0


def _cases(scenes: Sequence[str]) -> list[PaperCase]:
    return [PaperCase(part="dsac", scene=scene, variant="DSAC++", seed=0) for scene in scenes]


def _run(case: PaperCase, folder: Path, on_share: OnShare) -> Figures:
    scene = load_scene(folder)
    tracks = [track.trajectory for track in scene.tracks]
    plan = centred_plan(scene, "paper", case.seed)
    rng = np.random.default_rng(case.seed)
    data, held_out = patch_set(plan, _PICTURES, rng), patch_set(plan, _HELD_OUT, rng)
    few = patch_set(plan, _END_TO_END, rng)
    untrained = train_places(data, epochs=0, seed=case.seed)
    network = train_places(
        data, epochs=_EPOCHS, seed=case.seed, on_share=lambda share: on_share(0.5 * share)
    )
    figures = {
        "mean_place_off_m": mean_places_off(untrained, held_out),
        "place_off_m": mean_places_off(network, held_out),
    }
    train_end_to_end(
        network,
        few,
        plan.intrinsics,
        alpha=_ALPHA,
        seed=case.seed,
        on_share=lambda share: on_share(0.5 + 0.5 * share),
    )
    truth = scene.true_pose
    images = draw_walks(cut_windows(tracks, plan.intrinsics, plan.walk.step_s).uv, plan.intrinsics)
    below = (truth.x_m, truth.y_m)
    poses = []
    for image in images:
        try:
            poses.append(pose_seen(network, image, plan.intrinsics, below, rng, _HYPOTHESES))
        except CalibrationError:  # no pose, or one below the ground: counted, and told
            continue
    figures |= {"windows": float(len(images)), "posed": float(len(poses))}
    if poses:
        figures |= {
            "location_m": mean(_away_m(pose, truth) for pose in poses),
            "median_location_m": median(_away_m(pose, truth) for pose in poses),
            "deg": mean(angle_deg(pose, truth) for pose in poses),
            "median_deg": median(angle_deg(pose, truth) for pose in poses),
        }
    return figures | _known(plan, truth, rng)


def _known(plan: TrainingPlan, truth: CameraPose, rng: np.random.Generator) -> Figures:
    """The errors of the pose of a picture whose places are known."""
    rows = round(plan.intrinsics.height * 96 / plan.intrinsics.width)
    image = np.zeros((1, rows, 96), np.uint8)
    data = patches_of(plan.intrinsics, image, repeated_pose(truth, 1))
    seen = data.on_ground[0].numpy()
    rays, _ = plan.intrinsics.rays(patch_pixels(plan.intrinsics, image)[seen])
    places = data.places_m[0].double().numpy()[seen] + (truth.x_m, truth.y_m, 0.0)
    pose = best_pose(places, rays[:, :2], _HYPOTHESES, rng)
    found = pose_from_matrices(rotation_of_turn(pose[:3]), pose[3:])
    return {"known_location_m": _away_m(found, truth), "known_deg": angle_deg(found, truth)}


def _away_m(pose: CameraPose, truth: CameraPose) -> float:
    return float(np.linalg.norm(pose.centre_m - truth.centre_m))


def _table(results: Sequence[PaperResult]) -> str:
    rows = []
    for each in sorted(results, key=lambda one: one.case.scene):
        found = each.figures

        def pair(one: str, other: str, digits: int, found: Figures = found) -> str:
            if one not in found:
                return "no pose"
            return f"{found[one]:.{digits}f}, {found[other]:.{digits}f}"

        rows.append(
            [
                each.case.scene,
                pair("location_m", "deg", 1),
                _PUBLISHED.get(each.case.scene, ""),
                pair("median_location_m", "median_deg", 1),
                f"{found['posed']:.0f} of {found['windows']:.0f}",
                pair("place_off_m", "mean_place_off_m", 1),
                pair("known_location_m", "known_deg", 2),
            ]
        )
    header = [
        "scene",
        "mean: off m, deg",
        "published",
        "median: off m, deg",
        "walks with a pose above ground",
        "places off, and always the mean place, m",
        "with places known: off m, deg",
    ]
    return markdown(header, rows)


DSAC = PaperPart(
    says="table 2: scene coordinates of pictures of single walks, and a pose by RANSAC",
    cases=_cases,
    run=_run,
    made_by=lambda _: (
        "studies.baselines.differentiable_ransac",
        "studies.baselines.scene_coordinates",
        "studies.baselines.posenet",
    ),
    table=_table,
)
