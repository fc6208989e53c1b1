"""`/ui/report`: the weekly report, of any days, to be read and printed."""

from datetime import UTC, date, datetime, time, timedelta
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse
from pydantic import Field

from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.api.reports import require_period
from service.reports.weekly import WEEK, make_report
from service.wording.camera import STATES
from service.wording.times import Clock

Day = Annotated[date, Field(ge=date(2000, 1, 1), lt=date(3000, 1, 1))]
router = APIRouter(include_in_schema=False)


@router.get("/ui/report")
def show(
    request: Request,
    state: StateDep,
    session: ReadDep,
    from_: Annotated[Day | None, Query(alias="from", description="the first day")] = None,
    to: Annotated[Day | None, Query(description="the last day")] = None,
) -> HTMLResponse:
    """The report of some days, whole ones by the cameras' clock; of the last seven, if unsaid."""
    clock = Clock(now=datetime.now(UTC), zone=state.settings.zone)
    end = clock.now if to is None else _midnight(to + timedelta(days=1), clock)
    end = min(end, clock.now)
    begin = end - WEEK if from_ is None else _midnight(from_, clock)
    require_period(begin, end)
    report = make_report(session, state.settings, begin, end)
    return render(request, "report.html", report=report, clock=clock, states=STATES)


def _midnight(day: date, clock: Clock) -> datetime:
    return datetime.combine(day, time(), clock.zone).astimezone(UTC)
