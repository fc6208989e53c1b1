"""A shift as it is handed over: what was told and done in it, what is open, and a note to the next.

A handover is an entry of the log, and so is that somebody took it over: until then it is shown.
"""

import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.access.activity import note as note_activity
from service.enums import Activity, AlertState
from service.errors import ConflictError, NotFoundError
from service.notifications.outbox import json_time
from service.store import alerts, fleet, journal
from service.store.alerts import POSE_KINDS, AlertFilter, AlertRecord
from service.store.journal import ActivityRecord
from service.store.references import MaintenanceRecord
from service.wording.alerts import entry_words, is_action
from service.wording.times import Clock

LAST = 20  # handovers: what nobody has taken is among them
_MOST_ALERTS, _MOST_ACTIONS = 500, 5_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Handover:
    """What somebody hands over to whoever comes next; `taken_by` is None until somebody does."""

    id: str
    at: datetime
    since: datetime
    by: str | None
    note: str | None
    taken_by: str | None
    taken_at: datetime | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Deed:
    """What was done, in a sentence, last `at` a time, and the cameras by id and name."""

    words: str
    at: datetime
    cameras: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """What was from a time until now; groups speak for their members. `more` is left out of it."""

    told: Sequence[AlertRecord]
    open: Sequence[AlertRecord]
    deeds: Sequence[Deed]
    maintenance: Sequence[MaintenanceRecord]
    names: dict[str, str]
    more: bool


def make_shift(session: Session, since: datetime, clock: Clock) -> Shift:
    """The shift from a time until now."""
    found = {
        name: alerts.listed(session, wanted, clock.now, _MOST_ALERTS + 1, lean=True)
        for name, wanted in (
            ("told", AlertFilter(opened_from=since)),
            ("open", AlertFilter(state=AlertState.FIRING)),
        )
    }
    names = dict(fleet.names(session, None))
    most = _MOST_ACTIONS + 1
    entries = journal.activity_after(session, None, 0, most, since=since, from_newest=True)
    windows = fleet.maintenance_windows(session, None)
    return Shift(
        **{
            name: [each for each in records[:_MOST_ALERTS] if each.group_id is None]
            for name, records in found.items()
        },
        deeds=_deeds(entries[:_MOST_ACTIONS], names, clock),
        maintenance=[each for some in windows.values() for each in some if each.holds(clock.now)],
        names=names,
        more=len(entries) > _MOST_ACTIONS or any(len(e) > _MOST_ALERTS for e in found.values()),
    )


def _deeds(entries: Sequence[ActivityRecord], names: dict[str, str], clock: Clock) -> list[Deed]:
    """What people did, the last first as the entries are; the same with many cameras is one."""
    cameras: dict[str, dict[str, str]] = {}
    last: dict[str, datetime] = {}
    for entry in entries:
        # The end of an alert about the pose is told by the answer about its camera.
        ended = entry.what == Activity.ALERT_RESOLVED and entry.camera_id is not None
        if (ended and entry.kind in POSE_KINDS) or not is_action(entry):
            continue
        words = entry_words(entry, clock)
        mine = cameras.setdefault(words, {})
        if entry.camera_id is not None:
            mine[entry.camera_id] = names.get(entry.camera_id, entry.camera_id)
        last.setdefault(words, entry.at)
    return [
        Deed(words=words, at=last[words], cameras=tuple(reversed(mine.items())))
        for words, mine in cameras.items()
    ]


def hand_over(session: Session, since: datetime, text: str | None, by: str | None) -> Handover:
    """Keep a handover, for the next to take."""
    handover_id = secrets.token_hex(16)
    note_activity(
        session,
        Activity.HANDOVER_GIVEN,
        by=by,
        subject_id=handover_id,
        text=text,
        details={"since": json_time(since)},
    )
    session.flush()
    return _find(session, handover_id)


def _find(session: Session, handover_id: str) -> Handover:
    """A handover.

    Raises:
        NotFoundError: there is none of that id.
    """
    entries = {each.what: each for each in journal.activity_of_subject(session, handover_id)}
    if Activity.HANDOVER_GIVEN not in entries:
        raise NotFoundError(f"handover_id: there is no handover {handover_id!r}")
    return _handover(entries[Activity.HANDOVER_GIVEN], entries.get(Activity.HANDOVER_TAKEN))


def take_over(session: Session, handover_id: str, by: str | None) -> Handover:
    """Note who has taken a handover over.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: somebody has taken it.
    """
    found = _find(session, handover_id)
    if found.taken_at is not None:
        raise ConflictError(f"handover: {found.taken_by or 'somebody'} has taken it over")
    note_activity(session, Activity.HANDOVER_TAKEN, by=by, subject_id=handover_id)
    session.flush()
    return _find(session, handover_id)


def last_handovers(session: Session, limit: int = LAST) -> list[Handover]:
    """The handovers that were given last, newest first."""
    given = journal.newest_entries(session, Activity.HANDOVER_GIVEN, limit)
    taken = journal.entries_about(session, Activity.HANDOVER_TAKEN, [e.subject_id for e in given])
    return [_handover(entry, taken.get(entry.subject_id)) for entry in given]


def _handover(given: ActivityRecord, taken: ActivityRecord | None) -> Handover:
    return Handover(
        id=str(given.subject_id),
        at=given.at,
        since=datetime.fromisoformat(given.details["since"]).astimezone(UTC),
        by=given.by,
        note=given.note,
        taken_by=None if taken is None else taken.by,
        taken_at=None if taken is None else taken.at,
    )
