"""`/`: the fleet page, and the parts of it that are fetched when something happens."""

from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from service.api.fields import Text
from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.operations import health
from service.pages.rows import banners_of, counts_of, rows_of, urgent
from service.pages.views import fleet

router = APIRouter(include_in_schema=False)


@router.get("/")
def show(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """Every camera, what needs a person first."""
    now, zone = datetime.now(UTC), state.settings.zone
    # What happens from here on is an event that the page asks for, even if it is in here too.
    newest = health.newest_event_id(session)
    cameras = fleet.list_fleet(session, state.settings)
    return render(
        request,
        "fleet.html",
        newest_event=newest,
        counts=counts_of(cameras),
        urgent=urgent(cameras),
        rows=rows_of(cameras, now, zone),
        groups=banners_of(fleet.list_groups(session), now, zone),
    )


@router.get("/ui/fleet/rows")
def rows(
    request: Request,
    state: StateDep,
    session: ReadDep,
    ids: Annotated[Text | None, Query(max_length=20_000)] = None,
) -> HTMLResponse:
    """The rows of some cameras, or of all; one that is gone has none."""
    wanted = None if ids is None else set(ids.split(","))
    cameras = fleet.list_fleet(session, state.settings, wanted)
    found = rows_of(cameras, datetime.now(UTC), state.settings.zone)
    return render(request, "_fleet_rows.html", rows=found)


@router.get("/ui/fleet/banners")
def banners(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """The alerts that blame trackers."""
    groups = fleet.list_groups(session)
    found = banners_of(groups, datetime.now(UTC), state.settings.zone)
    return render(request, "_fleet_banners.html", groups=found)
