"""Windows and batches as they come to the service, on a simulated site."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.pose import CameraSite, DriftLimits, Trajectory, learn_site, observe
from models.simulation.poses import PoseOffset
from models.tracks.scenes import Scene, SceneTrack
from models.tracks.trajectory import by_end
from studies.protocol.cases import ProtocolCase
from studies.served.outcomes import parameters_beside, serve_case
from studies.served.replays import ReplayPlan, replay
from studies.served.windows import Window, assessed_windows
from studies.simulation.lanes import SiteConfig
from tests.models.sites import KNOCKED, LENS, PRIOR, tracks_of

pytestmark = pytest.mark.slow
CONFIG = SiteConfig(between_sd=0.15, standing_share=0.05)


@pytest.fixture(scope="module")
def walked() -> list[list[Trajectory]]:
    """Tracks of the reference, of the same pose after it, and after a knock."""
    parts = tracks_of(3, (PRIOR, 150), (PRIOR, 80), (KNOCKED, 80), config=CONFIG)
    return [by_end(part) for part in parts]


@pytest.fixture(scope="module")
def site(walked) -> CameraSite:
    return learn_site(observe(walked[0], LENS, PRIOR), LENS, PRIOR, chart=False)


def case_of(walked: Sequence[Sequence[Trajectory]], part: int) -> ProtocolCase:
    return ProtocolCase(
        scene_id="simulated",
        seed=0,
        intrinsics=LENS,
        prior_pose=PRIOR,
        true_pose=KNOCKED if part == 2 else PRIOR,
        reference=tuple(walked[0]),
        seen=tuple(walked[part]),
    )


def test_batches_end_where_all_at_once_ends(walked, site):
    ends = [
        list(assessed_windows(walked[2], site, Window(batch=batch)))[
            -1
        ].assessment.estimated.fused.values
        for batch in (30, None)
    ]
    assert_allclose(ends[0], ends[1], atol=1e-12)


def test_a_window_is_of_the_newest_tracks_and_begins_at_a_change(walked, site):
    tracks = [*walked[1], *walked[2]]
    found = list(assessed_windows(tracks, site, Window(tracks=120, batch=40)))
    assert [look.tracks for look in found] == [40, 80, 120, 160]
    assert [look.first for look in found[:2]] == [0, 0]
    cuts = [look.cut for look in found if look.cut is not None]
    assert cuts
    assert abs(cuts[0] - 80) < 15
    after = [look for look in found if look.cut is None and look.tracks > 120]
    assert all(look.first == cuts[-1] for look in after)
    final = found[-1].assessment.estimated
    assert abs(math.degrees(final.pose.tilt_rad - KNOCKED.tilt_rad)) < 0.7


def test_windows_are_no_older_than_they_may_be(walked, site):
    newest_s = walked[1][-1].time_s[-1]
    old_s = newest_s - walked[1][40].time_s[-1]
    (look,) = assessed_windows(walked[1], site, Window(days=(old_s + 1e-3) / 86_400, batch=None))
    assert look.first == 40
    assert len(look.assessment.observed.ended_s) == 40


def test_a_served_case_is_judged_beside_the_truth(walked, site):
    told = serve_case(case_of(walked, 2), site, Window(batch=40))
    assert told.failure == ""
    assert (told.reference_tracks, told.seen_tracks, told.cuts) == (150, 80, 0)
    moves = [parameter.moved for parameter in told.parameters]
    assert_allclose(moves, [5.0, -4.0, math.log(1.08), 0.0], atol=1e-9)
    assert told.rotation_deg < 1.0
    assert told.height_error < 0.05
    (look,) = assessed_windows(walked[2], site, Window(batch=None))
    by_hand = look.assessment.estimated.fused.values[0] - KNOCKED.tilt_rad
    assert told.parameters[0].error == pytest.approx(math.degrees(by_hand), abs=1e-6)
    assert parameters_beside(look.assessment.estimated, PRIOR, KNOCKED) == told.parameters


def test_nothing_is_made_up_where_nobody_walks_or_nothing_is_known(walked, site):
    few = case_of([walked[0], [], walked[2][:3]], 2)
    told = serve_case(few, site, Window())
    assert told.failure == "too few people walk"
    assert told.parameters == ()
    assert told.height_error == pytest.approx(1 - 1 / 1.08)  # the prior pose is served
    assert serve_case(few, None, Window()).failure == "the reference tells nothing"


def test_a_replay_tells_before_from_after_a_move():
    (people,) = tracks_of(3, (PRIOR, 290), config=CONFIG)
    starts = 40.0 * np.arange(len(people))
    scene = Scene(
        scene_id="simulated",
        intrinsics=LENS,
        true_pose=PRIOR,
        frame_rate_hz=2.5,
        tracks=tuple(
            SceneTrack(
                track_id=str(n),
                trajectory=Trajectory(time_s=track.time_s - track.time_s[0] + start, uv=track.uv),
                person_id=str(n),
            )
            for n, (track, start) in enumerate(zip(people, starts, strict=True))
        ),
    )
    limits = DriftLimits(
        certainty=0.99, floor_rad=math.radians(1), floor_m=0.3, people=12, clear_ratio=0.7
    )
    plan = ReplayPlan(window=Window(batch=30), limits=limits, alarms_a_year=1.0)
    still = replay(scene, None, 0, 120, plan)
    assert still.after is None
    assert still.reference_tracks == 120
    assert still.before.tracks == 170
    assert still.before.looks == 6
    assert still.before.alarm_after is None
    moved = replay(scene, PoseOffset(tilt_rad=math.radians(5)), 0, 120, plan)
    assert moved.before.tracks < still.before.tracks
    assert moved.after is not None
    assert moved.after.alarm_after is not None
    assert moved.after.alarm_after <= 60
    assert moved.measured is None  # fewer than 250 came
