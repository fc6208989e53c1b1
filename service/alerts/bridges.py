"""Problems of a bridge, and the alert `stale` about the cameras that it feeds."""

import logging
import time
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from models.reasons import Reason, Value
from service.alerts.alerts import close_alert, open_group_alert
from service.enums import AlertKind, AlertSource, Outcome
from service.reasons import ServiceCode
from service.settings import Settings
from service.store import alerts, bridges, cameras
from service.store.bridges import BridgeRecord
from service.store.engines.dialects import now_in
from service.store.sources import Poster
from service.wording.alerts import BRIDGE_WORKS

log = logging.getLogger("surefoot.jobs")

LOST_S = 60.0  # six heartbeats; a restart by `serve` takes a few seconds
MOST_STARTS = 3  # within the time below: it ends again and again
STARTS_WITHIN_S = 600.0
_ANSWERED = timedelta(hours=1)  # no new alert for so long after a person has ended one


def problem_of(record: BridgeRecord, now: datetime) -> Reason | None:
    """The problem of a bridge; None if it works, or was stopped on purpose.

    `now` is the database's.
    """
    if record.trouble is not None:
        ends = {"bridge": record.name, "error": record.trouble}
        return Reason(code=ServiceCode.BRIDGE_ENDS, values=ends)
    if record.stopped:
        return None
    # A heartbeat of the future is from before the clock was set back: no sign of life either.
    silent_s = abs((now - record.heartbeat_at).total_seconds())
    if silent_s > LOST_S:
        silent: dict[str, Value] = {"bridge": record.name, "silent_s": silent_s}
        return Reason(code=ServiceCode.BRIDGE_SILENT, values=silent)
    recent = [at for at in record.recent_starts if now.timestamp() - at < STARTS_WITHIN_S]
    if len(recent) > MOST_STARTS:
        starts: dict[str, Value] = {"starts": len(recent), "within_s": STARTS_WITHIN_S}
        return Reason(code=ServiceCode.BRIDGE_RESTARTS, values={"bridge": record.name, **starts})
    return None


class BridgeWatch:
    """Opens and ends the alert about a bridge's cameras.

    How long a bridge is silent is measured here, by the monotonic clock: a service that was off
    for an hour raises no alert about bridges that were not.
    """

    def __init__(self) -> None:
        self._heard: dict[str, tuple[datetime, float]] = {}

    def watch(self, session: Session, settings: Settings) -> None:
        """Bring the alerts about bridges up to date."""
        now, now_s = now_in(session), time.monotonic()
        heard = {}
        for record in bridges.every(session):
            at, since_s = self._heard.get(record.name, (record.heartbeat_at, now_s))
            if at != record.heartbeat_at:
                since_s = now_s
            heard[record.name] = record.heartbeat_at, since_s
            problem = problem_of(record, now)
            silent = problem is not None and problem.code == ServiceCode.BRIDGE_SILENT
            if not silent or now_s - since_s > settings.stale_after_s:
                _follow(session, record, problem)
        self._heard = heard


def _follow(session: Session, record: BridgeRecord, problem: Reason | None) -> None:
    name = record.name
    firing = alerts.firing_group(session, _poster(name), AlertKind.STALE)
    if problem is None:
        if firing is not None:
            close_alert(session, firing, Outcome.CLEARED, BRIDGE_WORKS)
            log.info("bridge_works", extra={"bridge": name})
        return
    if firing is not None or _answered(session, name):
        return
    fed = sorted(set(cameras.ids(session)).intersection(record.report.get("cameras", ())))
    if not fed:  # the health page shows it, too
        return
    open_group_alert(
        session,
        _poster(name),
        AlertKind.STALE,
        camera_ids=fed,
        reasons=(problem,),
        source=AlertSource.UPKEEP,
    )
    log.warning("bridge_fails", extra={"bridge": name, "reason_code": problem.code})


def _poster(bridge: str) -> Poster:
    return Poster(source=bridge, token_id="")  # its alert is about the bridge, not a token


def _answered(session: Session, name: str) -> bool:
    last = alerts.newest_group(session, _poster(name), AlertKind.STALE)
    if last is None or last.resolved_at is None or last.outcome == Outcome.CLEARED:
        return False
    return abs(datetime.now(UTC) - last.resolved_at) < _ANSWERED
