"""References: when one begins, which of a camera's tracks it is of, and which come after it."""

import math
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.enums import Answer, Origin
from service.settings import Settings
from service.store import cameras, estimates, references, tracks
from service.store.estimates import EstimateRecord
from service.store.references import SiteReferenceRecord
from service.store.windows import WindowBounds
from service.windows.attendance import Attendance, attendance_of


def begin_reference(
    session: Session,
    camera_id: str,
    origin: Origin,
    *,
    from_s: float | None,
    by: str | None = None,
    source: str | None = None,
) -> SiteReferenceRecord:
    """Have a camera's next tracks, that start at or after a time, say what is usual at its site.

    Those of a source; of the one that has counted so far, if none is said.
    """
    camera = cameras.find(session, camera_id)
    assert camera is not None
    last = references.newest_if_any(session, camera_id)
    if source is None and last is not None:
        source = last.source
    record = SiteReferenceRecord(
        camera_id=camera_id,
        prior_pose_id=cameras.prior_pose(session, camera_id).id,
        origin=origin,
        source=source,
        requested_by=by,
        from_s=from_s,
        wanted=camera.reference_tracks,
        tracks=0,
        doubts=(),
        created_at=datetime.now(UTC),
    )
    session.add(record)
    session.flush()
    return record


def window_of(session: Session, reference: SiteReferenceRecord, settings: Settings) -> WindowBounds:
    """The tracks that an estimate is made of.

    While a reference is being learned, those of its period; later, those that ended after it, from
    the newest change of the camera on. Never those of a time in which somebody was at the camera,
    nor, once there is a reference, those of before: it may stand elsewhere since.
    """
    attended = attendance_of(session, reference.camera_id, datetime.now(UTC))
    return window_beside(attended, reference, settings)


def window_beside(
    attended: Attendance, reference: SiteReferenceRecord, settings: Settings
) -> WindowBounds:
    """The same, where it is known when somebody was at the camera."""
    from_s = reference.from_s
    if reference.ready_at is not None and attended.judged_from_s is not None:
        from_s = max(from_s or 0.0, attended.judged_from_s)
    return WindowBounds(
        camera_id=reference.camera_id,
        tracks=settings.window_tracks,
        days=settings.window_days,
        started_from_s=from_s,
        ended_after_s=reference.to_s,
        ended_from_s=reference.window_from_s,
        without=attended.spans,
    )


def keep_answer(session: Session, camera_id: str, answer: Answer, by: str | None) -> None:
    """Judge a camera by tracks that are yet to come: a person says that it is at its prior pose.

    Its reference holds, if there is one. One that is being learned begins anew once the camera was
    put back: nobody knows how it stood meanwhile. So does one in doubt.
    """
    reference = references.newest(session, camera_id)
    newest_s = tracks.newest_end_s(session, camera_id)
    if answer == Answer.PUT_BACK and (reference.ready_at is None or reference.doubts):
        begin_reference(session, camera_id, Origin.PUT_BACK, from_s=newest_s, by=by)
    elif reference.ready_at is not None:
        if newest_s is not None:
            reference.window_from_s, reference.changed_s = math.nextafter(newest_s, math.inf), None
        reference.answer, reference.answered_by = answer, by
        reference.answered_at = datetime.now(UTC)
    forget_streak(session, camera_id)


def forget_streak(session: Session, camera_id: str) -> None:
    """Have a drift earn its updates anew: those so far were of before somebody was there."""
    last = estimates.newest(session, camera_id)
    if last is not None:
        last.drift_streak, last.drifted, last.drift_since = 0, [], None


def is_outdated(estimate: EstimateRecord, bounds: WindowBounds) -> bool:
    """Whether none of the tracks of an estimate could be in a window: it is of before."""
    return _is_before(estimate.to_s, bounds)


def made_against(reference: SiteReferenceRecord, estimate: EstimateRecord) -> bool:
    """Whether an estimate was made against a reference, not while that was being learned."""
    if reference.ready_at is None or estimate.reference_id != reference.id:
        return False
    if reference.answered_at is not None and estimate.created_at <= reference.answered_at:
        return False  # a person has answered it
    return estimate.created_at >= reference.ready_at


def is_overtaken(
    session: Session, settings: Settings, reference: SiteReferenceRecord, to_s: float
) -> bool:
    """Whether tracks, the last of which ended then, are of before: a person answered meanwhile."""
    bounds = window_of(session, reference, settings)
    return _is_before(to_s, bounds)


def _is_before(to_s: float, bounds: WindowBounds) -> bool:
    return to_s < max(bounds.started_from_s or 0.0, bounds.ended_from_s or 0.0)


def wanted_tracks(reference: SiteReferenceRecord, settings: Settings) -> int:
    """How many tracks a reference is learned of: no more than are kept."""
    return min(reference.wanted, settings.keep_tracks)


def tracks_so_far(reference: SiteReferenceRecord, settings: Settings, counted: int) -> int:
    """How many of the wanted tracks a reference has, by how many were counted if it is learning."""
    if reference.ready_at is not None:
        return reference.tracks
    return min(counted, wanted_tracks(reference, settings))
