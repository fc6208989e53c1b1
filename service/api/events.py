"""`GET /events`: Server-Sent Events out of the store, with resume and heartbeat."""

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

from service.api.middleware.authentication import still_let_in
from service.api.middleware.dependencies import AppState, StateDep
from service.api.middleware.event_feed import Feed, wait
from service.store import journal
from service.store.engines.store import Store
from service.store.journal import EventRecord

router = APIRouter(tags=["events"])
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
        seen = await _ask(state, _newest, state.store)
    heard_s = checked_s = time.monotonic()
    yield ServerSentEvent(comment="connected", retry=2000)
    await state.feed.join()
    try:
        while not state.stopping.is_set() and not await request.is_disconnected():
            now_s = time.monotonic()
            if now_s - checked_s > _CHECK_S:
                checked_s = now_s
                if not await _ask(state, still_let_in, request):
                    return  # logged out, or the token is over
            news = state.feed.news
            records = await _since(state, seen)
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


async def _since(state: AppState, seen: int) -> Sequence[EventRecord]:
    """Events after one: out of the feed, or of the store where that was long ago."""
    kept = state.feed.since(seen)
    if kept is not None:
        return kept
    try:
        return await _ask(state, _after, state.store, seen)
    except SQLAlchemyError as error:
        # The stream has begun; it goes on when the store can be read again.
        log.warning("events_not_read", extra={"error": str(error)})
        return ()


def feed_of(store: Store, polls: anyio.CapacityLimiter) -> Feed:
    """The feed that all event streams of an application follow."""
    run = partial(anyio.to_thread.run_sync, limiter=polls)
    return Feed(lambda: run(_newest, store), lambda seen: run(_after, store, seen))


async def _ask(state: AppState, what: Callable[..., Answer], *args: Any) -> Answer:
    # All streams together have a few threads, so that they take none from requests.
    return await anyio.to_thread.run_sync(partial(what, *args), limiter=state.stream_polls)


def _newest(store: Store) -> int:
    with store.read() as session:
        return journal.newest_event_id(session)


def _after(store: Store, seen: int) -> Sequence[EventRecord]:
    with store.read() as session:
        return journal.events_after(session, seen, _BATCH)
