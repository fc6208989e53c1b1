"""`GET /events`: Server-Sent Events out of the store, with resume and heartbeat."""

import asyncio
import logging
import re
import time
from collections.abc import AsyncIterator, Callable, Sequence
from functools import partial
from typing import Annotated, Any, TypeVar

import anyio
import anyio.to_thread
from fastapi import APIRouter, Header, Query, Request
from fastapi.sse import EventSourceResponse, ServerSentEvent
from sqlalchemy.exc import SQLAlchemyError

from service.http.dependencies import AppState, StateDep
from service.http.guard import still_let_in
from service.store.tables.operation import EventRecord
from service.views import operation

router = APIRouter(tags=["events"])
_POLL_S = 0.5
_HEARTBEAT_S = 10.0
_CHECK_S = 5.0
_BATCH = 500
_MAX_ID = 2**63 - 1  # SQLite's
_ID = re.compile(r"[0-9]{1,30}")

Answer = TypeVar("Answer")
log = logging.getLogger("surefoot.http")


@router.get("/events", response_class=EventSourceResponse)
async def events(
    request: Request,
    state: StateDep,
    last_event_id: Annotated[str | None, Header()] = None,
    after: Annotated[int | None, Query(ge=0, le=_MAX_ID)] = None,
) -> AsyncIterator[ServerSentEvent]:
    """Poses, alerts and trainings as they happen; with `Last-Event-ID`, all since that one.

    `after` says the same for who cannot send a header with the first request: browsers.
    """
    given = (last_event_id or "").strip()
    seen = min(int(given), _MAX_ID) if _ID.fullmatch(given) else after
    if seen is None:
        seen = await _ask(state, _newest, state)
    silent_s = 0.0
    checked_s = time.monotonic()
    yield ServerSentEvent(comment="connected", retry=2000)
    while not state.stopping.is_set() and not await request.is_disconnected():
        if time.monotonic() - checked_s > _CHECK_S:
            checked_s = time.monotonic()
            if not await _ask(state, still_let_in, request):
                return  # logged out, or the token is over
        try:
            records = await _ask(state, _after, state, seen)
        except SQLAlchemyError as error:
            # The stream has begun; it goes on when the store can be read again.
            log.warning("events_not_read", extra={"error": str(error)})
            records = ()
        for record in records:
            seen = record.id
            yield ServerSentEvent(id=str(record.id), event=record.type, data=record.payload)
        silent_s = 0.0 if records else silent_s + _POLL_S
        if silent_s >= _HEARTBEAT_S:
            silent_s = 0.0
            yield ServerSentEvent(comment="heartbeat")
        if len(records) < _BATCH:
            await asyncio.sleep(_POLL_S)


async def _ask(state: AppState, what: Callable[..., Answer], *args: Any) -> Answer:
    # All streams together have a few threads, so that they take none from requests.
    return await anyio.to_thread.run_sync(partial(what, *args), limiter=state.stream_polls)


def _newest(state: AppState) -> int:
    with state.store.read() as session:
        return operation.newest_event_id(session)


def _after(state: AppState, seen: int) -> Sequence[EventRecord]:
    with state.store.read() as session:
        return operation.events_after(session, seen, _BATCH)
