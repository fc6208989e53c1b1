"""`/`: the fleet page, and the parts of it that are fetched when something happens."""

from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from service.api.fields import Text
from service.api.middleware.dependencies import AppState, ReadDep, StateDep
from service.api.middleware.pages import render
from service.enums import PoseState
from service.pages.fleet import counts_of, list_fleet, list_groups
from service.store import journal
from service.wording.camera import STATES, fleet_alert_flags
from service.wording.reasons import group_in_words
from service.wording.times import Clock

router = APIRouter(include_in_schema=False)


@router.get("/")
def show(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """Every camera, what needs a person first."""
    # What happens from here on is an event that the page asks for, even if it is in here too.
    newest = journal.newest_event_id(session)
    cameras = list_fleet(session, state.settings)
    return render(
        request,
        "fleet.html",
        newest_event=newest,
        counts=counts_of(cameras),
        urgent=sum(camera.state == PoseState.DRIFTING for camera in cameras),
        rows=cameras,
        groups=list_groups(session),
        **_words(state),
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
    found = list_fleet(session, state.settings, wanted)
    return render(request, "_fleet_rows.html", rows=found, **_words(state))


@router.get("/ui/fleet/banners")
def banners(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """The alerts that blame trackers."""
    return render(request, "_fleet_banners.html", groups=list_groups(session), **_words(state))


def _words(state: AppState) -> dict[str, Any]:
    """The words that the templates say times, states and alerts with."""
    return dict(
        clock=Clock(now=datetime.now(UTC), zone=state.settings.zone),
        states=STATES,
        in_words=group_in_words,
        flags_of=fleet_alert_flags,
    )
