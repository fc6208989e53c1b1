"""`GET /activity`: who did what when, from where; in pages, or as lines to keep elsewhere."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Query
from fastapi.responses import Response, StreamingResponse
from pydantic import BaseModel

from service.api.middleware.dependencies import AppState, StateDep
from service.api.schemas import Moment, Out, Text
from service.api.spreadsheet import CSV, FileFormat, csv_lines, saved_as
from service.enums import Activity, AlertKind, Outcome
from service.store import journal


class EntryOut(Out):
    """What somebody did; without a name, the service by itself.

    `via` is the id of the token, `address` where it was asked from.
    """

    id: int
    at: datetime
    what: Activity
    by: str | None
    via: str | None
    address: str | None
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wanted:
    """A choice of entries, `limit` of them at the most."""

    camera_id: str | None
    since: datetime | None
    before: datetime | None
    limit: int | None


def _wanted(
    camera_id: Text | None = None,
    from_: Annotated[Moment | None, Query(alias="from", description="done at or after")] = None,
    to: Annotated[Moment | None, Query(description="done before")] = None,
    limit: Annotated[int | None, Query(ge=1, le=1000)] = None,
) -> _Wanted:
    return _Wanted(camera_id=camera_id, since=from_, before=to, limit=limit)


router = APIRouter(tags=["operation"])

_LINES = "application/x-ndjson"
_BATCH = 500
_MOST_ID = 2**63 - 1


@router.get(
    "/activity",
    response_model=ActivityPage,
    responses={200: {"content": {_LINES: {"schema": {"type": "string"}}, CSV: {}}}},
)
def list_activity(
    state: StateDep,
    wanted: Annotated[_Wanted, Depends(_wanted)],
    after: Annotated[int, Query(ge=0, le=_MOST_ID)] = 0,
    format_: Annotated[
        FileFormat | None, Query(alias="format", description="a file for a spreadsheet")
    ] = None,
    accept: Annotated[str, Header()] = "",
) -> ActivityPage | Response:
    """List the activity log, oldest first.

    Deleted cameras are included. A page has 100 entries by default. As `application/x-ndjson` or
    CSV, the answer has one entry a line: all of them, or the first `limit`.
    """
    if format_ == FileFormat.CSV:
        lines = _as_csv(_batches(state, wanted, after))
        return StreamingResponse(lines, media_type=CSV, headers=saved_as("activity.csv"))
    if _LINES in accept:
        return StreamingResponse(_as_json(_batches(state, wanted, after)), media_type=_LINES)
    limit = wanted.limit or 100
    found = _page(state, wanted, after, limit + 1)
    items = found[:limit]
    more = len(found) > limit
    return ActivityPage(items=items, next_cursor=items[-1].id if more else None)


def _as_json(batches: Iterator[list[EntryOut]]) -> Iterator[str]:
    for entries in batches:
        yield "".join(f"{entry.model_dump_json()}\n" for entry in entries)


def _as_csv(batches: Iterator[list[EntryOut]]) -> Iterator[str]:
    yield csv_lines([EntryOut.model_fields])
    for entries in batches:
        yield csv_lines(entry.model_dump().values() for entry in entries)


def _batches(state: AppState, wanted: _Wanted, after: int) -> Iterator[list[EntryOut]]:
    """The entries, read bit by bit: no session stays open for a slow reader."""
    limit = wanted.limit
    while limit is None or limit > 0:
        entries = _page(state, wanted, after, min(_BATCH, limit or _BATCH))
        if not entries:
            return
        yield entries
        after = entries[-1].id
        limit = None if limit is None else limit - len(entries)


def _page(state: AppState, wanted: _Wanted, after: int, limit: int) -> list[EntryOut]:
    with state.store.read() as session:
        records = journal.activity_after(
            session, wanted.camera_id, after, limit, since=wanted.since, before=wanted.before
        )
        return [EntryOut.model_validate(record) for record in records]
