"""The last step of an estimate, in one transaction: its record, alerts, training and event."""

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.assessment import (
    NO_TIME,
    Assessment,
    CameraState,
    Decision,
    Monitored,
    TimeSpan,
    change_in,
)
from models.geometry.pose import PoseParameters
from models.monitoring.drift import LIKELY, Drift, pose_after
from models.pose import PosePosterior
from models.reasons import Reason, TracksCode
from service.alerts.alerts import end_alert, open_alert
from service.degrees import in_degrees
from service.enums import AlertKind, EventType, Outcome, PoseState, Severity
from service.estimate_queue import request_estimate
from service.estimation.alert_evidence import alert_evidence, alternatives_of, detectable
from service.estimation.carried_state import carried_state, last_estimate
from service.estimation.compute import ComputedEstimate
from service.estimation.evidence import Evidence
from service.estimation.monitor_state import basis_digest, whole_window_state
from service.job_queue import JobQueue
from service.reasons import Reasons, ServiceCode
from service.references import is_before, window_of
from service.settings import Settings
from service.store import alerts, estimates, journal, monitor_states, pictures, references
from service.store.alerts import SCALE_KINDS
from service.store.cameras import CameraRecord
from service.store.estimates import EstimateRecord, identifiable_drift
from service.store.references import LastPoseRecord, SiteReferenceRecord
from service.training import train_at_edge
from service.wording.alerts import fired_as
from service.wording.times import from_seconds


def save_estimate(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    evidence: Evidence,
    found: ComputedEstimate,
) -> EstimateRecord | None:
    """Store an estimate and what follows from it; None if it no longer applies.

    It does not if its reference was replaced or became ready, or if an operator acted while it was
    computed: each of these has a run of its own.
    """
    reference = _counting_reference(session, settings, evidence)
    camera = session.get(CameraRecord, evidence.camera_id)
    if reference is None or camera is None:
        return None
    assessment = found.assessment
    if evidence.site is None:
        record = _learning(settings, reference, evidence, found)
    elif carried_state(session, reference) != evidence.state:
        request_estimate(session, queue, camera.id)
        return None
    else:
        _note_change(reference, evidence, assessment)
        _note_agreement(session, reference, evidence, assessment)
        record = _record(reference, evidence, found, assessment.decision, found.reasons)
        drift = assessment.drift
        pose = pose_after(drift, evidence.prior)
        train_at_edge(session, queue, settings, camera.id, pose, drift.identifiable)
        kept = alert_evidence(found, evidence.prior)
        update_alerts(session, settings, camera.id, drift, assessment.decision, found.reasons, kept)
    session.add(record)
    tell_estimate(session, record, assessment.drift)
    _keep_last_pose(session, reference.id, found.last)
    return record


def save_monitor_state(
    session: Session,
    evidence: Evidence,
    found: ComputedEstimate | Monitored,
    record: EstimateRecord | None,
) -> None:
    """Keep the scores of a whole window, so that the next run scores its new tracks alone.

    `record` is the full estimate that was stored now; None means that the monitor follows the last
    one.
    """
    camera_id = evidence.camera_id
    monitored = found if isinstance(found, Monitored) else found.monitored
    last = record or estimates.newest(session, camera_id)
    if monitored is None or last is None or (record is None and monitored is not found):
        monitor_states.forget(session, camera_id)
        return
    session.flush()  # a new estimate gets its number
    state = whole_window_state(
        camera_id,
        basis_digest(evidence.monitor_basis, last.id),
        monitored,
        np.array([track.pk for track in evidence.tracks]),
        evidence.link_scale,
        evidence.limits.tracks_a_year,
    )
    if state is None:
        monitor_states.forget(session, camera_id)
    else:
        session.merge(state)


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
    found: ComputedEstimate,
) -> EstimateRecord:
    """The record while a reference is learned: the prior pose is served, without a verdict."""
    learning = (Reason(code=ServiceCode.LEARNING_REFERENCE),)
    record = _record(reference, evidence, found, Decision(state=CameraState.LEARNING), learning)
    record.identifiable, record.pose = [], PoseParameters.of_pose(evidence.prior)
    record.moved, record.moved_parameters = settings.moved_prior, {}
    return record


def _note_change(
    reference: SiteReferenceRecord, evidence: Evidence, assessment: Assessment
) -> None:
    """Begin the window at a change that was found, and keep its time, if that is known."""
    at, change = (
        assessment.estimated.change_idx,
        change_in(assessment.observed, assessment.estimated),
    )
    if at is not None and change is not None:
        reference.window_from_s = evidence.tracks[at].ended_s
        reference.changed_after_s, reference.changed_s = change


def _note_agreement(
    session: Session,
    reference: SiteReferenceRecord,
    evidence: Evidence,
    assessment: Assessment,
) -> None:
    """Count, once for each image, how the tracks compare with it."""
    picture, by_tracks = evidence.picture, assessment.moved_by_tracks
    if picture is None or by_tracks is None:
        return
    if not picture.was_told(last_estimate(session, reference)):
        pictures.note_agreement(session, evidence.camera_id, people_moved=by_tracks >= LIKELY)


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


def update_alerts(
    session: Session,
    settings: Settings,
    camera_id: str,
    drift: Drift,
    decision: Decision,
    reasons: Reasons,
    evidence: dict[str, Any],
) -> None:
    """Open, update or end the alerts that estimates raise: at most one of them is open."""
    firing, verdict = alerts.firing_by_estimates(session, camera_id), decision.verdict
    kind, moved = _kind_of(decision, firing), verdict.drifting
    note = fired_as(kind) if kind is not None and moved else None
    for before in firing - {kind}:
        end_alert(session, camera_id, before, Outcome.CLEARED, note=note)
    if kind is None or (moved and not drift.identifiable and not verdict.alarmed):
        return
    cause = decision.cause if moved else None
    after, since = times_of(decision.moved_at if moved else NO_TIME)
    open_alert(
        session,
        settings,
        camera_id,
        kind,
        Severity.CRITICAL if moved and verdict.excess >= 2 else Severity.WARNING,
        identifiable_drift(drift),
        since,
        reasons=reasons if cause is None else (cause,),
        changed_after=after,
        # Zones are reported with a move alone.
        evidence=evidence if kind is AlertKind.DRIFT else {**evidence, "zones": None},
    )


def _kind_of(decision: Decision, firing: set[AlertKind]) -> AlertKind | None:
    """The kind of the alert that is to be open; None if none is."""
    verdict = decision.verdict
    if not verdict.drifting:
        return AlertKind.UNSURE if decision.state == CameraState.UNSURE else None
    if decision.cause is not None:
        lens = decision.cause.code == TracksCode.LENS_CHANGED
        return AlertKind.LENS if lens else AlertKind.CLOCK
    # An alert about a scale keeps its name until an angle has drifted too.
    named = [kind for kind in SCALE_KINDS if kind in firing and verdict.drifted == ("height",)]
    return named[0] if named else AlertKind.DRIFT


def times_of(span: TimeSpan) -> tuple[datetime | None, datetime | None]:
    """A time span as the store keeps it."""
    after, before = (None if at_s is None else from_seconds(at_s) for at_s in span)
    return after, before


def _record(
    reference: SiteReferenceRecord,
    evidence: Evidence,
    found: ComputedEstimate,
    decision: Decision,
    reasons: Reasons,
) -> EstimateRecord:
    assessment = found.assessment
    chart, fused = assessment.chart, assessment.estimated.fused
    return record_of(
        reference,
        assessment.posterior,
        assessment.drift,
        decision,
        reasons,
        model_id=evidence.model_id,
        suspected=chart is not None and chart.suspicious,
        alternatives=alternatives_of(fused),
        detectable=detectable(assessment.detectable, evidence.prior),
        raw=_raw(evidence, found),
        tracks=len(found.tracks),
        from_s=min(track.started_s for track in found.tracks),
        to_s=found.tracks[-1].ended_s,
        newest_track_pk=found.newest_pk,
    )


def record_of(
    reference: SiteReferenceRecord,
    posterior: PosePosterior,
    drift: Drift,
    decision: Decision,
    reasons: Reasons,
    **by: Any,
) -> EstimateRecord:
    """The record of a decision; `by` are the columns about its input."""
    after, since = times_of(decision.moved_at)
    return EstimateRecord(
        camera_id=reference.camera_id,
        prior_pose_id=reference.prior_pose_id,
        reference_id=reference.id,
        state=PoseState(decision.state),
        reasons=reasons,
        identifiable=list(drift.identifiable),
        pose=PoseParameters.of_pose(pose_after(drift, posterior.prior)),
        pose_sd=drift.sd,
        covariance=posterior.covariance.tolist(),
        drift_by=drift.by,
        drift_angle_rad=drift.angle_rad,
        drift_streak=decision.verdict.streak,
        drifted=list(decision.verdict.drifted),
        moved=drift.move.moved,
        moved_parameters=dict(drift.move.parameters),
        drift_after=after,
        drift_since=since,
        created_at=_created_at(reference),
        **by,
    )


def _created_at(reference: SiteReferenceRecord) -> datetime:
    """Now, though a clock that was set back may say what is before the reference or its answer."""
    at = max(datetime.now(UTC), reference.ready_at or reference.created_at)
    if reference.answered_at is None:
        return at
    return max(at, reference.answered_at + timedelta(microseconds=1))


def _raw(evidence: Evidence, found: ComputedEstimate) -> dict[str, Any]:
    """Each estimator's own answer."""
    joint, averaged = found.assessment.estimated.joint, found.averaged
    registered = found.assessment.estimated.fused.raw_parameters
    raw: dict[str, Any] = {"joint": {**_plane(joint.raw_parameters), "tracks": joint.walkers}}
    if registered is not None:
        heading = {"heading_rad": registered.heading_rad, "tracks": joint.walkers}
        raw["registered"] = {**_plane(registered), **heading}
    if averaged is not None:
        raw["averaged"] = {**_plane(averaged.value), "tracks": averaged.tracks}
    if evidence.picture is not None:
        raw["picture"] = evidence.picture.raw
    return raw


def _plane(found: PoseParameters) -> dict[str, float]:
    return {"height_m": found.height_m, "tilt_rad": found.tilt_rad, "roll_rad": found.roll_rad}
