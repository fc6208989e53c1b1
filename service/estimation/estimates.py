"""What comes of a finding, in one transaction: an estimate, its alerts, training and event."""

from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy.orm import Session

from models.geometry.pose import PLANE_PARAMETERS, PoseParameters
from models.monitoring.verdict import Drift, pose_after
from models.pose import PosePosterior, drift_of
from models.reasons import Reason, TracksCode
from service.alerts.alerts import end_alert, open_alert
from service.degrees import in_degrees
from service.enums import AlertKind, EventType, Outcome, PoseState, Severity
from service.estimation.alert_evidence import alert_evidence, rivals_of, would_notice
from service.estimation.evidence import Evidence
from service.estimation.finding import Finding
from service.estimation.judgement import Case, History, Judgement
from service.job_queue import JobQueue
from service.reasons import ServiceCode
from service.references import is_before, made_against, window_of
from service.settings import Settings
from service.store import alerts, estimates, journal, pictures, references
from service.store.alerts import MOVED_KINDS, SCALE_KINDS
from service.store.cameras import CameraRecord
from service.store.estimates import EstimateRecord, identifiable_drift
from service.store.references import LastPoseRecord, SiteReferenceRecord
from service.training import train_at_edge
from service.wording.alerts import fired_as


def save_estimate(
    session: Session, queue: JobQueue, settings: Settings, evidence: Evidence, finding: Finding
) -> EstimateRecord | None:
    """Judge a finding and store what comes of it; None if its reference no longer counts.

    A reference that has become ready, or another one that has begun, has a job of its own. So has
    what comes after a person has answered or was at the camera.
    """
    reference = _counting_reference(session, settings, evidence)
    camera = session.get(CameraRecord, evidence.camera_id)
    if reference is None or camera is None:
        return None
    drift = drift_of(finding.posterior, finding.fused)
    if evidence.site is None:
        record = _learning(settings, reference, evidence, finding, drift)
    else:
        _note_change(reference, evidence, finding)
        history = history_of(session, reference)
        _note_agreement(session, history, finding, camera.id)
        judgement = Case(
            reference=reference,
            history=history,
            evidence=evidence,
            finding=finding,
            drift=drift,
            frame_rate_hz=camera.frame_rate_hz,
        ).judged()
        record = _record(reference, evidence, finding, drift, judgement)
        pose = pose_after(drift, evidence.prior)
        train_at_edge(session, queue, settings, camera.id, pose, drift.identifiable)
        kept = alert_evidence(finding, evidence.prior)
        update_alerts(session, settings, camera.id, drift, judgement, kept)
    session.add(record)
    tell_estimate(session, record, drift)
    _keep_last_pose(session, reference.id, finding.last)
    return record


def _counting_reference(
    session: Session, settings: Settings, evidence: Evidence
) -> SiteReferenceRecord | None:
    """The reference that evidence was gathered for, if both count still."""
    reference = references.newest_if_any(session, evidence.camera_id)
    if reference is None or reference.id != evidence.reference_id:
        return None
    if (reference.ready_at is None) != (evidence.site is None):
        return None
    bounds = window_of(session, reference, settings)
    if evidence.site is not None and is_before(evidence.tracks[-1].ended_s, bounds):
        return None
    return reference


def _learning(
    settings: Settings,
    reference: SiteReferenceRecord,
    evidence: Evidence,
    finding: Finding,
    drift: Drift,
) -> EstimateRecord:
    """The record while a reference is learned: the prior pose is served, and nothing is judged."""
    learning = (Reason(code=ServiceCode.LEARNING_REFERENCE),)
    judgement = Judgement(state=PoseState.LEARNING, reasons=learning)
    record = _record(reference, evidence, finding, drift, judgement)
    record.identifiable, record.pose = [], PoseParameters.of_pose(evidence.prior)
    record.moved, record.moved_parameters = settings.moved_prior, {}
    return record


def _note_change(reference: SiteReferenceRecord, evidence: Evidence, finding: Finding) -> None:
    """Let the window begin at a change that was found, and keep when it was, if that is known."""
    change, between = finding.change, finding.between
    if change is None:
        return
    reference.window_from_s, reference.changed_s = change.ended_s, change.started_s
    reference.changed_after_s = None
    if between is not None:
        reference.changed_after_s, reference.changed_s = evidence.times_of(between)


def _note_agreement(session: Session, history: History, finding: Finding, camera_id: str) -> None:
    """Count, once a picture, how people compare with it."""
    picture, people_moved = finding.picture, finding.people_moved
    if people_moved is not None and picture and not picture.was_told(history.last):
        pictures.note_agreement(session, camera_id, people_moved=people_moved)


def _keep_last_pose(session: Session, reference_id: int, found: LastPoseRecord | None) -> None:
    """Keep where the next estimate may begin."""
    if found is not None:
        session.merge(found)
    elif (last := session.get(LastPoseRecord, reference_id)) is not None:
        session.delete(last)


def tell_estimate(session: Session, record: EstimateRecord, drift: Drift) -> None:
    """Add the event of an estimate that was stored."""
    payload = {
        "camera_id": record.camera_id,
        "state": record.state,
        "tracks": record.tracks,
        "drift": in_degrees(identifiable_drift(drift)) if record.identifiable else None,
    }
    journal.add_event(session, EventType.POSE, payload, record.created_at)


def history_of(session: Session, reference: SiteReferenceRecord) -> History:
    """The earlier findings of a camera, and what of them counts against its reference."""
    camera_id = reference.camera_id
    last = estimates.newest(session, camera_id)
    if last is not None and not made_against(reference, last):
        last = None
    firing = alerts.firing_by_estimates(session, camera_id)
    unsure = AlertKind.UNSURE in firing
    if not firing & set(MOVED_KINDS):
        return History(last=last, drifted=(), unsure=unsure)
    # An alert of before this reference stands until what is seen after it ends it.
    before = last or estimates.newest_of_earlier(session, camera_id, reference.id)
    drifted = () if before is None else tuple(before.drifted)
    return History(last=last, drifted=drifted or PLANE_PARAMETERS, unsure=unsure)


def update_alerts(
    session: Session,
    settings: Settings,
    camera_id: str,
    drift: Drift,
    judgement: Judgement,
    evidence: dict[str, Any],
) -> None:
    """Open, update or end the alerts that an estimate stands behind: one of them fires, or none."""
    firing, verdict = alerts.firing_by_estimates(session, camera_id), judgement.verdict
    kind, moved = _kind_of(judgement, firing), verdict.drifting
    note = fired_as(kind) if kind is not None and moved else None
    for before in firing - {kind}:
        end_alert(session, camera_id, before, Outcome.CLEARED, note=note)
    if kind is None or (moved and not drift.identifiable and not verdict.alarmed):
        return
    cause = judgement.cause if moved else None
    open_alert(
        session,
        settings,
        camera_id,
        kind,
        Severity.CRITICAL if moved and verdict.excess >= 2 else Severity.WARNING,
        identifiable_drift(drift),
        judgement.since if moved else None,
        reasons=judgement.reasons if cause is None else (cause,),
        changed_after=judgement.after if moved else None,
        # Zones are told of with a move alone.
        evidence=evidence if kind is AlertKind.DRIFT else {**evidence, "zones": None},
    )


def _kind_of(judgement: Judgement, firing: set[AlertKind]) -> AlertKind | None:
    """The kind of the alert that is to fire; None where none is."""
    verdict = judgement.verdict
    if not verdict.drifting:
        return AlertKind.UNSURE if judgement.state == PoseState.UNSURE else None
    if judgement.cause is not None:
        lens = judgement.cause.code == TracksCode.LENS_CHANGED
        return AlertKind.LENS if lens else AlertKind.CLOCK
    # What was named otherwise stays so until an angle has drifted too.
    named = [kind for kind in SCALE_KINDS if kind in firing and verdict.drifted == ("height",)]
    return named[0] if named else AlertKind.DRIFT


def _record(
    reference: SiteReferenceRecord,
    evidence: Evidence,
    finding: Finding,
    drift: Drift,
    judgement: Judgement,
) -> EstimateRecord:
    return record_of(
        reference,
        finding.posterior,
        drift,
        judgement,
        model_id=evidence.model_id,
        suspected=finding.reading is not None and finding.reading.suspicious,
        rivals=rivals_of(finding),
        would_notice=would_notice(finding.power, evidence.prior),
        raw=_raw(finding),
        tracks=len(finding.tracks),
        from_s=min(track.started_s for track in finding.tracks),
        to_s=finding.tracks[-1].ended_s,
        newest_track_pk=finding.newest_pk,
    )


def record_of(
    reference: SiteReferenceRecord,
    posterior: PosePosterior,
    drift: Drift,
    judgement: Judgement,
    **by: Any,
) -> EstimateRecord:
    """The record of a judgement; `by` are the columns that say what it is by."""
    return EstimateRecord(
        camera_id=reference.camera_id,
        prior_pose_id=reference.prior_pose_id,
        reference_id=reference.id,
        state=judgement.state,
        reasons=judgement.reasons,
        identifiable=list(drift.identifiable),
        pose=PoseParameters.of_pose(pose_after(drift, posterior.prior)),
        pose_sd=drift.sd,
        covariance=posterior.covariance.tolist(),
        drift_by=drift.by,
        drift_angle_rad=drift.angle_rad,
        drift_streak=judgement.verdict.streak,
        drifted=list(judgement.verdict.drifted),
        moved=drift.move.moved,
        moved_parameters=dict(drift.move.parameters),
        drift_after=judgement.after,
        drift_since=judgement.since,
        created_at=_created_at(reference),
        **by,
    )


def _created_at(reference: SiteReferenceRecord) -> datetime:
    """Now, though a clock that was set back may say what is before the reference or its answer."""
    at = max(datetime.now(UTC), reference.ready_at or reference.created_at)
    if reference.answered_at is None:
        return at
    return max(at, reference.answered_at + timedelta(microseconds=1))


def _raw(finding: Finding) -> dict[str, Any]:
    """Each estimator's own answer."""
    joint, averaged, registered = finding.joint, finding.averaged, finding.fused.raw_parameters
    raw: dict[str, Any] = {"joint": {**_plane(joint.raw_parameters), "tracks": joint.walkers}}
    if registered is not None:
        heading = {"heading_rad": registered.heading_rad, "tracks": joint.walkers}
        raw["registered"] = {**_plane(registered), **heading}
    if averaged is not None:
        raw["averaged"] = {**_plane(averaged.value), "tracks": averaged.tracks}
    if finding.picture is not None:
        raw["picture"] = finding.picture.raw
    return raw


def _plane(found: PoseParameters) -> dict[str, float]:
    return {"height_m": found.height_m, "tilt_rad": found.tilt_rad, "roll_rad": found.roll_rad}
