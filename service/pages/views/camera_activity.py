"""Who did what when at a camera, for its page."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from service.enums import Activity, AlertKind, Outcome
from service.store import activity

_MOST = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class ActivityEntry:
    """What was done; `by` is None where the service did it by itself, or nobody said a name.

    `what` is as the log has it (`access.activity`). `kind` is the alert's, `until` of a
    silence or of maintenance, `outcome` of an alert.
    """

    at: datetime
    what: Activity
    by: str | None
    kind: AlertKind | None = None
    until: datetime | None = None
    outcome: Outcome | None = None
    note: str | None = None


def activity_of(session: Session, camera_id: str) -> tuple[ActivityEntry, ...]:
    """What was done last at a camera, newest first."""
    return tuple(
        ActivityEntry(
            at=entry.at,
            what=entry.what,
            by=entry.by,
            kind=entry.kind,
            until=entry.until,
            outcome=entry.outcome,
            note=entry.note,
        )
        for entry in activity.newest(session, camera_id, _MOST)
    )
