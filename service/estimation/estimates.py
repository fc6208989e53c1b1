"""Judge what the tracks of a window come to: a stored estimate, its alerts and its training."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from models.durations import DAY_S
from models.geometry.pose import PLANE_PARAMETERS, PoseParameters
from models.monitoring.verdict import (
    LIKELY,
    Drift,
    DriftVerdict,
    charted_clock,
    clock_fault,
    judge,
    may_be_clock,
    pose_after,
    reason_of_chart,
    reason_of_creep,
    reason_of_drift,
)
from models.pose import PosePosterior, WindowState, drift_of, is_site_changed, state_of
from models.reasons import Reason
from service.alerts.alerts import end_alert, fired_by_estimate, open_alert
from service.degrees import in_degrees
from service.enums import AlertKind, Answer, EventType, Outcome, PoseState, Severity
from service.estimation.alert_evidence import alert_evidence, rivals_of, would_notice
from service.estimation.evidence import Evidence, SeenTrack
from service.estimation.finding import Finding
from service.job_queue import JobQueue
from service.reasons import Reasons, ServiceCode, some
from service.references import is_before, made_against, window_of
from service.settings import Settings
from service.store import estimates, journal, pictures, references
from service.store.alerts import MOVED_KINDS
from service.store.cameras import CameraRecord
from service.store.estimates import EstimateRecord, identifiable_drift
from service.store.references import LastPoseRecord, SiteReferenceRecord
from service.training import train_at_edge
from service.wording.alerts import fired_as
from service.wording.times import from_seconds

_UNJUDGED = DriftVerdict(streak=0, excess=0.0, drifted=())


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """Earlier findings of a camera.

    `last` is the newest estimate against its reference, `drifted` what had drifted as long as an
    alert says so; `unsure`, as long as an alert says that nobody walks on the paths.
    """

    last: EstimateRecord | None
    drifted: tuple[str, ...]
    unsure: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """A camera's state by a finding, and `since` when, where it has moved.

    `after` is when it last stood where it should, as far as is known. `clock` is why its clock or
    frame rate looks wrong.
    """

    state: PoseState
    reasons: Reasons
    verdict: DriftVerdict = _UNJUDGED
    after: datetime | None = None
    since: datetime | None = None
    clock: Reason | None = None


def save_estimate(
    session: Session, queue: JobQueue, settings: Settings, evidence: Evidence, finding: Finding
) -> EstimateRecord | None:
    """Judge the drift of a finding and store it; None if its reference no longer counts.

    A reference that has become ready, or another one that has begun, has a job of its own. So has
    what comes after a person has answered or was at the camera.
    """
    reference = _counting_reference(session, settings, evidence)
    camera = session.get(CameraRecord, evidence.camera_id)
    if reference is None or camera is None:
        return None
    drift = drift_of(finding.posterior, finding.fused)
    if evidence.site is None:
        learning = (Reason(code=ServiceCode.LEARNING_REFERENCE),)
        judgement = Judgement(state=PoseState.LEARNING, reasons=learning)
        record = _record(reference, evidence, finding, drift, judgement)
        record.identifiable, record.pose = [], PoseParameters.of_pose(evidence.prior)
        record.moved, record.moved_parameters = settings.moved_prior, {}
    else:
        if finding.change is not None:
            reference.window_from_s = finding.change.ended_s
            reference.changed_after_s, reference.changed_s = _change_of(evidence, finding.change)
        history = history_of(session, reference)
        picture = finding.picture
        if finding.people_moved is not None and picture and not picture.was_told(history.last):
            pictures.note_agreement(session, camera.id, people_moved=finding.people_moved)
        judgement = _judge(reference, history, evidence, finding, drift, camera.frame_rate_hz)
        record = _record(reference, evidence, finding, drift, judgement)
        pose = pose_after(drift, evidence.prior)
        train_at_edge(session, queue, settings, camera.id, pose, drift.identifiable)
        kept = alert_evidence(finding, evidence.prior)
        update_alerts(session, settings, camera.id, drift, judgement, kept)
    session.add(record)
    tell_estimate(session, record, drift)
    if finding.last is not None:
        session.merge(finding.last)
    elif (last := session.get(LastPoseRecord, reference.id)) is not None:
        session.delete(last)
    return record


def tell_estimate(session: Session, record: EstimateRecord, drift: Drift) -> None:
    """Add the event of an estimate that was stored."""
    payload = {
        "camera_id": record.camera_id,
        "state": record.state,
        "tracks": record.tracks,
        "drift": in_degrees(identifiable_drift(drift)) if record.identifiable else None,
    }
    journal.add_event(session, EventType.POSE, payload, record.created_at)


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


def history_of(session: Session, reference: SiteReferenceRecord) -> History:
    """The earlier findings of a camera, and what of them counts against its reference."""
    camera_id = reference.camera_id
    last = estimates.newest(session, camera_id)
    if last is not None and not made_against(reference, last):
        last = None
    firing = fired_by_estimate(session, camera_id)
    unsure = AlertKind.UNSURE in firing
    if not firing & set(MOVED_KINDS):
        return History(last=last, drifted=(), unsure=unsure)
    # An alert of before this reference stands until what is seen after it ends it.
    before = last or estimates.newest_of_earlier(session, camera_id, reference.id)
    drifted = () if before is None else tuple(before.drifted)
    return History(last=last, drifted=drifted or PLANE_PARAMETERS, unsure=unsure)


def _judge(
    reference: SiteReferenceRecord,
    history: History,
    evidence: Evidence,
    finding: Finding,
    drift: Drift,
    frame_rate_hz: float | None,
) -> Judgement:
    """The judgement of an estimate after its reference."""
    clock = clock_fault(drift, finding.posterior.turned, evidence.prior, frame_rate_hz)
    gone = finding.fused.paths_changed
    reading, creep = finding.reading, finding.creep
    if reading is not None and clock is None and not history.drifted and may_be_clock(reading):
        reading = None
    enough = finding.enough or finding.posterior.pictured
    if finding.posterior.pictured and drift.move.moved < LIKELY:
        reading = None  # people walk otherwise, before a camera that stands
    verdict = judge(drift, evidence.limits, history.drifted, reading, creep, enough=enough)
    otherwise = is_site_changed(finding.posterior, finding.fused) and not verdict.drifting
    reasons = some(
        Reason(code=ServiceCode.SITE_CHANGED) if otherwise else None,
        finding.fused.reason if gone else None,
        None if creep is None else reason_of_creep(creep),
        reason_of_drift(drift, verdict, evidence.limits),
        finding.picture.reason if finding.picture and finding.posterior.pictured else None,
        clock,
        None if finding.reading is None else reason_of_chart(finding.reading),
        None if gone else finding.fused.reason,
        None if set(PLANE_PARAMETERS) <= set(drift.identifiable) else finding.joint.reason,
        *reference.doubts,
        finding.pieces,
        *finding.failures,
    )
    if clock is None and reading is not None and verdict.alarmed:
        clock = charted_clock(reading, finding.posterior.turned)
    state = _state(reference, history, verdict, evidence, finding)
    after, since = _since(reference, history, verdict, evidence, finding, state)
    return Judgement(
        state=state,
        reasons=reasons,
        verdict=verdict,
        after=after,
        since=since,
        clock=clock,
    )


def _state(
    reference: SiteReferenceRecord,
    history: History,
    verdict: DriftVerdict,
    evidence: Evidence,
    finding: Finding,
) -> PoseState:
    """The state of a camera.

    Of fewer people than `enough`, nothing is said against what somebody said. That people walk on
    none of the paths is so until some are found to walk there again.
    """
    mapped = evidence.flow is not None
    found = state_of(finding.posterior, finding.fused, drifting=verdict.drifting, mapped=mapped)
    # People walk elsewhere before a camera that stands: the reasons say so.
    state = PoseState.OK if found is WindowState.SITE_CHANGED else PoseState(found)
    if finding.posterior.pictured:
        return state
    fits = finding.enough and (finding.fused.registered or not mapped)
    if history.unsure and not fits and state != PoseState.DRIFTING:
        return PoseState.UNSURE
    if finding.enough or state in (PoseState.DRIFTING, PoseState.OK):
        return state
    return PoseState.OK if reference.answer == Answer.FALSE_ALARM else PoseState.LEARNING


def _change_of(evidence: Evidence, change: SeenTrack) -> tuple[float | None, float]:
    """The end of the last track before a change and the begin of the first after it."""
    at = evidence.tracks.index(change)
    return (evidence.tracks[at - 1].ended_s if at else None), change.started_s


def _since(
    reference: SiteReferenceRecord,
    history: History,
    verdict: DriftVerdict,
    evidence: Evidence,
    finding: Finding,
    state: PoseState,
) -> tuple[datetime | None, datetime | None]:
    """The times between which the camera moved, or is suspected to, as far as the tracks tell."""
    last = history.last
    before = (None, None) if last is None else (last.drift_after, last.drift_since)
    if verdict.streak <= 0 and state != PoseState.SUSPECTED:
        return before if verdict.drifting else (None, None)
    if reference.changed_s is not None:
        return _between(reference.changed_after_s, reference.changed_s)
    if before[1] is not None:
        return before
    # As was learned; or as somebody said, whose answer has the window begin.
    stood_s = max(reference.to_s or 0.0, reference.window_from_s or 0.0)
    reading, creep = finding.reading, finding.creep
    if reading is not None and reading.moved:
        at = reading.track_idx
        ended_s = evidence.tracks[at - 1].ended_s if at else stood_s
        return _between(ended_s, evidence.tracks[at].started_s)
    if creep is not None and creep.moved:
        return None, _at(creep.since_day * DAY_S)
    # One pose since the reference, and never another one: it had moved before all of them.
    if last is None:
        return _between(stood_s, finding.tracks[0].ended_s)
    return _between(last.to_s, finding.tracks[-1].ended_s)


def _between(stood_s: float | None, moved_s: float) -> tuple[datetime | None, datetime | None]:
    """The times of a move between a person before it and one after it, who may overlap."""
    if stood_s is None:
        return None, _at(moved_s)
    return _at(min(stood_s, moved_s)), _at(max(stood_s, moved_s))


def _at(time_s: float | None) -> datetime | None:
    return None if time_s is None else from_seconds(time_s)


def update_alerts(
    session: Session,
    settings: Settings,
    camera_id: str,
    drift: Drift,
    judgement: Judgement,
    evidence: dict[str, Any],
) -> None:
    """Open, update or end the alerts that an estimate stands behind."""
    firing, verdict = fired_by_estimate(session, camera_id), judgement.verdict
    of_no_move = {**evidence, "zones": None}
    if not verdict.drifting:
        unsure = judgement.state == PoseState.UNSURE
        for kind in firing - {AlertKind.UNSURE} if unsure else firing:
            end_alert(session, camera_id, kind, Outcome.CLEARED)
        if unsure:
            open_alert(
                session,
                settings,
                camera_id,
                AlertKind.UNSURE,
                Severity.WARNING,
                identifiable_drift(drift),
                None,
                reasons=judgement.reasons,
                evidence=of_no_move,
            )
        return
    # What was named a clock fault stays one until an angle has drifted too.
    still_clock = AlertKind.CLOCK in firing and verdict.drifted == ("height",)
    clock = judgement.clock is not None or still_clock
    kind = AlertKind.CLOCK if clock else AlertKind.DRIFT
    for before in firing - {kind}:
        end_alert(session, camera_id, before, Outcome.CLEARED, note=fired_as(kind))
    if drift.identifiable or verdict.alarmed:
        open_alert(
            session,
            settings,
            camera_id,
            kind,
            Severity.CRITICAL if verdict.excess >= 2 else Severity.WARNING,
            identifiable_drift(drift),
            judgement.since,
            reasons=judgement.reasons if judgement.clock is None else (judgement.clock,),
            changed_after=judgement.after,
            evidence=of_no_move if clock else evidence,
        )


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
        # A clock that was set back must not make it older than the reference that it was held to.
        created_at=max(datetime.now(UTC), reference.ready_at or reference.created_at),
        **by,
    )


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
