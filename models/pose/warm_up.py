"""One of everything at a simulated site, so that all it needs is compiled: a step of installing.

python -m models.pose.warm_up
"""

import math
from dataclasses import replace

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.pose.alarms import AlarmRate, alarm_chart_result
from models.pose.estimating import PoseFinding, estimate_pose
from models.pose.site import learn_site
from models.simulation.pose_offset import PoseOffset
from models.simulation.simulated_site import SiteConfig, draw_lanes, walk_site
from models.tracks.trajectory import by_end
from models.tracks.walks import observe

_LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
_PRIOR = CameraPose(height_m=6.0, tilt_rad=math.radians(18), roll_rad=math.radians(1))
_KNOCK = PoseOffset(tilt_rad=math.radians(5), roll_rad=math.radians(-4))
_PEOPLE = 40
_RATE = AlarmRate(alarms_a_year=1.0, tracks_a_year=10_000.0)


def warm_up(seed: int = 0) -> PoseFinding:
    """Learn a site, knock its camera, estimate its pose and read its chart."""
    rng, config = np.random.default_rng(seed), SiteConfig()
    lanes = draw_lanes(_LENS, _PRIOR, config, rng)
    known = by_end(walk_site(_LENS, _PRIOR, lanes, config, _PEOPLE, rng))
    site = learn_site(observe(known, _LENS, _PRIOR), _LENS, _PRIOR, seed=seed)
    people = by_end(walk_site(_LENS, _KNOCK.apply(_PRIOR), lanes, config, _PEOPLE, rng))
    bare = [replace(each, top_v=None) for each in people]
    found = estimate_pose(observe(bare, _LENS, _PRIOR), site)
    alarm_chart_result(observe(people, _LENS, _PRIOR), site, _RATE)
    return found


if __name__ == "__main__":
    warm_up()
