"""The protocol over HTTP and offline: one recorded scene, the same printed digits."""

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from models.geometry.upright import tops_of_boxes
from models.paths.reference import paths_from_bytes, paths_to_bytes
from models.pose import estimate_pose, learn_site, observe
from models.tracks.scenes import load_scene
from models.tracks.trajectory import Trajectory
from studies.protocol.cases import (
    RANGES,
    Answer,
    draw_case,
    judge_answer,
    pose_of_plane_parameters,
)
from studies.protocol.partings import HALVES_IN_TIME
from studies.served.replay_protocol import boxes_of, tops_carried
from studies.served.windows import Window, assessed_windows
from tests.conftest import SCENES

# Cases in which boxes can say every upper edge that offline knows; the second tells its heading.
CASES = [("pets2009_s2l1_v001_sort", "knock", 2), ("wildtrack_c1", "pan", 3)]


@pytest.mark.slow
@pytest.mark.skipif(not SCENES.is_dir(), reason=f"no recorded scenes in {SCENES}")
@pytest.mark.parametrize(("scene_id", "knock", "seed"), CASES)
def test_what_is_served_of_a_recorded_scene_is_the_offline_protocol(service, scene_id, knock, seed):
    folder = SCENES / scene_id
    done = subprocess.run(
        [sys.executable, "-m", "studies", "http", str(folder), "--url", service.url]
        + ["--seed", str(seed), "--knock", knock],
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    case = draw_case(load_scene(folder), seed, RANGES[knock])
    known, seen = (
        observe(tracks, case.intrinsics, case.prior_pose) for tracks in (case.reference, case.seen)
    )
    drawn_by = service.settings.seed
    site = learn_site(known, case.intrinsics, case.prior_pose, seed=drawn_by, chart=False)
    stored = paths_from_bytes(paths_to_bytes(site.paths))
    found = estimate_pose(seen, replace(site, paths=stored))
    offline = found.fused
    pose = pose_of_plane_parameters(offline.values[:3], case.prior_pose)
    body = service.http.get(f"/cameras/{case.scene_id}-{knock}-{seed}/pose").json()
    sd = np.sqrt(np.diag(offline.covariance))
    expected = {
        "tilt_deg": (math.degrees(pose.tilt_rad), math.degrees(sd[0])),
        "roll_deg": (math.degrees(pose.roll_rad), math.degrees(sd[1])),
        "height_m": (pose.height_m, pose.height_m * sd[2]),
    }
    assert {"tilt", "roll", "height"} <= set(offline.identifiable)
    assert ("heading" in offline.identifiable) == (body["sd"]["heading_deg"] is not None)
    heading_rad = None
    if knock == "pan":
        heading_rad = float(offline.values[3])
        expected["heading_deg"] = (math.degrees(heading_rad), math.degrees(sd[3]))
        assert body["drift"]["heading_deg"] == pytest.approx(
            math.degrees(case.true_pose.heading_rad - case.prior_pose.heading_rad), abs=1.5
        )
    for field, (value, deviation) in expected.items():
        assert f"{body['pose'][field]:.3f}" == f"{value:.3f}" in done.stdout
        assert f"{body['sd'][field]:.3f}" == f"{deviation:.3f}" in done.stdout
    answer = Answer(
        values=offline.values[:3],
        covariance=offline.covariance[:3, :3],
        tracks=found.joint.walkers,
        heading_rad=heading_rad,
        heading_sd_rad=float(sd[3]),
    )
    outcome = judge_answer(case, "fused", answer, 0.0)
    off = f"{outcome.angle_error_deg:.2f} deg and {100 * outcome.height_error:.1f} % of height off"
    assert off in done.stdout
    assert body["tracks"] == len(case.seen)
    assert body["reference"]["tracks"] == len(case.reference)
    assert body["reference"]["walking_speed_mps"] == pytest.approx(
        site.speed_reference.walking_speed_mps
    )
    assert body["state"] == "drifting"


@pytest.mark.slow
@pytest.mark.skipif(not SCENES.is_dir(), reason=f"no recorded scenes in {SCENES}")
@pytest.mark.parametrize("batch", [1, 50])
def test_what_is_served_by_time_and_in_batches_is_what_windows_say_offline(service, batch):
    folder = SCENES / "pets2009_s2l1_v001_sort"
    done = subprocess.run(
        [sys.executable, "-m", "studies", "http", str(folder), "--url", service.url]
        + ["--seed", "2", "--knock", "knock", "--by-time", "--batch", str(batch)],
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    case = draw_case(load_scene(folder), 2, RANGES["knock"], HALVES_IN_TIME)
    known = observe(case.reference, case.intrinsics, case.prior_pose)
    drawn_by = service.settings.seed
    site = learn_site(known, case.intrinsics, case.prior_pose, seed=drawn_by, chart=False)
    seen = [tops_carried(track, case.intrinsics) for track in case.seen]
    last = list(assessed_windows(seen, site, Window(batch=batch)))[-1]
    drift = last.assessment.estimated.drift
    body = service.http.get(f"/cameras/{case.scene_id}-knock-2-by-time-{batch}/pose").json()
    for name, field in (("tilt", "tilt_deg"), ("roll", "roll_deg")):
        told = math.degrees(drift.of(name)[0])
        assert body["drift"][field] == pytest.approx(told, abs=1e-3), field
    assert body["tracks"] == len(last.assessment.observed.ended_s) - (
        last.assessment.estimated.first or 0
    )


def test_boxes_carry_feet_to_the_bit_and_upper_edges(lens):
    rng = np.random.default_rng(3)
    uv = np.column_stack([rng.uniform(-40, 1300, 200), rng.uniform(300, 719, 200)])
    uv[0, 0] = 0.0
    top_v = np.where(rng.random(200) < 0.2, np.nan, uv[:, 1] - rng.uniform(20, 250, 200))
    walk = Trajectory(time_s=np.arange(200) * 0.4, uv=uv, top_v=top_v)
    boxes = boxes_of(walk, lens)
    assert (((boxes[:, 0] + boxes[:, 2]) / 2 == uv[:, 0]) & (boxes[:, 3] == uv[:, 1])).all()
    assert (boxes[:, 0] < boxes[:, 2]).all()
    carried = tops_of_boxes(lens, boxes)
    np.testing.assert_array_equal(tops_carried(walk, lens).top_v, carried)
    known = np.isfinite(carried)
    np.testing.assert_array_equal(carried[known], top_v[known])
    inside = lens.contains(uv, margin_px=-3) & (top_v > 3)
    assert (known == np.isfinite(top_v))[inside].all()
    assert boxes_of(Trajectory(time_s=walk.time_s, uv=uv), lens) is None
