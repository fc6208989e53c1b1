"""`GET /events`: Server-Sent Events out of the store, with resume and heartbeat."""

import re
import time
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Header, Query, Request
from fastapi.sse import EventSourceResponse, ServerSentEvent

from service.api.middleware.authentication import still_let_in
from service.api.middleware.dependencies import StateDep
from service.api.middleware.event_feed import wait

router = APIRouter(tags=["events"])
_HEARTBEAT_S = 10.0
_CHECK_S = 5.0
_MAX_ID = 2**63 - 1  # SQLite's
_ID = re.compile(r"[0-9]{1,30}")


@router.get("/events", response_class=EventSourceResponse)
async def stream_events(
    request: Request,
    state: StateDep,
    last_event_id: Annotated[str | None, Header()] = None,
    after: Annotated[int | None, Query(ge=0, le=_MAX_ID)] = None,
) -> AsyncIterator[ServerSentEvent]:
    """Stream poses, alerts and trainings as server-sent events.

    With `Last-Event-ID`, the stream begins after that event; `after` does the same for browsers,
    which cannot send the header with the first request. A `pose` event without a state means that
    the camera was registered, changed or deleted.
    """
    given = (last_event_id or "").strip()
    asked = int(given) if _ID.fullmatch(given) else after
    newest = await state.feed.newest()
    # Of a store that was put back to an earlier one, the client knows more than there is.
    seen = newest if asked is None else min(asked, newest)
    heard_s = checked_s = time.monotonic()
    # With an id: who loses the connection before the first event goes on from here, too.
    yield ServerSentEvent(comment="connected", retry=2000, id=str(seen))
    await state.feed.join()
    try:
        while not state.stopping.is_set() and not await request.is_disconnected():
            now_s = time.monotonic()
            if now_s - checked_s > _CHECK_S:
                checked_s = now_s
                if not await state.feed.ask(still_let_in, request):
                    return  # logged out, or the token is over
            news = state.feed.news
            records = await state.feed.since(seen)
            for record in records:
                seen = record.id
                yield ServerSentEvent(id=str(record.id), event=record.type, data=record.payload)
            if records:
                heard_s = now_s
                continue
            if now_s - heard_s >= _HEARTBEAT_S:
                heard_s = now_s
                yield ServerSentEvent(comment="heartbeat")
            await wait(news)
    finally:
        state.feed.leave()
