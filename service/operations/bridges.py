"""Heartbeats of bridges: recorded as they come, and what `serve` knows of its own bridge."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy.orm import Session

from service.access.tokens import Caller
from service.alerts.bridges import LOST_S
from service.errors import ConflictError, ForbiddenError
from service.store import bridges
from service.store.bridges import BridgeRecord
from service.store.engines.dialects import now_in

ABOUT = "bridges/"  # what is written about
MOST_BRIDGES = 100
_KEPT_STARTS = 10
_FED_S, _MOST_FED = 86_400.0, 1_000
_KEEP_STOPPED = timedelta(days=7)
# Counts of a report, as `/metrics` and the health page have them.
COUNTS = (
    "messages",
    "messages_rejected",
    "messages_set_aside",
    "messages_unknown_camera",
    "messages_dropped",
    "rows_skipped",
    "tracks_posted",
    "tracks_rejected",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Beat:
    """A heartbeat: when its process started, whether it ends now, and its counts."""

    started_at: datetime
    stopped: bool
    report: dict[str, Any]


def note_heartbeat(session: Session, name: str, beat: Beat, caller: Caller | None) -> None:
    """Record a heartbeat, and count a new process.

    Raises:
        ForbiddenError: a bridge that reports with another token has this name.
        ConflictError: too many bridges report.
    """
    now = now_in(session)
    token_id = None if caller is None else caller.token_id
    record = session.get(BridgeRecord, name)
    if record is None:
        record = _added(session, name, now)
    elif caller is not None and record.token_id not in (None, token_id):
        silent_s = abs((now - record.heartbeat_at).total_seconds())
        if not record.stopped and silent_s < LOST_S:
            raise ForbiddenError(
                f"bridge: {name!r} reports with another token; give this one another "
                "SUREFOOT_MQTT_CLIENT_ID"
            )
    if record.starts == 0 or record.started_at != beat.started_at:
        record.starts += 1
        record.started_at = beat.started_at
        record.recent_starts = [*record.recent_starts, now.timestamp()][-_KEPT_STARTS:]
    record.token_id, record.heartbeat_at = token_id, now
    record.stopped = beat.stopped
    record.report = beat.report | {"cameras": _fed(record.report, beat.report, now)}
    bridges.forget(session, now - _KEEP_STOPPED)


def note_trouble(session: Session, name: str, trouble: str | None) -> None:
    """Record why `serve` cannot keep its bridge running; None clears it."""
    record = session.get(BridgeRecord, name)
    if record is None and trouble is not None:
        record = _added(session, name, now_in(session))
    if record is not None:
        record.trouble = trouble


def note_stopped(session: Session, name: str) -> None:
    """Record that `serve` runs no bridge of this name now."""
    record = session.get(BridgeRecord, name)
    if record is not None:
        record.stopped, record.trouble = True, None


def _fed(before: dict[str, Any], report: dict[str, Any], now: datetime) -> dict[str, float]:
    """The cameras that a bridge feeds, with the times of their reports.

    A new process has posted for none yet, and feeds those of the last one.
    """
    at_s = now.timestamp()
    known = {name: s for name, s in before.get("cameras", {}).items() if at_s - s < _FED_S}
    for name in report["cameras"]:
        known.pop(name, None)
        known[name] = at_s
    return dict(list(known.items())[-_MOST_FED:])


def _added(session: Session, name: str, now: datetime) -> BridgeRecord:
    if len(bridges.every(session)) >= MOST_BRIDGES:
        raise ConflictError(f"bridge: at most {MOST_BRIDGES} bridges may report")
    record = BridgeRecord(
        name=name,
        token_id=None,
        started_at=now,
        heartbeat_at=now,
        starts=0,
        recent_starts=[],
        stopped=False,
        report={},
        trouble=None,
    )
    session.add(record)
    return record
