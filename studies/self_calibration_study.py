"""Study of self-calibration: cameras of which the lens alone is known, or what somebody measured.

Recorded scenes, with boxes and by points alone, and with two marks: a vertical of 2.5 m and a
length on the ground, the longest in the picture of a hundred drawn ones, each off by 2 px.
Simulated cameras of many heights, tilts and lenses. And how many people later a knock is told by a
camera whose prior pose is the one that was proposed of its reference's people, beside one whose
true pose is known.

    python -m studies self-calibration --cameras 200 --scenes ../shared/scenes/*/
"""

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from models.errors import CalibrationError, DegenerateGeometryError
from models.geometry.ground import ground_from_pixel
from models.geometry.hints import Hint, HintKind, with_hints
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.rotation import Array
from models.pose import SelfCalibration, learn_site, observe, self_calibrate
from models.quantiles import Z90
from models.simulation.walkers import WalkConfig
from models.tracks.scenes import Scene, load_scene
from models.tracks.trajectory import Trajectory, by_end
from studies.protocol.cases import KNOCKED, angle_deg, draw_case
from studies.protocol.partings import HALVES_IN_TIME
from studies.protocol.served import served_pose
from studies.simulation.cameras import CameraRange, draw_camera
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site

_CAMERAS = CameraRange(
    height_m=(2.5, 12.0),
    tilt_rad=(math.radians(5), math.radians(50)),
    view_rad=(math.radians(60), math.radians(110)),
)
_WALK = WalkConfig()
_SITE_SD, _STATURE_SD = 0.1, 0.04  # of a log: how sites differ
_PEOPLE = (40, 300)
_MARK_PX, _MARKS_DRAWN, _MARKED_M, _POST_M = 2.0, 100, 60.0, 2.5
_MARKINGS = 6
_ALL = ("tilt", "roll", "height")
_TOLD, _PORTIONS = 0.99, (10, 20, 30, 40, 60, 80, 120)  # the probability of an alert; tracks


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationOutcome:
    """One camera: errors of tilt, roll, log height (3,) over their standard deviations, and sizes.

    `told` says whether tilt, roll and height were called identifiable.
    """

    place: str
    ratios: Array
    angle_deg: float
    height: float
    told: bool


def outcome_of(place: str, found: SelfCalibration, truth: CameraPose) -> CalibrationOutcome:
    """The outcome of a proposed pose."""
    error = found.values - plane_parameters_of(truth)
    at = CameraPose(
        height_m=truth.height_m, tilt_rad=found.pose.tilt_rad, roll_rad=found.pose.roll_rad,
        heading_rad=truth.heading_rad,
    )  # fmt: skip
    return CalibrationOutcome(
        place=place,
        ratios=error / np.sqrt(np.diag(found.covariance)),
        angle_deg=angle_deg(at, truth),
        height=math.expm1(error[2]),
        told=len(found.identifiable) == len(error),
    )


def of_scene(scene: Scene, *, boxes: bool) -> CalibrationOutcome:
    """All people of a scene, with boxes where it has some, or by points alone."""
    tracks = by_end(t.trajectory for t in scene.tracks if t.trajectory.long_enough)
    seen = tracks if boxes else [replace(track, top_v=None) for track in tracks]
    found = self_calibrate(seen, scene.intrinsics, _WALK, {})
    return outcome_of(f"{scene.scene_id}{'' if boxes else ', points'}", found, scene.true_pose)


def of_marks(scene: Scene, seed: int) -> CalibrationOutcome:
    """All people of a scene, and two marks that somebody made in its picture."""
    tracks = by_end(t.trajectory for t in scene.tracks if t.trajectory.long_enough)
    found = self_calibrate(tracks, scene.intrinsics, _WALK, {})
    marks = _marks(scene, np.concatenate([track.uv for track in tracks]), seed)
    hinted = with_hints(found.values, found.covariance, marks, scene.intrinsics)
    found = replace(found, values=hinted.values[:3], covariance=hinted.covariance[:3, :3])
    return outcome_of("marked scenes", replace(found, identifiable=_ALL), scene.true_pose)


def _marks(scene: Scene, feet: Array, seed: int) -> list[Hint]:
    rng, lens, pose = np.random.default_rng(seed), scene.intrinsics, scene.true_pose

    def seen(*places: Array) -> Array:
        uv, _ = lens.project((np.array(places) - pose.centre_m) @ pose.rotation.T)
        return uv + rng.normal(0, _MARK_PX * lens.width / 1920, uv.shape)

    drawn = feet[rng.integers(0, len(feet), (_MARKS_DRAWN, 3))]
    ground, valid = ground_from_pixel(lens, pose.rotation, pose.centre_m, drawn)
    near = (np.linalg.norm(ground - pose.centre_m[:2], axis=-1) < _MARKED_M).all(axis=1)
    across = np.where(valid.all(axis=1) & near, np.abs(drawn[:, 1, 0] - drawn[:, 2, 0]), -1.0)
    foot, one, other = ground[int(across.argmax())]
    length_m = float(np.linalg.norm(one - other))
    post = seen(np.append(foot, 0.0), np.append(foot, _POST_M))
    return [
        Hint(kind=HintKind.VERTICAL, points=post, length_m=_POST_M),
        Hint(
            kind=HintKind.LENGTH,
            points=seen(np.append(one, 0.0), np.append(other, 0.0)),
            length_m=length_m,
        ),
    ]


def of_drawn(seed: int) -> CalibrationOutcome | None:
    """A simulated camera; None where the draw sees nobody."""
    rng = np.random.default_rng(seed)
    lens, pose = draw_camera(_CAMERAS, rng)
    site = SiteConfig(
        lanes=int(rng.integers(1, 5)),
        speed_mean_mps=_WALK.speed_mean_mps * math.exp(rng.normal(0, _SITE_SD)),
        between_sd=float(rng.uniform(0.1, 0.3)),
        standing_share=float(rng.uniform(0, 0.4)),
        aside_m=float(rng.uniform(0.5, 2)),
        stature_mean_m=1.7 * math.exp(rng.normal(0, _STATURE_SD)),
        noise_px=float(rng.uniform(0.5, 4)) * lens.width / 1920,
    )
    boxes, people = bool(rng.random() < 0.5), int(rng.integers(*_PEOPLE))
    try:
        tracks = walk_site(lens, pose, draw_lanes(lens, pose, site, rng), site, people, rng)
    except DegenerateGeometryError:
        return None
    seen = tracks if boxes else [replace(track, top_v=None) for track in tracks]
    found = self_calibrate(by_end(seen), lens, _WALK, {})
    ways = "one lane" if site.lanes == 1 else "lanes"
    return outcome_of(f"simulated, {ways}, {'boxes' if boxes else 'points'}", found, pose)


def people_until_told(scene: Scene, seed: int) -> tuple[int | None, int | None]:
    """Tracks until a knock is told: by the true prior pose, and by the one that was proposed."""
    case = draw_case(scene, seed, KNOCKED, HALVES_IN_TIME)
    known = by_end(case.reference)
    proposed = self_calibrate(known, case.intrinsics, _WALK, {}).pose
    proposed = replace(proposed, heading_rad=case.prior_pose.heading_rad)
    told = [
        _told(case.intrinsics, prior, known, case.seen) for prior in (case.prior_pose, proposed)
    ]
    return told[0], told[1]


def _told(
    lens: Intrinsics, prior: CameraPose, known: Sequence[Trajectory], seen: Sequence[Trajectory]
) -> int | None:
    site = learn_site(observe(known, lens, prior), lens, prior, chart=False)
    for number in _PORTIONS:
        if number > len(seen):
            return None
        found = served_pose(observe(by_end(seen[:number]), lens, prior), site)
        if found.posterior.moved >= _TOLD:
            return number
    return None


def _report_lines(outcomes: Sequence[CalibrationOutcome]) -> Iterator[str]:
    for place in dict.fromkeys(outcome.place for outcome in outcomes):
        each = [one for one in outcomes if one.place == place]
        ratios = np.abs([one.ratios for one in each])
        told = np.array([one.told for one in each])
        held = 100 * ((ratios <= Z90) | ~told[:, None]).mean(axis=0)
        worst = ratios[told].max(initial=0.0)
        angles, heights = [one.angle_deg for one in each], [abs(one.height) for one in each]
        yield (
            f"{place:28} {len(each):3}: {np.median(angles):4.1f} ({np.quantile(angles, 0.9):4.1f}) "
            f"deg, {100 * np.median(heights):3.0f} ({100 * np.quantile(heights, 0.9):3.0f}) %; "
            f"held {held[0]:3.0f}, {held[1]:3.0f}, {held[2]:3.0f} %, worst {worst:.1f} sd; "
            f"told of {100 * told.mean():3.0f} %"
        )


def main(arguments: Sequence[str]) -> None:
    """Print errors (median, 90th percentile), what 90 % intervals hold, and people until told."""
    parser = argparse.ArgumentParser("studies self-calibration", description=__doc__)
    parser.add_argument("--cameras", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=2, help="knocks of each scene")
    parser.add_argument("--scenes", type=Path, nargs="*", default=[])
    chosen = parser.parse_args(arguments)
    scenes = [load_scene(folder) for folder in chosen.scenes]
    outcomes = [of_scene(scene, boxes=boxes) for boxes in (True, False) for scene in scenes]
    outcomes += [of_marks(scene, seed) for seed in range(_MARKINGS) for scene in scenes]
    outcomes += [found for seed in range(chosen.cameras) if (found := of_drawn(seed)) is not None]
    sys.stdout.write("\n".join(_report_lines(outcomes)) + "\n")
    for scene in scenes:
        for seed in range(chosen.seeds):
            try:
                known, proposed = people_until_told(scene, seed)
            except CalibrationError as error:
                sys.stdout.write(f"{scene.scene_id}, knock {seed}: {error}\n")
                continue
            sys.stdout.write(
                f"{scene.scene_id}, knock {seed}: told after {known} tracks by the true prior "
                f"pose, {proposed} by the proposed one\n"
            )
