"""`GET /activity`: who did what when, in pages or as a stream of lines to keep elsewhere."""

from collections.abc import Iterator
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Header, Query
from fastapi.responses import Response, StreamingResponse
from pydantic import BaseModel

from service.api.middleware.dependencies import AppState, StateDep
from service.api.schemas import Out, Text
from service.enums import Activity, AlertKind, Outcome
from service.store import journal


class EntryOut(Out):
    """What somebody did; without a name, the service by itself."""

    id: int
    at: datetime
    what: Activity
    by: str | None
    via: str | None
    camera_id: str | None
    subject_id: str | None
    kind: AlertKind | None
    until: datetime | None
    outcome: Outcome | None
    note: str | None
    details: dict[str, Any]


class ActivityPage(BaseModel):
    """Entries, oldest first; `next_cursor` is the `after` of the next page."""

    items: list[EntryOut]
    next_cursor: int | None


router = APIRouter(tags=["operation"])

_LINES = "application/x-ndjson"
_BATCH = 500
_MOST_ID = 2**63 - 1


@router.get(
    "/activity",
    response_model=ActivityPage,
    responses={200: {"content": {_LINES: {"schema": {"type": "string"}}}}},
)
def show(
    state: StateDep,
    camera_id: Text | None = None,
    after: Annotated[int, Query(ge=0, le=_MOST_ID)] = 0,
    limit: Annotated[int | None, Query(ge=1, le=1000)] = None,
    accept: Annotated[str, Header()] = "",
) -> ActivityPage | Response:
    """What was done, oldest first, also at cameras that are gone; 100 a page if unsaid.

    As `application/x-ndjson`, an entry a line: all there are, or the first `limit`.
    """
    if _LINES in accept:
        return StreamingResponse(_lines(state, camera_id, after, limit), media_type=_LINES)
    wanted = limit or 100
    found = _page(state, camera_id, after, wanted + 1)
    items = found[:wanted]
    more = len(found) > wanted
    return ActivityPage(items=items, next_cursor=items[-1].id if more else None)


def _lines(state: AppState, camera_id: str | None, after: int, limit: int | None) -> Iterator[str]:
    """The entries as lines of JSON, read bit by bit: no session stays open for a slow reader."""
    while limit is None or limit > 0:
        entries = _page(state, camera_id, after, min(_BATCH, limit or _BATCH))
        if not entries:
            return
        yield "".join(f"{entry.model_dump_json()}\n" for entry in entries)
        after = entries[-1].id
        limit = None if limit is None else limit - len(entries)


def _page(state: AppState, camera_id: str | None, after: int, limit: int) -> list[EntryOut]:
    with state.store.read() as session:
        records = journal.activity_after(session, camera_id, after, limit)
        return [EntryOut.model_validate(record) for record in records]
