"""`/ui/wall`: what needs a person, to be read from afar."""

from datetime import UTC, datetime

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse
from sqlalchemy.orm import Session

from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.cameras.status import alert_since
from service.enums import Severity
from service.store import cameras, fleet, journal, webhooks
from service.store.alerts import AlertRecord
from service.wording import alerts as alert_words
from service.wording.camera import fleet_alert_flags
from service.wording.times import Clock

_MOST = 8  # lines: a wall is not scrolled

router = APIRouter(include_in_schema=False)


@router.get("/wall")
def wall() -> RedirectResponse:
    """The way to the page."""
    return RedirectResponse("/ui/wall", status_code=303)


@router.get("/ui/wall")
def show(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """The alerts that fire and are not silenced: first what nobody has taken up."""
    newest = journal.newest_event_id(session)
    clock = Clock(now=datetime.now(UTC), zone=state.settings.zone)
    firing = sorted(webhooks.audible(session, None, clock.now), key=_order)
    return render(
        request,
        "wall.html",
        newest_event=newest,
        clock=clock,
        alerts=firing[:_MOST],
        more=len(firing[_MOST:]),
        waiting=[_told_as(alert) for alert in firing if alert.acknowledged_at is None],
        seen=sum(alert.acknowledged_at is not None for alert in firing),
        cameras=cameras.count(session),
        names=_names(session, firing[:_MOST]),
        words=alert_words,
        since_of=alert_since,
        flags_of=fleet_alert_flags,
    )


def _order(alert: AlertRecord) -> tuple[bool, bool, float]:
    seen, mild = alert.acknowledged_at is not None, alert.severity != Severity.CRITICAL
    return seen, mild, -alert_since(alert).timestamp()


def _told_as(alert: AlertRecord) -> str:
    """What is news once: an alert, and its escalation."""
    return f"{alert.id}-escalated" if alert.escalated_at else alert.id


def _names(session: Session, shown: list[AlertRecord]) -> dict[str, str]:
    return dict(fleet.names(session, {a.camera_id for a in shown if a.camera_id is not None}))
