"""Study of heads: offset cameras with and without, and with heads that nobody measured.

Simulated street cameras, and the feet of recorded scenes (halves of people, as in the protocol)
under simulated heads: a jitter of 3 % of the stature, a lean of each person's own, people who lean
forward, a detector that puts heads to the right. `columns` are heads right above the feet in the
picture, as of trackers that make them of boxes.

    python -m studies heads --sites 6 --scenes ../shared/scenes/*/
"""

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.rotation import Array
from models.pose import learn_site, observe
from models.quantiles import Z90
from models.simulation.poses import PoseOffset
from models.tracks.scenes import load_scene
from models.tracks.trajectory import Trajectory, by_end
from studies.protocol.cases import PANNED, ProtocolCase, angle_deg, draw_case
from studies.protocol.served import served_pose
from studies.simulation.heads import HeadConfig, with_box_heads, with_heads
from studies.simulation.lanes import walk_site
from studies.simulation.simulated_site import draw_simulated_site

WAYS = ("feet", "heads", "columns")
_HEADS = HeadConfig(forward_rad=math.radians(3), bias_rad=math.radians(1))
_REFERENCE, _SEEN = 200, 60
_LEAST_SEEN = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadOutcome:
    """One case, answered one way: errors of tilt, roll (degrees) and log height (3,).

    `angle_deg` is the error of tilt and roll together, were the heading right; `covered` says which
    90 % intervals hold the truth, and `used` whether heads had a part.
    """

    place: str
    way: str
    error: tuple[float, float, float]
    angle_deg: float
    covered: tuple[bool, bool, bool]
    used: bool


def head_outcomes(case: ProtocolCase) -> Iterator[HeadOutcome]:
    """A case answered by feet alone, with heads, and with heads that nobody measured."""
    for way in WAYS:
        known, seen = (
            by_end(_headed(tracks, way, case, pose, number))
            for number, (tracks, pose) in enumerate(
                ((case.reference, case.prior_pose), (case.seen, case.true_pose))
            )
        )
        lens, prior = case.intrinsics, case.prior_pose
        site = learn_site(observe(known, lens, prior), lens, prior, chart=False)
        found = served_pose(observe(seen, lens, prior), site)
        values = found.fused.values
        error = values[:3] - plane_parameters_of(case.true_pose)
        sd = np.sqrt(np.diag(found.fused.covariance))[:3]
        pose = replace(case.true_pose, tilt_rad=float(values[0]), roll_rad=float(values[1]))
        yield HeadOutcome(
            place=case.scene_id,
            way=way,
            error=(math.degrees(error[0]), math.degrees(error[1]), float(error[2])),
            angle_deg=angle_deg(pose, case.true_pose),
            covered=tuple((np.abs(error) <= Z90 * sd).tolist()),
            used=found.joint.heads is not None,
        )


def simulated_case(seed: int) -> ProtocolCase:
    """A simulated street camera, knocked by up to 8 deg and 15 %, before 60 people."""
    rng = np.random.default_rng(seed)
    simulated = draw_simulated_site(rng)
    turns = np.radians(rng.uniform(-8, 8, 3))
    true = PoseOffset(
        tilt_rad=turns[0],
        roll_rad=turns[1],
        heading_rad=turns[2],
        log_height=rng.uniform(-0.15, 0.15),
    ).apply(simulated.prior)
    known, seen = (
        walk_site(simulated.intrinsics, pose, simulated.lanes, simulated.config, count, rng)
        for pose, count in ((simulated.prior, _REFERENCE), (true, _SEEN))
    )
    return ProtocolCase(
        scene_id="simulated",
        seed=seed,
        intrinsics=simulated.intrinsics,
        prior_pose=simulated.prior,
        true_pose=true,
        reference=tuple(known),
        seen=tuple(seen),
    )


def _headed(
    tracks: Sequence[Trajectory], way: str, case: ProtocolCase, pose: CameraPose, part: int
) -> list[Trajectory]:
    """Tracks without boxes, so that feet and heads alone are compared."""
    rng = np.random.default_rng((case.seed, part))
    seen = with_heads(tracks, case.intrinsics, pose, _HEADS, rng)
    if way == "feet":
        seen = [replace(track, head_uv=None) for track in seen]
    if way == "columns":
        seen = with_box_heads([replace(track, top_v=_head_v(track)) for track in seen])
    return [replace(track, top_v=None) for track in seen]


def _head_v(track: Trajectory) -> Array | None:
    return None if track.head_uv is None else track.head_uv[:, 1]


def _report_lines(outcomes: Sequence[HeadOutcome]) -> Iterator[str]:
    for place in sorted({outcome.place for outcome in outcomes}):
        for way in WAYS:
            each = [one for one in outcomes if (one.place, one.way) == (place, way)]
            angles = [one.angle_deg for one in each]
            heights = [abs(one.error[2]) for one in each]
            covered = 100 * np.mean([one.covered for one in each], axis=0)
            used = sum(one.used for one in each)
            yield (
                f"{place:24} {way:8} {np.median(angles):5.2f} {np.quantile(angles, 0.9):5.2f} deg, "
                f"{100 * np.median(heights):4.1f} %; 90 % intervals hold "
                f"{covered[0]:3.0f}, {covered[1]:3.0f}, {covered[2]:3.0f} %; "
                f"heads used in {used} of {len(each)}"
            )


def main(arguments: Sequence[str]) -> None:
    """Print, for each place and way, the errors' median and 90th percentile, and coverage."""
    parser = argparse.ArgumentParser("studies heads", description=__doc__)
    parser.add_argument("--sites", type=int, default=6)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--scenes", type=Path, nargs="*", default=[])
    chosen = parser.parse_args(arguments)
    cases = [simulated_case(seed) for seed in range(chosen.sites)]
    for folder in chosen.scenes:
        scene = load_scene(folder)
        drawn = (draw_case(scene, seed, PANNED) for seed in range(chosen.seeds))
        cases += [case for case in drawn if len(case.seen) >= _LEAST_SEEN]
    outcomes = [outcome for case in cases for outcome in head_outcomes(case)]
    sys.stdout.write("\n".join(_report_lines(outcomes)) + "\n")
