"""The estimate by images alone: of a camera without tracks since, or without any."""

import math
from dataclasses import asdict, replace
from datetime import datetime

import numpy as np
from sqlalchemy.orm import Session

from models.geometry.pose import PoseParameters
from models.monitoring.verdict import LIKELY, judge, pose_after, reason_of_drift
from models.pose import PosePosterior, drift_by_images, posterior_by_picture
from models.reasons import Reason
from service.enums import PoseState
from service.estimation.alert_evidence import told_by
from service.estimation.estimates import history_of, record_of, tell_estimate, update_alerts
from service.estimation.judgement import Judgement
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
    history = history_of(session, reference)
    drifted = history.drifted
    if drifted and last is not None and last.reference_id == reference.id:
        drifted = tuple(last.drifted)  # while it learns, too, by images alone
    verdict = judge(drift, limits, drifted)
    learning = reference.ready_at is None and reference.source is not None
    if learning and not verdict.drifting and not drifted:
        return None
    state = PoseState.SUSPECTED if posterior.moved >= LIKELY else PoseState.OK
    taken_at = from_seconds(picture.taken_s)
    by = Reason(code=ServiceCode.BY_PICTURE, values={"taken_at": json_time(taken_at)})
    judgement = Judgement(
        state=PoseState.DRIFTING if verdict.drifting else state,
        reasons=some(by, reason_of_drift(drift, verdict, limits), picture.reason),
        verdict=verdict,
        after=_stood_at(session, camera_id) if verdict.drifting else None,
        since=taken_at if verdict.drifting else None,
    )
    if verdict.drifting and drifted and last is not None:
        # When it began, as it was told.
        since = last.drift_since or judgement.since
        judgement = replace(judgement, after=last.drift_after, since=since)
    record = record_of(
        reference,
        posterior,
        drift,
        judgement,
        suspected=False,
        rivals=[],
        would_notice={},
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
    update_alerts(session, settings, camera_id, drift, judgement, evidence)
    session.add(record)
    tell_estimate(session, record, drift)
    return record


def _stood_at(session: Session, camera_id: str) -> datetime | None:
    found = session.get(PictureRecord, camera_id)
    return None if found is None else found.other_at


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
