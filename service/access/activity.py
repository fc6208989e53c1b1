"""The log of who did what when: written with the activity that it tells of, never changed."""

from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from service.addresses import origin_of
from service.enums import Activity, AlertKind, Outcome
from service.settings import Settings
from service.store import journal
from service.store.access import actor_of, address_of
from service.store.journal import ActivityRecord


def note(
    session: Session,
    what: Activity,
    *,
    by: str | None,
    via: str | None = None,
    camera_id: str | None = None,
    subject_id: str | None = None,
    kind: AlertKind | None = None,
    until: datetime | None = None,
    outcome: Outcome | None = None,
    text: str | None = None,
    details: dict[str, Any] | None = None,
) -> None:
    """Keep what was done, in the transaction that does it.

    Where it is known in whose name the session writes, and for which address, that is kept.

    Args:
        session: of the activity itself: what is rolled back was not done.
        what: was done.
        by: who; None where the service did it by itself, or nobody said a name.
        via: the id of the token that it was done with.
        camera_id: the camera, if it is about one; the entry stays when the camera goes.
        subject_id: the alert's, training's, window's or token's.
        kind: of an alert.
        until: of a silence or of maintenance.
        outcome: of an alert.
        text: the words that were given.
        details: what else is worth keeping, as JSON.
    """
    actor = actor_of(session)
    record = ActivityRecord(
        at=datetime.now(UTC),
        what=what,
        by=by if actor is None else actor.name,
        via=via if actor is None else actor.token_id,
        address=address_of(session),
        camera_id=camera_id,
        subject_id=subject_id,
        kind=kind,
        until=until,
        outcome=outcome,
        note=text,
        details=details or {},
    )
    journal.append(session, record)


def note_settings(session: Session, settings: Settings) -> None:
    """Keep the settings that are no defaults, where they are others than at the last start.

    Secrets are kept as "set", addresses without user, path and query.
    """
    given = {
        name: _shown(str(value)) if field.repr else "set"
        for name, field in Settings.model_fields.items()
        if (value := getattr(settings, name)) != field.get_default(call_default_factory=True)
    }
    last = journal.newest_of_kind(session, Activity.SETTINGS_CHANGED)
    if given != ({} if last is None else last.details):
        note(session, Activity.SETTINGS_CHANGED, by=None, details=given)


def _shown(value: str) -> str:
    return origin_of(value) if "://" in value else value
