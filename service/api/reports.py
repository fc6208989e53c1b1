"""`GET /reports/weekly`: what moved, what was done, what needs a person, what moves often."""

from datetime import UTC, datetime, timedelta
from typing import Annotated

from fastapi import APIRouter, Query

from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.schemas import Moment
from service.errors import MalformedError
from service.reports.weekly import WEEK, Report, make_report

_LONGEST = timedelta(days=366)
router = APIRouter(tags=["operation"])


@router.get("/reports/weekly")
def get_weekly_report(
    state: StateDep,
    session: ReadDep,
    from_: Annotated[
        Moment | None, Query(alias="from", description="a week before `to`, if not given")
    ] = None,
    to: Annotated[Moment | None, Query(description="now, if not given")] = None,
) -> Report:
    """Get a report of several days.

    It has the alerts that were open during these days, and the current state of the cameras.
    """
    end = to or datetime.now(UTC)
    begin = from_ or end - WEEK
    require_period(begin, end)
    return make_report(session, state.settings, begin, end)


def require_period(begin: datetime, end: datetime) -> None:
    """Check that a report can be made of what was between two times.

    Raises:
        MalformedError: the first is not before the second, or they are a year and more apart.
    """
    if not timedelta(0) < end - begin <= _LONGEST:
        limit = f"a time before `to`, by at most {_LONGEST.days} days, is needed"
        raise MalformedError.of_field("from", f"{limit}, got {begin.isoformat()}")
