"""A camera with a reference, about whose tracks a test makes up what they come to."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from models.assessment import TrackWindow, conclude
from models.assessment.observe import observe_window
from models.geometry.pose import PLANE_PARAMETERS, CameraPose
from models.pose import MovedBetween, PoseFinding, smallest_told
from models.pose.pose_fit import FusedEstimate, by_speeds_alone
from models.reasons import Reason, TracksCode
from models.regression.recipe import plan_to_config
from models.walking.estimate import JointEstimate
from service.estimation.compute import ComputedEstimate, zones_of
from service.estimation.estimates import save_estimate
from service.estimation.evidence import Evidence, load_evidence
from service.job_queue import JobQueue
from service.reasons import as_said
from service.store import journal, references, trainings
from service.store.engines.store import Store
from service.training import begin_training, publish_model
from tests.conftest import track

PRIOR = CameraPose(
    height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1), heading_rad=math.radians(40)
)


class Bench:
    """The camera `corner`, its store and its clock."""

    def __init__(self, http, settings):
        self.http, self.settings = http, settings
        self.store = Store(settings)
        self.queue = JobQueue(self.store.engine)
        self.clock_s = datetime.now(UTC).timestamp() - 3600
        self.count = 0
        self.publish()
        self.learn()

    def publish(self):
        with self.store.write() as session:
            training = trainings.unfinished(session, "corner")[0]
            attempt = begin_training(session, self.settings, training.id)
            publish_model(session, self.queue, attempt, weights_sha256="0" * 64, metrics={})
            self.model_id = trainings.newest_model(session, "corner").id
        assert plan_to_config(attempt.plan)["recipe"]["name"] == "default"
        return attempt.plan

    def learn(self):
        with self.store.write() as session:
            reference = references.newest(session, "corner")
            reference.to_s, reference.tracks, reference.data = self.clock_s, 200, b"made up"
            reference.walking_speed_mps = 1.27
            reference.ready_at = datetime.now(UTC)

    def post(self, people: int):
        """Post so many people, who walk one after the other."""
        first = self.count
        self.count += people
        self.clock_s += 60
        batch = [track(str(first + n), start_s=self.clock_s + n) for n in range(people)]
        self.http.post("/cameras/corner/tracks", json={"tracks": batch}).raise_for_status()

    def see(self, pose: CameraPose, people: int = 20, **known):
        """Post people, who come to a pose, and bring the estimate up to date."""
        self.post(people)
        with self.store.write() as session:
            evidence = load_evidence(session, self.settings, "corner")
            if evidence is None:
                return None
            finding = made_up(evidence, pose, **known)
            return save_estimate(session, self.queue, self.settings, evidence, finding)

    def refresh(self):
        with self.store.read() as session:
            return load_evidence(session, self.settings, "corner")

    def pose(self):
        return self.http.get("/cameras/corner/pose").json()

    def alerts(self, **query):
        return self.http.get("/alerts", params=query).json()["items"]

    def trainings(self):
        return self.http.get("/cameras/corner/trainings").json()["items"]

    def events(self, type_):
        with self.store.read() as session:
            return [e.payload for e in journal.events_after(session, 0, 1000) if e.type == type_]


def made_up(
    evidence: Evidence,
    pose: CameraPose,
    *,
    sd_deg=0.2,
    sd_log=0.01,
    unidentifiable=(),
    change=None,
    paths=False,
    changed=False,
    causes=None,
    timed=True,
) -> ComputedEstimate:
    """What the tracks of a window come to: a pose, whose heading is identifiable by their `paths`.

    Where these have `changed`, people walk on none of them. Unless `timed`, too few came after a
    move to know when it was.
    """
    values = np.array([pose.tilt_rad, pose.roll_rad, math.log(pose.height_m)])
    missing = f"the tracks cannot tell {' and '.join(unidentifiable)}"
    sd = np.array([math.radians(sd_deg), math.radians(sd_deg), sd_log])
    sd[[name in unidentifiable for name in PLANE_PARAMETERS]] = 0.5  # radians, and log height
    joint = JointEstimate(
        values=values,
        covariance=np.diag(sd**2),
        bound=np.diag(sd**2),
        raw=values + 0.01,
        log_likelihood=0.0,
        walkers=len(evidence.tracks),
        walking_groups=len(evidence.tracks),
        identifiable=tuple(name for name in PLANE_PARAMETERS if name not in unidentifiable),
        reason=as_said(missing)[0] if unidentifiable else None,
    )
    fused = by_speeds_alone(joint, evidence.prior)
    if paths:
        sds = np.append(sd, math.radians(sd_deg))
        fused = FusedEstimate(
            values=np.append(values, pose.heading_rad),
            covariance=np.diag(sds**2),
            identifiable=(*fused.identifiable, "heading"),
            reason=None,
            raw=np.append(values, pose.heading_rad) + 0.01,
        )
    if changed:
        fused = replace(fused, reason=Reason(code=TracksCode.PATHS_CHANGED))
    found = PoseFinding(
        prior=evidence.prior,
        joint=joint,
        fused=fused,
        change_idx=change,
        between=MovedBetween(first=change or 0, last=change or 0) if timed else None,
    )
    if causes is not None:
        vars(found)["causes"] = causes  # instead of those that the tracks would come to
    tracks = evidence.tracks
    window = TrackWindow(
        trajectories=[each.trajectory for each in tracks],
        unanswered=np.array([each.unanswered for each in tracks]),
    )
    limits = evidence.limits
    observed = observe_window(window, evidence.intrinsics, evidence.prior, limits.drift.people)
    assessment = conclude(
        observed, found, mapped=evidence.flow is not None, state=evidence.state, limits=limits
    )
    power = smallest_told(fused, joint.walking_groups, joint.walkers, 200.0)
    return ComputedEstimate(
        assessment=replace(assessment, detectable=power),
        tracks=tracks,
        zones=zones_of(evidence, tracks[change or 0 :], assessment),
    )


def moved(tilt_deg=0.0, roll_deg=0.0, height_m=0.0, heading_deg=0.0):
    return CameraPose(
        height_m=PRIOR.height_m + height_m,
        tilt_rad=PRIOR.tilt_rad + math.radians(tilt_deg),
        roll_rad=PRIOR.roll_rad + math.radians(roll_deg),
        heading_rad=PRIOR.heading_rad + math.radians(heading_deg),
    )
