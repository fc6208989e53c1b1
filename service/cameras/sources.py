"""Sources of tracks: a camera's reference is of one of them, and no other moves its pose.

Tracks of another source are stored beside. Once they would make a reference, and the source that
counts has fallen silent, they do; a person may say so at any time.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection
from sqlalchemy.orm import Session

from models.durations import HOUR_S
from models.reasons import Reason, Value
from service.access.activity import note
from service.access.claims import may_claim, require_own
from service.access.tokens import Caller
from service.alerts.alerts import end_alert, open_alert
from service.cameras.cameras import require_camera
from service.cameras.image_sizes import declared_size, forget_sizes
from service.enums import Activity, AlertKind, AlertSource, Origin, Outcome, PoseState, Severity
from service.errors import ConflictError, NotFoundError, TooManySourcesError
from service.estimate_queue import request_estimate
from service.formats.scaling import ImageSize
from service.job_queue import JobQueue
from service.reasons import ServiceCode
from service.references import (
    attendance_of,
    begin_reference,
    is_before,
    made_against,
    suspected_moves,
    wanted_tracks,
    window_of,
)
from service.settings import Settings
from service.store import alerts, estimates, references, sources
from service.store.cameras import CameraRecord
from service.store.engines.store import joined
from service.store.references import SiteReferenceRecord
from service.store.sources import SourceRecord
from service.wording.alerts import ONE_SOURCE_POSTS, source_change


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceView:
    """A source as clients see it. `usable` of `wanted` tracks would make a reference of it.

    `image_size` is declared for its posts that state none.
    """

    record: SourceRecord
    counts: bool
    usable: int
    wanted: int
    image_size: ImageSize | None = None


def note_source(
    connection: Connection,
    camera_id: str,
    name: str,
    stored: int,
    max_sources: int,
    caller: Caller | None,
) -> None:
    """Take down that a source has posted. Where access is off there is no `caller`.

    Raises:
        ForbiddenError: the name is another token's.
        TooManySourcesError: it is new, and the camera has as many as it may have.
    """
    now = datetime.now(UTC)
    token_id = None if caller is None else caller.token_id
    shared = caller is None or caller.has_source(name)
    if sources.note_seen(connection, camera_id, name, stored, now, token_id, shared=shared):
        return
    with joined(connection) as session:
        record = sources.find(session, camera_id, name)
        require_own(session, caller, camera_id, name, None if record is None else record.token_id)
        if record is not None:  # of a token that is over
            record.token_id, record.last_seen_at = token_id, now
            record.tracks += stored
            return
        _make_room(session, camera_id, name, max_sources)
        record = SourceRecord(
            camera_id=camera_id,
            name=name,
            tracks=stored,
            first_seen_at=now,
            last_seen_at=now,
            token_id=token_id,
        )
        session.add(record)


def list_sources(session: Session, settings: Settings, camera_id: str) -> list[SourceView]:
    """The sources of a camera, the first to post first.

    Raises:
        NotFoundError: there is no such camera.
    """
    camera = require_camera(session, camera_id)
    reference = references.newest(session, camera_id)
    return [
        SourceView(
            record=record,
            counts=record.name == reference.source,
            usable=_usable(session, settings, reference, record.name),
            wanted=min(camera.reference_tracks, settings.keep_tracks),
            image_size=declared_size(camera, record.name),
        )
        for record in sources.of_camera(session, camera_id)
    ]


def selectable_sources(
    session: Session, settings: Settings, camera_id: str
) -> tuple[SourceView, ...]:
    """The sources of a camera; none where there is but one, which nobody has to choose."""
    if len(sources.of_camera(session, camera_id)) < 2:
        return ()
    return tuple(list_sources(session, settings, camera_id))


def use_source(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    camera_id: str,
    name: str,
    by: str | None,
) -> None:
    """Take a person's word that a source is to count; nothing changes where it does.

    Its reference is of its tracks of when the camera was known to be still; where the camera is in
    doubt, of those that are yet to come.

    Raises:
        NotFoundError: there is no such camera, or it has no such source.
    """
    record = _require(session, camera_id, name)
    reference = references.newest(session, camera_id)
    if reference.source == name:
        return
    from_s = _still_from_s(session, settings, reference)
    if reference.ready_at is not None and not _is_well(session, settings, reference):
        from_s = sources.newest_end_s(session, camera_id, name)
    # Who chose knows of the other one: it is not told of, though it goes on.
    _count(session, queue, record, from_s, by, told_at=datetime.now(UTC))


def remove_source(session: Session, camera_id: str, name: str, by: str | None) -> None:
    """Delete a source with its tracks.

    Raises:
        NotFoundError: there is no such camera, or it has no such source.
        ConflictError: it counts.
    """
    record = _require(session, camera_id, name)
    if references.newest(session, camera_id).source == name:
        raise ConflictError(f"source: {name!r} counts; say first which one is to count instead")
    sources.forget(session, record)
    forget_sizes(require_camera(session, camera_id), [name])
    note(session, Activity.SOURCE_REMOVED, by=by, camera_id=camera_id, text=name)


def watch_sources(
    session: Session, queue: JobQueue, settings: Settings, camera_id: str, now: datetime
) -> str | None:
    """Tell of new sources, and let one take over from a silent one; says what it did."""
    found = sources.of_camera(session, camera_id)
    if len(found) < 2:
        return None
    reference = references.newest(session, camera_id)
    others = [record for record in found if record.name != reference.source]
    counting = next((record for record in found if record.name == reference.source), None)
    for record in sorted(others, key=lambda each: each.last_seen_at, reverse=True):
        silent = counting is None or _is_silent(session, settings, counting, record)
        silent = silent and may_claim(session, record.token_id, camera_id)
        if silent and _is_ready(session, settings, reference, record.name):
            _count(session, queue, record, _still_from_s(session, settings, reference), None)
            return f"the tracks of {record.name!r} count now"
    silent_for = timedelta(hours=settings.source_silent_h)
    posting = [record for record in others if now - record.last_seen_at < silent_for]
    if not posting:
        end_alert(session, camera_id, AlertKind.TRACKER, Outcome.CLEARED, note=ONE_SOURCE_POSTS)
        return None
    if all(record.told_at is not None for record in posting):
        return None
    opened = open_alert(
        session,
        settings,
        camera_id,
        AlertKind.TRACKER,
        Severity.WARNING,
        {},
        None,
        reasons=(_reason(settings, reference, posting),),
        source=AlertSource.TRACKS,
    )
    if opened is None:
        return None
    for record in posting:
        record.told_at = record.told_at or now
    return "a new source of tracks"


def _require(session: Session, camera_id: str, name: str) -> SourceRecord:
    require_camera(session, camera_id)
    record = sources.find(session, camera_id, name)
    if record is None:
        raise NotFoundError(f"source: camera {camera_id!r} has no source {name!r}")
    return record


def _make_room(session: Session, camera_id: str, name: str, most: int) -> None:
    """Forget sources of which nothing is left, where there is no room for one more."""
    known = sources.of_camera(session, camera_id)
    if len(known) < most:
        return
    reference = references.newest(session, camera_id)
    gone = [
        record
        for record in known
        if record.name != reference.source
        and sources.newest_end_s(session, camera_id, record.name) is None
    ]
    for record in gone:
        session.delete(record)
    if len(known) - len(gone) >= most:
        raise TooManySourcesError(
            f"source: at most {most} a camera are taken, {name!r:.60} would be one more; "
            "delete one that posts no longer"
        )


def _count(
    session: Session,
    queue: JobQueue,
    record: SourceRecord,
    from_s: float | None,
    by: str | None,
    told_at: datetime | None = None,
) -> None:
    """Have a source's tracks make the reference from now on; the former was `told_at` of."""
    camera_id, last = record.camera_id, references.newest(session, record.camera_id).source
    begin_reference(session, camera_id, Origin.SOURCE, from_s=from_s, by=by, source=record.name)
    former = None if last is None else sources.find(session, camera_id, last)
    if former is not None:
        former.told_at = told_at  # if not yet, it is new again should it come back
    words = source_change(record.name, last)
    end_alert(session, camera_id, AlertKind.TRACKER, Outcome.CLEARED, note=f"now counts: {words}")
    note(session, Activity.SOURCE_USED, by=by, camera_id=camera_id, text=words)
    request_estimate(session, queue, camera_id)


def _is_silent(
    session: Session, settings: Settings, counting: SourceRecord, other: SourceRecord
) -> bool:
    """True if the source that counts has fallen silent where another has not.

    By when they post and by the times of their tracks: some post once a day.
    """
    silent_s = settings.source_silent_h * HOUR_S
    if (other.last_seen_at - counting.last_seen_at).total_seconds() < silent_s:
        return False
    ends = [
        sources.newest_end_s(session, record.camera_id, record.name) for record in (other, counting)
    ]
    return ends[0] is not None and (ends[1] is None or ends[0] - ends[1] >= silent_s)


def _is_ready(
    session: Session, settings: Settings, reference: SiteReferenceRecord, name: str
) -> bool:
    """True if a source's tracks would make a reference of a camera that is where it should be."""
    if reference.ready_at is None:
        return True  # nobody has judged the camera by now
    if not _is_well(session, settings, reference):
        return False
    camera = session.get(CameraRecord, reference.camera_id)
    assert camera is not None
    wanted = min(camera.reference_tracks, settings.keep_tracks)
    return _usable(session, settings, reference, name) >= wanted


def _usable(session: Session, settings: Settings, reference: SiteReferenceRecord, name: str) -> int:
    """Count of a source's tracks that were seen while the camera was known to be still."""
    attended = attendance_of(session, reference.camera_id, datetime.now(UTC))
    from_s = _still_from_s(session, settings, reference)
    return sources.count_from(session, reference.camera_id, name, from_s, attended.spans)


def _still_from_s(
    session: Session, settings: Settings, reference: SiteReferenceRecord
) -> float | None:
    """Since when a camera is known to have been still, if it is by now."""
    ended = [each.to_s for each in suspected_moves(session, settings, reference) if each.excluded]
    began = [] if reference.from_s is None else [reference.from_s]
    return max([*began, *ended], default=None)


def _is_well(session: Session, settings: Settings, reference: SiteReferenceRecord) -> bool:
    """True if the source that counts said last that the camera is where it should be."""
    camera_id = reference.camera_id
    last = estimates.newest(session, camera_id)
    if last is None or not made_against(reference, last) or last.state != PoseState.OK:
        return False
    if last.drift_streak > 0 or last.drifted or last.suspected:
        return False
    if alerts.pose_doubted(session, camera_id):
        return False
    return not is_before(last.to_s, window_of(session, reference, settings))


def _reason(
    settings: Settings, reference: SiteReferenceRecord, posting: Sequence[SourceRecord]
) -> Reason:
    values: dict[str, Value] = {
        "sources": [record.name for record in posting],
        "silent_s": settings.source_silent_h * HOUR_S,
        "wanted": wanted_tracks(reference, settings),
    }
    if reference.source is not None:
        values["counting"] = reference.source
    return Reason(code=ServiceCode.OTHER_SOURCES, values=values)
