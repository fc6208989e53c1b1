"""The study of what people tell of a lens, on a site that is as it supposes."""

import numpy as np

from models.geometry.pose import CameraPose
from models.tracks.scenes import Scene, SceneTrack
from models.tracks.trajectory import by_end
from studies.lens_study import draws_of, outcome_of
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site
from tests.models.sites import LENS

POSE = CameraPose(height_m=3.1, tilt_rad=0.54, roll_rad=-0.03)


def test_of_a_site_where_speeds_are_the_same_everywhere_the_true_lens_is_the_best(monkeypatch):
    monkeypatch.setattr("studies.lens_study._FACTORS", (0.7, 1.0, 1.45))
    rng = np.random.default_rng(1)
    site = SiteConfig(speed_mean_mps=1.4, lanes=4)
    people = by_end(walk_site(LENS, POSE, draw_lanes(LENS, POSE, site, rng), site, 120, rng))
    scene = Scene(
        scene_id="drawn", intrinsics=LENS, true_pose=POSE, frame_rate_hz=25.0,
        tracks=tuple(
            SceneTrack(track_id=str(n), trajectory=each, person_id=str(n))
            for n, each in enumerate(people)
        ),
    )  # fmt: skip
    (drawn,) = draws_of(scene, 1)
    shorter, true, longer = outcome_of(scene, drawn).behind
    assert true < 2.0
    assert min(shorter, longer) > 4.0
