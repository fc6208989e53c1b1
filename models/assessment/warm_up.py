"""One of everything before a simulated camera, so that all it needs is compiled, as installed.

python -m models.assessment.warm_up
"""

import math
from dataclasses import replace

import numpy as np

from models.assessment.monitor import AlarmRate, alarm_chart_result
from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.upright import tops_seen
from models.pose.estimating import PoseFinding, estimate_pose
from models.pose.site import learn_site
from models.simulation.poses import PoseOffset, offset_trajectory, repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.tracks.trajectory import Trajectory
from models.tracks.walks import observe

_LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
_PRIOR = CameraPose(height_m=6.0, tilt_rad=math.radians(18), roll_rad=math.radians(1))
_KNOCK = PoseOffset(tilt_rad=math.radians(5), roll_rad=math.radians(-4))
_PEOPLE, _BETWEEN_S = 60, 20.0
_STATURE_M, _STATURE_SD = 1.72, 0.04
_WALK = WalkConfig(min_points=20)
_RATE = AlarmRate(alarms_a_year=1.0, tracks_a_year=10_000.0)


def warm_up(seed: int = 0) -> PoseFinding:
    """Learn a site, knock its camera, estimate its pose and read its chart, by the same people."""
    known = _people(np.random.default_rng(seed))
    site = learn_site(observe(known, _LENS, _PRIOR), _LENS, _PRIOR, _WALK, seed=seed)
    moved = _KNOCK.apply(_PRIOR)
    seen = [offset_trajectory(each, _LENS, _PRIOR, moved) for each in known]
    people = [each for each in seen if each is not None]
    bare = [replace(each, top_v=None) for each in people]
    found = estimate_pose(observe(bare, _LENS, _PRIOR), site)
    alarm_chart_result(observe(people, _LENS, _PRIOR), site, _RATE)
    return found


def _people(rng: np.random.Generator) -> list[Trajectory]:
    """Tracks with boxes of people who come one after another, seen from the prior pose."""
    walks = simulate_walks(_LENS, repeated_pose(_PRIOR, _PEOPLE), _WALK, rng)
    tracks = []
    for number, (uv, points) in enumerate(zip(walks.uv, walks.lengths, strict=True)):
        feet = uv[:points]
        ground, _ = ground_from_pixel(_LENS, _PRIOR.rotation, _PRIOR.centre_m, feet)
        tall_m = np.full(points, _STATURE_M * math.exp(rng.normal(0, _STATURE_SD)))
        tracks.append(
            Trajectory(
                time_s=_BETWEEN_S * number + _WALK.step_s * np.arange(points),
                uv=feet,
                top_v=tops_seen(_LENS, _PRIOR.rotation, _PRIOR.centre_m, ground, tall_m),
            )
        )
    # The tracker loses the last of them, and finds them again: pieces are linked, too.
    *others, last = tracks
    before, after = np.array_split(np.arange(last.time_s.size), 2)
    return [*others, last.part(before), last.part(after)]


if __name__ == "__main__":
    warm_up()
