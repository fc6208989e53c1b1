"""`/handovers`: a shift is handed over with a note, and taken over by whoever comes next."""

from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field

from service.api.ignored import NamingRoute
from service.api.middleware.dependencies import ReadDep, WriteDep
from service.api.schemas import Body, Moment, Out, Who
from service.reports import handover
from service.store.access import name_in


class HandoverBody(Body):
    """What is handed over: everything since a time, and what the next should know."""

    since: Moment
    note: str | None = Field(None, max_length=2000)
    by: Who | None = None


class TakeBody(Body):
    """Who takes it over."""

    by: Who | None = None


class HandoverOut(Out):
    """A handover; `taken_at` is null until somebody has taken it over."""

    id: str
    at: datetime
    since: datetime
    by: str | None
    note: str | None
    taken_by: str | None
    taken_at: datetime | None


class HandoverList(BaseModel):
    """Handovers, newest first."""

    items: list[HandoverOut]


router = APIRouter(prefix="/handovers", tags=["operation"], route_class=NamingRoute)


@router.get("")
def list_handovers(
    session: ReadDep, limit: Annotated[int, Query(ge=1, le=100)] = handover.LAST
) -> HandoverList:
    """List the newest handovers."""
    return HandoverList.model_validate({"items": handover.last_handovers(session, limit)})


@router.post("", status_code=201)
def give_handover(body: HandoverBody, session: WriteDep) -> HandoverOut:
    """Give a handover of the events since a time.

    It is shown until it is taken over.
    """
    by = name_in(session, body.by)
    return HandoverOut.model_validate(handover.hand_over(session, body.since, body.note, by))


@router.post("/{handover_id}/take")
def take_handover(handover_id: str, session: WriteDep, body: TakeBody | None = None) -> HandoverOut:
    """Take a handover over."""
    by = name_in(session, None if body is None else body.by)
    return HandoverOut.model_validate(handover.take_over(session, handover_id, by))
