"""The estimate by images alone: of a camera without tracks since, or without any."""

import math
from dataclasses import asdict

import numpy as np
from sqlalchemy.orm import Session

from models.assessment import NO_TIME, CameraState, Decision, TimeSpan, judge, reason_of_drift
from models.geometry.pose import PoseParameters
from models.monitoring.drift import LIKELY, pose_after
from models.pose import PosePosterior, drift_by_images, posterior_by_picture
from models.reasons import Reason
from service.estimation.alert_evidence import told_by
from service.estimation.carried_state import carried_state
from service.estimation.estimates import record_of, tell_estimate, update_alerts
from service.estimation.moved_zones import MovedZones, moved_zones
from service.estimation.seen_picture import SeenPicture, seen_picture
from service.notifications.outbox import json_time
from service.reasons import ServiceCode, some
from service.references import drift_limits, window_of
from service.settings import Settings
from service.store import cameras, estimates, references, tracks, zones
from service.store.cameras import CameraRecord
from service.store.estimates import EstimateRecord
from service.store.pictures import PictureRecord
from service.wording.times import from_seconds


def save_by_picture(session: Session, settings: Settings, camera_id: str) -> EstimateRecord | None:
    """Judge a camera by its images; None if there is no match, or it was judged already.

    While a reference is learned from tracks, images are only used to report a move.
    """
    reference = references.newest_if_any(session, camera_id)
    if reference is None:
        return None
    picture = seen_picture(session, reference, window_of(session, reference, settings))
    last = estimates.newest(session, camera_id)
    if picture is None or picture.evidence is None or picture.was_told(last):
        return None
    prior = cameras.prior_pose(session, camera_id).pose
    posterior = posterior_by_picture(prior, picture.evidence, settings.moved_prior)
    drift, limits = drift_by_images(posterior), drift_limits(settings)
    carried = carried_state(session, reference)
    drifted = carried.drifted
    if drifted and last is not None and last.reference_id == reference.id:
        drifted = tuple(last.drifted)  # while it learns, too, by images alone
    verdict = judge(drift, limits, drifted)
    learning = reference.ready_at is None and reference.source is not None
    if learning and not verdict.drifting and not drifted:
        return None
    state = CameraState.SUSPECTED if posterior.moved >= LIKELY else CameraState.OK
    moved_at = NO_TIME
    if verdict.drifting:
        state, moved_at = (
            CameraState.DRIFTING,
            TimeSpan(_stationary_at_s(session, camera_id), picture.taken_s),
        )
        if drifted and last is not None:
            # A move keeps the time that was reported.
            moved_at = _reported(last) or TimeSpan(None, moved_at.before_s)
    decision = Decision(state=state, verdict=verdict, moved_at=moved_at)
    taken_at = json_time(from_seconds(picture.taken_s))
    by = Reason(code=ServiceCode.BY_PICTURE, values={"taken_at": taken_at})
    reasons = some(by, reason_of_drift(drift, verdict, limits), picture.reason)
    record = record_of(
        reference,
        posterior,
        drift,
        decision,
        reasons,
        suspected=False,
        alternatives=[],
        detectable={},
        raw={"picture": picture.raw},
        tracks=0,
        from_s=picture.taken_s,
        to_s=picture.taken_s,
        newest_track_pk=tracks.newest_pk(session, camera_id) or 0,
    )
    lens = session.get_one(CameraRecord, camera_id).intrinsics
    drawn = zones.of_camera(session, camera_id)
    moved = moved_zones(drawn, lens, pose_after(drift, prior)) if verdict.drifting else None
    evidence = _evidence(posterior, picture, moved)
    update_alerts(session, settings, camera_id, drift, decision, reasons, evidence)
    session.add(record)
    tell_estimate(session, record, drift)
    return record


def _stationary_at_s(session: Session, camera_id: str) -> float | None:
    """When an image last showed the camera at its prior pose."""
    found = session.get(PictureRecord, camera_id)
    return None if found is None or found.other_at is None else found.other_at.timestamp()


def _reported(last: EstimateRecord) -> TimeSpan | None:
    """The time of the move as the last estimate reported it."""
    if last.drift_since is None:
        return None
    after = last.drift_after
    return TimeSpan(None if after is None else after.timestamp(), last.drift_since.timestamp())


def _evidence(
    posterior: PosePosterior, picture: SeenPicture, moved: MovedZones | None
) -> dict[str, object]:
    """What an alert is by, as of people; without any."""
    assert picture.evidence is not None
    tilt, roll, heading = picture.evidence.offset.tolist()
    sds = np.sqrt(np.diag(picture.evidence.covariance)).tolist()
    sd = PoseParameters(height_m=math.inf, tilt_rad=sds[0], roll_rad=sds[1], heading_rad=sds[2])
    return {
        **told_by(posterior, np.array([tilt, roll, 0.0, heading]), moved),
        "from_s": picture.taken_s,
        "to_s": picture.taken_s,
        "offset_sd": asdict(sd) | {"height_m": None},
    }
