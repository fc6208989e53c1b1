"""`/ui/handover`: what was since a time, what is open, and a note to whoever comes next."""

from datetime import UTC, datetime, timedelta
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from service.access.tokens import Caller
from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.api.reports import require_period
from service.api.schemas import Moment
from service.cameras.status import alert_since
from service.enums import TokenScope
from service.reports.handover import last_handovers, make_shift
from service.wording import alerts as alert_words
from service.wording.times import Clock

_SHIFTS_H = (8, 12, 24)

router = APIRouter(include_in_schema=False)


@router.get("/ui/handover")
def show(
    request: Request,
    state: StateDep,
    session: ReadDep,
    from_: Annotated[Moment | None, Query(alias="from", description="begin of the shift")] = None,
    hours: Annotated[float | None, Query(gt=0, le=7 * 24)] = None,
) -> HTMLResponse:
    """The shift since a time or of some hours; since the last handover of a day, if unsaid."""
    clock = Clock(now=datetime.now(UTC), zone=state.settings.zone)
    given = last_handovers(session)
    since = from_
    if since is None and hours is None and given and clock.now - given[0].at < timedelta(days=1):
        since = given[0].at
    since = since or clock.now - timedelta(hours=hours or _SHIFTS_H[0])
    require_period(since, clock.now)
    caller: Caller | None = request.state.caller
    return render(
        request,
        "handover.html",
        since=since,
        clock=clock,
        shift=make_shift(session, since, clock),
        shifts_h=_SHIFTS_H,
        # Of each person the last one.
        given=list({each.by: each for each in reversed(given)}.values())[::-1],
        operates=caller is None or caller.may(TokenScope.OPERATE),
        words=alert_words,
        since_of=alert_since,
    )
