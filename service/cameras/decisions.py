"""Operators' answers about a pose: confirmed, accepted, put back, false alarm.

Each closes the alerts about the pose, keeps who said it, and ends what was estimated before.
"""

from sqlalchemy.orm import Session

from models.geometry.pose import ANGLES
from service.access.activity import note as note_activity
from service.alerts.alerts import close_alert, close_pose_alerts, leave_group, require_firing
from service.cameras.answers import Decision, state_before
from service.cameras.cameras import renew_prior_pose, require_camera
from service.cameras.held_poses import held_pose, keep_drawn
from service.cameras.poses import PoseView, view_pose
from service.enums import Activity, AlertKind, AlertState, Answer, Origin, Outcome
from service.errors import ConflictError, MalformedError
from service.estimate_queue import request_estimate
from service.job_queue import JobQueue
from service.references import begin_reference, keep_answer, made_against
from service.settings import Settings
from service.store import alerts, estimates, pictures, references, tracks
from service.store.alerts import AlertRecord


def accept_pose(
    session: Session, queue: JobQueue, settings: Settings, decision: Decision
) -> PoseView:
    """Make the served pose the new prior pose, close its alerts and begin a new reference.

    Raises:
        NotFoundError: there is no such camera.
        ConflictError: no pose was estimated yet, or its height may be a wrong clock's or lens's.
    """
    view = view_pose(session, settings, decision.camera_id)
    for kind in alerts.SCALE_KINDS:
        wrong = alerts.firing(session, decision.camera_id, kind)
        if wrong is not None:
            raise ConflictError(
                f"pose: its {kind} looks wrong, and a wrong {kind} looks like another height: end "
                f"alert {wrong.id} first, as fixed or false_alarm"
            )
    if not view.status.identifiable:
        raise ConflictError(f"pose: there is no estimate to accept: {view.reason}")
    held = held_pose(session, decision.camera_id)  # as long as the alert is open
    _close(session, decision, Outcome.ACCEPTED, Activity.POSE_ACCEPTED)
    from_s = tracks.newest_end_s(session, decision.camera_id)
    renew_prior_pose(
        session,
        queue,
        settings,
        decision.camera_id,
        view.pose,
        Origin.ACCEPTED,
        from_s=from_s,
        by=decision.by,
        covariance=None if held.covariance is None else held.covariance.tolist(),
    )
    keep_drawn(session, decision.camera_id, held)
    return view_pose(session, settings, decision.camera_id)


def confirm_pose(
    session: Session, queue: JobQueue, settings: Settings, decision: Decision
) -> PoseView:
    """Make the proposed pose the prior pose, with its uncertainty.

    The reference includes the tracks that were collected so far: the camera has not moved since.

    Raises:
        NotFoundError: unknown camera.
        ConflictError: the camera has a prior pose, or the proposed pose is not certain enough.
    """
    camera_id = decision.camera_id
    view = view_pose(session, settings, camera_id)
    proposed = view.proposed
    if view.calibrated or proposed is None or not proposed.told:
        why = "it has a prior pose already" if view.calibrated else view.reason
        raise ConflictError(f"pose: no pose can be confirmed: {why}")
    note_activity(
        session, Activity.POSE_CONFIRMED, by=decision.by, camera_id=camera_id, text=decision.note
    )
    held = held_pose(session, camera_id)
    renew_prior_pose(
        session,
        queue,
        settings,
        camera_id,
        proposed.pose,
        Origin.CONFIRMED,
        from_s=view.status.reference.from_s,
        by=decision.by,
        covariance=proposed.covariance,
    )
    keep_drawn(session, camera_id, held)
    return view_pose(session, settings, camera_id)


def put_back(session: Session, queue: JobQueue, settings: Settings, decision: Decision) -> PoseView:
    """Take a person's word that the camera is back at its prior pose; what was learned there holds.

    Raises:
        NotFoundError: there is no such camera.
    """
    require_camera(session, decision.camera_id)
    _answer(session, queue, decision, Answer.PUT_BACK)
    return view_pose(session, settings, decision.camera_id)


def learn_anew(
    session: Session, queue: JobQueue, settings: Settings, decision: Decision
) -> PoseView:
    """Take a person's word that the camera is at its prior pose, and learn it anew there.

    Raises:
        NotFoundError: there is no such camera.
    """
    require_camera(session, decision.camera_id)
    _close(session, decision, Outcome.RELEARNED, Activity.REFERENCE_RESET)
    from_s = tracks.newest_end_s(session, decision.camera_id)
    begin_reference(session, decision.camera_id, Origin.RESET, from_s=from_s, by=decision.by)
    pictures.forget(session, decision.camera_id)
    request_estimate(session, queue, decision.camera_id)
    return view_pose(session, settings, decision.camera_id)


def resolve_alert(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    alert_id: str,
    answer: Answer,
    note: str | None,
    by: str | None,
) -> AlertRecord:
    """End an alert with an outcome; an alert of the same kind may open again later.

    An answer about a camera's pose ends all its alerts about the pose. The members of a group end
    with it, except for cameras whose own estimate indicates a turn: an answer about the tracker is
    no answer about these, and their alerts fire on by themselves.

    Raises:
        NotFoundError: no alert has that id.
        ConflictError: it is resolved, or there is no pose to accept.
        MalformedError: its kind has no such outcome.
    """
    record = require_firing(session, alert_id)
    known = alerts.answers_of(record.kind)
    if answer not in known:
        raise MalformedError.of_field(
            "outcome",
            f"{' or '.join(known)} is what an alert of kind {record.kind} can come to, "
            f"got {answer}",
        )
    members = alerts.firing_members(session, record.id)
    turned = [each for each in members if _has_turned(session, each)]
    for each in turned:
        leave_group(session, each)
    for each in (*members, record):
        if each in turned or each.state != AlertState.FIRING:
            continue
        if each.camera_id is None or each.kind not in alerts.POSE_KINDS:
            close_alert(session, each, Outcome(answer), note, by)
            if each.camera_id and each.kind == AlertKind.PICTURE and answer == Answer.FALSE_ALARM:
                pictures.forget(session, each.camera_id)
            continue
        decision = Decision(camera_id=each.camera_id, by=by, note=note)
        if answer == Answer.ACCEPTED:
            accept_pose(session, queue, settings, decision)
        else:
            _answer(session, queue, decision, answer)
    return record


def _has_turned(session: Session, member: AlertRecord) -> bool:
    """True if the camera's newest estimate indicates a turn, which no clock can cause."""
    assert member.camera_id is not None
    last = estimates.newest(session, member.camera_id)
    if last is None or member.kind != AlertKind.DRIFT:
        return False
    reference = references.newest(session, member.camera_id)
    return made_against(reference, last) and not set(ANGLES).isdisjoint(last.drifted)


def _answer(session: Session, queue: JobQueue, decision: Decision, answer: Answer) -> None:
    """Have a camera judged against its prior pose by whoever comes from now on."""
    _close(session, decision, Outcome(answer), Activity(f"pose.{answer}"))
    keep_answer(session, decision.camera_id, answer, decision.by)
    if answer == Answer.FALSE_ALARM:
        pictures.forget(session, decision.camera_id)  # the next one is what all are compared with
    request_estimate(session, queue, decision.camera_id)


def _close(session: Session, decision: Decision, outcome: Outcome, what: Activity) -> None:
    """Close a camera's alerts about its pose, and keep who said what came of them."""
    camera_id, by, note = decision.camera_id, decision.by, decision.note
    details = {"before": state_before(session, camera_id)}
    close_pose_alerts(session, camera_id, outcome, by, note)
    note_activity(session, what, by=by, camera_id=camera_id, text=note, details=details)
