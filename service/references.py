"""References: when one begins, what is of it; when somebody was there, or a move was suspected."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from models.durations import DAY_S
from models.monitoring.drift import DriftLimits
from service.enums import Answer, Origin, Outcome
from service.settings import Settings
from service.store import alerts, cameras, estimates, references, tracks
from service.store.alerts import AlertRecord
from service.store.cameras import CameraRecord
from service.store.estimates import EstimateRecord
from service.store.references import MaintenanceRecord, SiteReferenceRecord
from service.store.windows import WindowBounds


@dataclass(frozen=True, slots=True, kw_only=True)
class Attendance:
    """The times, from and to, in which somebody was or will be at a camera, by its windows.

    `judged_from_s` is when the last of them ended, or will, that has begun; what the camera saw
    before does not say how it stands after it. `announced` has when each window began, and when it
    was last told of or changed.
    """

    spans: tuple[tuple[float, float], ...]
    judged_from_s: float | None
    announced: tuple[tuple[float, datetime], ...]

    def announced_late(self, known_at: datetime, known_to_s: float) -> bool:
        """True where a window was told of after a time that reaches into what was known then."""
        return any(from_s <= known_to_s and at > known_at for from_s, at in self.announced)

    def free_since_s(self, now: datetime) -> float | None:
        """The time at which somebody last left the camera; None where nobody was there."""
        if not self.spans:
            return None  # nearly all of a fleet's cameras
        left = [to_s for _, to_s in self.spans if to_s <= now.timestamp()]
        return left[-1] if left else None

    def under_way(self, now: datetime) -> bool:
        """True while somebody is at the camera."""
        return any(from_s <= now.timestamp() < to_s for from_s, to_s in self.spans)


_UNATTENDED = Attendance(spans=(), judged_from_s=None, announced=())


def attendance_of(session: Session, camera_id: str, now: datetime) -> Attendance:
    """The times in which somebody was at a camera."""
    return attendance_by(references.maintenance_of(session, camera_id), now)


def attendance_by(records: Sequence[MaintenanceRecord], now: datetime) -> Attendance:
    """The same by windows in the order of their beginnings; overlapping ones are one time."""
    if not records:
        return _UNATTENDED  # nearly all of a fleet's cameras
    spans: list[tuple[float, float]] = []
    for record in records:
        from_s, to_s = record.from_at.timestamp(), record.until.timestamp()
        if spans and from_s <= spans[-1][1]:
            spans[-1] = (spans[-1][0], max(spans[-1][1], to_s))
        else:
            spans.append((from_s, to_s))
    begun = [to_s for from_s, to_s in spans if from_s <= now.timestamp()]
    return Attendance(
        spans=tuple(spans),
        judged_from_s=begun[-1] if begun else None,
        announced=tuple((record.from_at.timestamp(), record.updated_at) for record in records),
    )


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
    camera = session.get(CameraRecord, camera_id)
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
    put back, or its clock mended: nobody knows how it was meanwhile. So does one in doubt.
    """
    reference = references.newest(session, camera_id)
    newest_s = tracks.newest_end_s(session, camera_id)
    if answer != Answer.FALSE_ALARM and (reference.ready_at is None or reference.doubts):
        begin_reference(session, camera_id, Origin.PUT_BACK, from_s=newest_s, by=by)
    elif reference.ready_at is not None:
        if newest_s is not None:
            reference.window_from_s = math.nextafter(newest_s, math.inf)
            reference.changed_after_s = reference.changed_s = None
        reference.answer, reference.answered_by = answer, by
        reference.answered_at = datetime.now(UTC)
    forget_streak(session, camera_id)


def forget_streak(session: Session, camera_id: str) -> None:
    """Have a drift earn its updates anew: those so far were of before somebody was there."""
    last = estimates.newest(session, camera_id)
    if last is not None:
        last.drift_streak, last.drifted = 0, []
        last.drift_after = last.drift_since = None


def is_before(to_s: float, bounds: WindowBounds) -> bool:
    """True where tracks that ended by a time are of before a window: none could be in it."""
    return to_s < max(bounds.started_from_s or 0.0, bounds.ended_from_s or 0.0)


def made_against(reference: SiteReferenceRecord, estimate: EstimateRecord) -> bool:
    """True if an estimate was made against a reference, and not while that was being learned.

    Without tracks nothing is learned: an estimate by images alone is against the prior pose.
    """
    if estimate.reference_id != reference.id:
        return False
    if reference.answered_at is not None and estimate.created_at <= reference.answered_at:
        return False  # a person has answered it
    if reference.ready_at is None:
        return reference.source is None
    return estimate.created_at >= reference.ready_at


def wanted_tracks(reference: SiteReferenceRecord, settings: Settings) -> int:
    """The number of people a reference is learned of: no more than tracks are kept."""
    return min(reference.wanted, settings.keep_tracks)


def people_so_far(reference: SiteReferenceRecord, settings: Settings, tracks: int) -> int:
    """The number of wanted people that a reference has, by its tracks and the pieces among them.

    Until tracks are looked at, each counts as somebody.
    """
    people = max(tracks - reference.pieces, 0)
    return people if reference.ready_at else min(people, wanted_tracks(reference, settings))


def drift_limits(settings: Settings) -> DriftLimits:
    """The limits from which on a drift counts, by the settings."""
    return DriftLimits(
        certainty=settings.drift_certainty,
        floor_rad=math.radians(settings.drift_floor_deg),
        floor_m=settings.drift_floor_m,
        people=settings.drift_people,
        clear_ratio=settings.drift_clear_ratio,
    )


_SAME_S = 1e-3  # times in the store are whole microseconds


@dataclass(frozen=True, slots=True, kw_only=True)
class SuspectedMove:
    """A time, from `from_s` to `to_s`, in which an alert took a camera for moved.

    It is `excluded` from what is known to be still unless a person called it a false alarm;
    `by_person` says whether anybody said what it was.
    """

    from_s: float
    to_s: float
    resolved_at: datetime
    excluded: bool
    by_person: bool


def suspected_moves(
    session: Session, settings: Settings, reference: SiteReferenceRecord
) -> tuple[SuspectedMove, ...]:
    """The ended ones of a camera that reach beyond the period of a reference."""
    found = [_move_of(record, settings) for record in alerts.ended(session, reference.camera_id)]
    return tuple(move for move in found if move and _concerns(move, reference))


def _move_of(record: AlertRecord, settings: Settings) -> SuspectedMove | None:
    if record.resolved_at is None:
        return None
    began = record.changed_after or record.changed_at
    if began is not None:
        from_s = began.timestamp() - _SAME_S
    else:  # it was fired by a window of tracks
        from_s = record.opened_at.timestamp() - settings.window_days * DAY_S
    return SuspectedMove(
        from_s=from_s,
        to_s=record.resolved_at.timestamp(),
        resolved_at=record.resolved_at,
        excluded=record.outcome != Outcome.FALSE_ALARM,
        by_person=record.outcome in alerts.ANSWERS,
    )


def _concerns(move: SuspectedMove, reference: SiteReferenceRecord) -> bool:
    if move.to_s <= (reference.to_s or 0.0):
        return False
    # A reset or a new prior pose has answered it, for whatever comes after; tracks may be posted
    # long after they were walked, so that their times alone do not show it.
    answered = move.resolved_at <= reference.created_at
    return not (answered and move.from_s < (reference.from_s or 0.0))
