"""The service, the Python API and the studies give the same assessment of the same tracks."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

import surefoot
from models.assessment import tracks_a_year
from models.simulation.poses import PoseOffset
from models.tracks.scenes import load_scene
from service.estimation.compute import compute_estimate, site_of
from service.estimation.evidence import load_evidence
from service.job_queue import JobQueue
from service.store.engines.store import Store
from service.workers.context import JobContext
from service.workers.estimate import run_estimate
from studies.protocol.partings import first_seen
from studies.served.windows import Window, assessed_windows
from surefoot.site import Site
from tests.conftest import SCENES

KNOCKS = {
    "stationary": None,
    "all": PoseOffset(
        tilt_rad=math.radians(1.5),
        roll_rad=math.radians(-2),
        heading_rad=math.radians(6),
        log_height=0.08,
    ),
}
FOLDERS = sorted(each.parent for each in SCENES.glob("*/camera.json"))
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not FOLDERS, reason=f"no recorded scenes in {SCENES}"),
]


def post(http, tracks, epoch_s):
    rows = [
        np.column_stack([epoch_s + each.trajectory.time_s, each.trajectory.uv]).tolist()
        for each in tracks
    ]
    batch = [{"id": f"{n}", "points": points} for n, points in enumerate(rows)]
    http.post("/cameras/scene/tracks", json={"tracks": batch}).raise_for_status()


@pytest.fixture
def evidence_of(http, settings):
    """The input of the service's estimate of a scene's later half, before it is computed."""

    def load(scene, knock):
        pose, lens = scene.true_pose, scene.intrinsics
        sizes = {name: getattr(lens, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
        people = sorted(scene.tracks, key=lambda track: track.trajectory.time_s[-1])
        half = people[: len(people) // 2]
        learned_s = half[-1].trajectory.time_s[-1]
        known = first_seen(scene, half, pose, None)
        later = [each for each in people if each.trajectory.time_s[0] > learned_s]
        seen = first_seen(scene, later, pose if knock is None else knock.apply(pose), None)
        body = {
            "id": "scene",
            "intrinsics": {**sizes, "distortion": list(lens.distortion)},
            "prior_pose": {
                "height_m": pose.height_m,
                "tilt_deg": math.degrees(pose.tilt_rad),
                "roll_deg": math.degrees(pose.roll_rad),
                "heading_deg": math.degrees(pose.heading_rad),
            },
            "frame_rate_hz": scene.frame_rate_hz,
            "reference_tracks": max(20, len(known) // 2),  # people: trackers cut their walks
        }
        http.post("/cameras", json=body).raise_for_status()
        epoch_s = math.floor(datetime.now(UTC).timestamp()) - 5e5
        store = Store(settings)
        queue = JobQueue(store.engine)
        context = JobContext(settings=settings, store=store, queue=queue)
        post(http, known, epoch_s)
        run_estimate(context, "scene")
        post(http, seen, epoch_s)
        with store.read() as session:
            found = load_evidence(session, settings, "scene")
        queue.close()
        store.close()
        return found

    return load


def numbers(estimated):
    posterior = estimated.posterior
    return (
        posterior.weights.tolist(),
        posterior.offset.tolist(),
        posterior.covariance.tolist(),
        estimated.drift.identifiable,
        estimated.pose,
    )


@pytest.mark.parametrize("knock", KNOCKS)
@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_same_tracks_get_same_assessment(evidence_of, folder, knock):
    evidence = evidence_of(load_scene(folder), KNOCKS[knock])
    if evidence is None or evidence.site is None:
        pytest.skip("too few people for a reference")
    tracks = [each.trajectory for each in evidence.tracks]
    limits = replace(evidence.limits, tracks_a_year=tracks_a_year(tracks))
    evidence = replace(evidence, limits=limits, last=None)
    by_service = compute_estimate(evidence, 0)
    site = site_of(evidence, [])
    camera = surefoot.Camera(
        intrinsics=evidence.intrinsics, prior_pose=surefoot.Pose.of(evidence.prior)
    )
    if by_service is None:
        with pytest.raises(surefoot.CalibrationError):
            surefoot.estimate(Site(camera=camera, model=site), tracks)
        return
    served = by_service.assessment
    # The state before is that of a camera without alerts, in all three.
    assert not evidence.state.alerted
    by_api = surefoot.estimate(Site(camera=camera, model=site), tracks)
    whole = Window(batch=None, tracks=len(tracks), days=1e4)
    (by_study,) = assessed_windows(tracks, site, whole, evidence.limits)

    assert numbers(by_study.assessment.estimated) == numbers(served.estimated)
    assert by_study.assessment.chart == served.chart
    assert by_study.assessment.decision.verdict == served.decision.verdict
    assert by_study.assessment.state == served.state
    assert by_api.probability == served.posterior.moved
    assert by_api.pose == surefoot.Pose.of(served.estimated.pose)
    assert by_api.posterior.covariance.tolist() == served.posterior.covariance.tolist()
    assert by_api.state == served.state
