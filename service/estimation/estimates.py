"""From what the tracks of a window come to, to a stored estimate, its alerts and its training."""

from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from models.geometry.plane_parameters import PLANE_PARAMETERS
from models.geometry.pose_parameters import PoseParameters
from models.monitoring.chart import CLOCK
from models.monitoring.clock import clock_fault, may_be_clock
from models.monitoring.creep_log import DAY_S
from models.monitoring.verdict import (
    Drift,
    DriftVerdict,
    judge,
    pose_after,
)
from models.monitoring.verdict_reasons import reason_of_creep, reason_of_drift, reason_of_reading
from models.pose import drift_of
from models.reasons import Reason
from service.alerts.alerts import end_alert, fired_by_estimate, open_alert
from service.enums import AlertKind, EventType, Outcome, PoseState, Severity
from service.estimation.evidence import Evidence
from service.estimation.finding import Finding
from service.estimation.last_poses import save_last_pose
from service.estimation.limits import drift_limits
from service.formats.degrees import in_degrees
from service.job_queue import JobQueue
from service.reasons import ServiceCode, some
from service.settings import Settings
from service.store import cameras, estimates, events, references
from service.store.estimates import EstimateRecord
from service.store.references import SiteReferenceRecord
from service.store.serialization import identifiable_drift
from service.training.ranges import train_at_edge
from service.windows.references import is_overtaken, made_against
from service.wording.alerts import fired_as


def save_estimate(
    session: Session, queue: JobQueue, settings: Settings, evidence: Evidence, finding: Finding
) -> EstimateRecord | None:
    """Judge the drift of a finding and store it; None if its reference no longer counts.

    A reference that has become ready, or another one that has begun, has a job of its own. So has
    what comes after a person has answered or was at the camera.
    """
    reference = references.newest_if_any(session, evidence.camera_id)
    if reference is None or reference.id != evidence.reference_id:
        return None
    if (reference.ready_at is None) != (evidence.site is None):
        return None
    if evidence.site is not None and is_overtaken(
        session, settings, reference, evidence.tracks[-1].ended_s
    ):
        return None
    drift = drift_of(finding.fused, evidence.prior)
    if evidence.site is None:
        record = _record(reference, evidence, finding, drift, learning=True)
        record.state = PoseState.LEARNING
        record.reasons = (Reason(code=ServiceCode.LEARNING_REFERENCE),)
    else:
        record = _record(reference, evidence, finding, drift, learning=False)
        _judge(session, queue, settings, reference, evidence, finding, drift, record)
    camera = cameras.find(session, evidence.camera_id)
    if camera is not None:
        camera.urgent = record.suspected or record.drift_streak > 0 or bool(record.drifted)
    session.add(record)
    save_last_pose(session, reference.id, finding.last)
    payload = {
        "camera_id": record.camera_id,
        "state": record.state,
        "tracks": record.tracks,
        "drift": in_degrees(identifiable_drift(drift)) if record.identifiable else None,
    }
    events.add(session, EventType.POSE, payload, record.created_at)
    return record


def _judge(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    reference: SiteReferenceRecord,
    evidence: Evidence,
    finding: Finding,
    drift: Drift,
    record: EstimateRecord,
) -> None:
    """Set state, reasons, drift and alerts of an estimate after the reference."""
    if finding.change is not None:
        reference.window_from_s = finding.change.ended_s
        reference.changed_s = finding.change.started_s
    camera_id = record.camera_id
    last = estimates.newest(session, camera_id)
    firing = fired_by_estimate(session, camera_id)
    since = None
    if last is not None and not made_against(reference, last):
        last = None
    drifted: tuple[str, ...] = ()
    if firing & {AlertKind.DRIFT, AlertKind.CLOCK}:
        # An alert of before this reference stands until what is seen after it ends it.
        before = last or estimates.newest_of_earlier(session, camera_id, reference.id)
        drifted = PLANE_PARAMETERS if before is None else tuple(before.drifted) or PLANE_PARAMETERS
    if last is not None:
        since = last.drift_since
    limits = drift_limits(settings)
    camera = cameras.find(session, camera_id)
    assert camera is not None
    clock = clock_fault(drift, evidence.prior, camera.frame_rate_hz)
    reading = finding.reading
    if reading is not None and clock is None and not drifted and may_be_clock(reading):
        reading = None
    earlier = None if finding.earlier is None else drift_of(finding.earlier, evidence.prior)
    creep = finding.creep
    verdict = judge(drift, limits, drifted, reading, earlier, creep)
    record.drift_streak, record.drifted = verdict.streak, list(verdict.drifted)
    record.drift_since = _since(reference, verdict, since, evidence, finding, first=last is None)
    record.state = PoseState.OK if drift.identifiable else PoseState.LEARNING
    if verdict.drifting:
        record.state = PoseState.DRIFTING
    pose = pose_after(drift, evidence.prior)
    train_at_edge(session, queue, settings, camera_id, pose, drift.identifiable)
    record.reasons = some(
        None if creep is None else reason_of_creep(creep),
        reason_of_drift(drift, verdict, limits),
        clock,
        None if finding.reading is None else reason_of_reading(finding.reading),
        finding.fused.reason,
        None if set(PLANE_PARAMETERS) <= set(drift.identifiable) else finding.joint.reason,
        *reference.doubts,
        finding.pieces,
        *finding.lacks,
    )
    charted = reading is not None and reading.moved
    if charted and clock is None and reading is not None and reading.parameter == CLOCK:
        clock = reason_of_reading(reading)
    charted = charted or (creep is not None and creep.moved)
    _alert(session, settings, record, drift, verdict, charted=charted, clock=clock)


def _alert(
    session: Session,
    settings: Settings,
    record: EstimateRecord,
    drift: Drift,
    verdict: DriftVerdict,
    *,
    charted: bool,
    clock: Reason | None,
) -> None:
    """Open, update or end the alerts that an estimate stands behind."""
    camera_id = record.camera_id
    firing = fired_by_estimate(session, camera_id)
    body = identifiable_drift(drift)
    severity = Severity.CRITICAL if verdict.excess >= 2 else Severity.WARNING
    since = record.drift_since
    if not verdict.drifting:
        for kind in firing & {AlertKind.DRIFT, AlertKind.CLOCK}:
            end_alert(session, camera_id, kind, Outcome.CLEARED)
        return
    # What was named a clock fault stays one until an angle has drifted too.
    is_clock = clock is not None or (AlertKind.CLOCK in firing and verdict.drifted == ("height",))
    kind, other = AlertKind.DRIFT, AlertKind.CLOCK
    if is_clock:
        kind, other = other, kind
    if other in firing:
        end_alert(session, camera_id, other, Outcome.CLEARED, note=fired_as(kind))
    if drift.identifiable or charted:
        reasons = record.reasons if clock is None else (clock,)
        open_alert(session, settings, camera_id, kind, severity, body, since, reasons=reasons)


def _since(
    reference: SiteReferenceRecord,
    verdict: DriftVerdict,
    since: datetime | None,
    evidence: Evidence,
    finding: Finding,
    *,
    first: bool,
) -> datetime | None:
    """When the camera moved, as far as the tracks tell: at the latest then."""
    if verdict.streak > 0:
        if reference.changed_s is not None:
            return datetime.fromtimestamp(reference.changed_s, UTC)
        reading = finding.reading
        if since is None and reading is not None and reading.moved:
            return datetime.fromtimestamp(evidence.tracks[reading.track_idx].started_s, UTC)
        if since is None and finding.creep is not None and finding.creep.moved:
            return datetime.fromtimestamp(finding.creep.since_day * DAY_S, UTC)
        # One pose since the reference, and never another one: it had moved before all of them.
        ended_s = finding.tracks[0 if first else -1].ended_s
        return since or datetime.fromtimestamp(ended_s, UTC)
    return since if verdict.drifting else None


def _record(
    reference: SiteReferenceRecord,
    evidence: Evidence,
    finding: Finding,
    drift: Drift,
    *,
    learning: bool,
) -> EstimateRecord:
    pose = evidence.prior if learning else pose_after(drift, evidence.prior)
    return EstimateRecord(
        camera_id=evidence.camera_id,
        model_id=evidence.model_id,
        prior_pose_id=reference.prior_pose_id,
        reference_id=reference.id,
        identifiable=[] if learning else list(drift.identifiable),
        pose=PoseParameters.of_pose(pose),
        pose_sd=drift.sd,
        drift_by=drift.by,
        drift_angle_rad=drift.angle_rad,
        suspected=finding.reading is not None and finding.reading.suspicious,
        drift_streak=0,
        drifted=[],
        drift_since=None,
        raw=_raw(finding),
        tracks=len(finding.tracks),
        from_s=min(track.started_s for track in finding.tracks),
        to_s=finding.tracks[-1].ended_s,
        newest_track_pk=finding.newest_pk,
        # A clock that was set back must not make it older than the reference that it was held to.
        created_at=max(datetime.now(UTC), reference.ready_at or reference.created_at),
    )


def _raw(finding: Finding) -> dict[str, Any]:
    joint, averaged, registered = finding.joint, finding.averaged, finding.fused.raw_parameters
    raw = {"joint": {**_without_heading(joint.raw_parameters), "tracks": joint.walkers}}
    if registered is not None:
        raw["registered"] = {
            **_without_heading(registered),
            "heading_rad": registered.heading_rad,
            "tracks": joint.walkers,
        }
    if averaged is not None:
        raw["averaged"] = {**_without_heading(averaged.value), "tracks": averaged.tracks}
    return raw


def _without_heading(found: PoseParameters) -> dict[str, float]:
    return {"height_m": found.height_m, "tilt_rad": found.tilt_rad, "roll_rad": found.roll_rad}
