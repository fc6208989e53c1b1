"""`/ui/webhooks`: who is told of alerts, whether they take it, what was sent, a test."""

from datetime import UTC, datetime

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.enums import WebhookFormat
from service.notifications.webhooks import list_deliveries, list_webhooks
from service.wording.reasons import in_words
from service.wording.times import Clock

_LOG = 20  # of each

router = APIRouter(include_in_schema=False)


@router.get("/ui/webhooks")
def show(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """The webhooks with the newest of their deliveries, and a form for another one."""
    return render(
        request,
        "webhooks.html",
        clock=Clock(now=datetime.now(UTC), zone=state.settings.zone),
        webhooks=[
            (view, list_deliveries(session, view.record.id, None, _LOG))
            for view in list_webhooks(session)
        ],
        formats=list(WebhookFormat),
        in_words=in_words,
    )
