"""`/ui/health`: workers, queue, bridges and webhooks; and the banner on every page of troubles."""

from datetime import UTC, datetime

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from service.access.tokens import Caller
from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.enums import TokenScope
from service.notifications.webhooks import list_webhooks
from service.operations.troubles import find_troubles
from service.store import bridges, cameras, pictures, tracks, workers
from service.wording.times import Clock

router = APIRouter(include_in_schema=False)


@router.get("/ui/health")
def show(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """Who works, what waits, what fails, and since when."""
    caller: Caller | None = request.state.caller
    came = [at for _, at in tracks.unseen_since(session).values()]
    return render(
        request,
        "health.html",
        clock=Clock(now=datetime.now(UTC), zone=state.settings.zone),
        troubles=find_troubles(session, state.settings),
        workers=workers.every(session),
        bridges=bridges.every(session),
        waiting=len(came),
        oldest=min(came, default=None),
        failing=cameras.failing(session),
        webhooks=list_webhooks(session),
        agreement=pictures.agreement(session),
        administers=caller is None or caller.may(TokenScope.ADMIN),
    )


@router.get("/ui/health/banner")
def banner(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """What is wrong, for the head of every page; empty where nothing is."""
    return render(
        request,
        "_health_banner.html",
        clock=Clock(now=datetime.now(UTC), zone=state.settings.zone),
        troubles=find_troubles(session, state.settings),
    )
