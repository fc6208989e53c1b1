"""Stored times, after the clock was set back."""

from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import Column, ColumnElement, Table, func, literal, select, update
from sqlalchemy.orm import Session

from service.store import monitor_states, tracks
from service.store.engines.dialects import earlier
from service.store.record import Record, UtcDateTime

# Times that people state, or that are compared with nothing but their like.
_STATED = frozenset(
    (
        *("alerts.silenced_until", "maintenance_windows.to_at", "access_tokens.expires_at"),
        *("snapshots.taken_at", "reports.due_at"),
    )
)
# Times of tracks, in seconds.
_OF_TRACKS = {
    "site_references": ("from_s", "to_s", "window_from_s", "changed_after_s", "changed_s"),
    "flow_maps": ("to_s",),
    "anchors": ("to_s", "logged_to_s"),
    "estimates": ("from_s", "to_s"),
}
# Entries of the log never change; weights are large, and nothing waits for their time.
_SKIPPED = frozenset(("activity", "weights", "pictures"))
# Times that lie in the future by their nature: something waits for them.
_AWAITED = frozenset(
    (
        *("cameras.estimate_after", "cameras.snapshot_due_at", "access_sessions.expires_at"),
        *("deliveries.next_attempt_at", "webhooks.held_until", "webhooks.old_secret_until"),
    )
)
_UNSURE = timedelta(minutes=10)  # between a setback and the first time that it is followed


def follow_clock(
    session: Session, set_back_by: timedelta, now: datetime, max_ahead_s: float
) -> int:
    """Move stored times back by as much as the clock; return how many values changed.

    A time after `now` was written before the clock was set back. Compared with later ones, it would
    keep sessions, alerts and poses in force, and jobs waiting, for as long as the clock jumped.

    Tracks that end more than `max_ahead_s` after `now` are of a tracker whose clock was ahead, too:
    no post could store them now. They would be the newest of their camera for as long, and no later
    track would count.
    """
    back_s = round(set_back_by.total_seconds())
    limit_s = now.timestamp() + max_ahead_s
    changed = tracks.follow_clock(session, back_s, limit_s)
    monitor_states.forget(session)  # they hold times of tracks
    for name, columns in _OF_TRACKS.items():
        table = Record.metadata.tables[name]
        for column in (table.c[each] for each in columns):
            statement = update(table).where(column > limit_s, *_narrowed(table, column, now))
            moved = session.execute(statement.values({column: column - back_s}))
            changed += moved.rowcount  # type: ignore[attr-defined]
    for table in Record.metadata.sorted_tables:
        for column in table.columns if table.name not in _SKIPPED else ():
            name = f"{table.name}.{column.name}"
            if not isinstance(column.type, UtcDateTime) or name in _STATED:
                continue
            wanted = column.is_not(None) if name in _AWAITED else column > now
            statement = update(table).where(wanted, *_narrowed(table, column, now))
            values = {column: earlier(column, literal(back_s))}
            changed += session.execute(statement.values(values)).rowcount  # type: ignore[attr-defined]
    session.expire_all()
    return changed


def _narrowed(table: Table, column: Column[Any], now: datetime) -> tuple[ColumnElement[bool], ...]:
    """Conditions that spare a scan of large tables, and a window that was planned for later."""
    if str(column) == "maintenance_windows.from_at":
        return (column <= table.c.created_at,)  # it began when somebody asked for it
    if table is tracks.TrackRecord.__table__:
        return (table.c.camera_id.in_(select(Record.metadata.tables["cameras"].c.id)),)
    if table.name == "estimates":
        before = select(table.c.id).where(table.c.created_at <= now - _UNSURE)
        newest = before.order_by(table.c.id.desc()).limit(1).scalar_subquery()
        return (table.c.id > func.coalesce(newest, 0),)
    return ()
