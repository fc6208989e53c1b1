"""`/ui/cameras/{id}/posts`: what comes for a camera that learns, asked for every few seconds."""

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from service.access.tokens import Caller
from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.hosts import auth_on
from service.api.middleware.pages import render
from service.cameras.connecting import view_connection
from service.enums import TokenScope
from service.settings import Settings
from service.wording import connecting as words
from service.wording.camera import few_hours_words
from service.wording.times import Clock

router = APIRouter(include_in_schema=False)


@router.get("/ui/cameras/{camera_id}/posts")
def show(camera_id: str, request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """The last post, what was taken and refused, and when the reference is ready."""
    found = view_connection(session, state.settings, state.posts, camera_id)
    learned = found.pose.reference
    return render(
        request,
        "camera/posts.html",
        found=found,
        learned=learned,
        few_hours=few_hours_words(learned.counted, learned.wanted, learned.hours),
        words=words,
        clock=Clock(now=found.now, zone=state.settings.zone),
    )


def how_to_connect(request: Request, settings: Settings, camera_id: str) -> dict[str, Any]:
    """What the panel's commands and buttons are made of, by who asks."""
    caller: Caller | None = request.state.caller
    tokens_needed = auth_on(settings)
    return {
        "address": (settings.public_url or str(request.base_url)).rstrip("/"),
        "tokens_needed": tokens_needed,
        "makes_tokens": tokens_needed and (caller is None or caller.may(TokenScope.ADMIN)),
        "posts": caller is None or (caller.may(TokenScope.INGEST) and caller.may_post(camera_id)),
    }
