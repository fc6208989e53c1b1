"""`/cameras/{id}/sources`: whose tracks a camera is judged by."""

from datetime import datetime
from typing import Self

from fastapi import APIRouter
from pydantic import BaseModel

from service.api.fields import Body, Text, Who
from service.api.middleware.dependencies import ActorDep, ReadDep, StateDep, WriteDep, name_of
from service.cameras import sources
from service.cameras.sources import SourceView


class UseBody(Body):
    """Who says that a source is to count."""

    by: Who | None = None


class SourceOut(BaseModel):
    """A source of tracks; `usable_tracks` of `wanted_tracks` would make a reference of it."""

    name: str
    counts: bool
    tracks: int
    usable_tracks: int
    wanted_tracks: int
    first_seen_at: datetime
    last_seen_at: datetime

    @classmethod
    def from_value(cls, value: SourceView) -> Self:
        """The body of a source."""
        return cls(
            name=value.record.name,
            counts=value.counts,
            tracks=value.record.tracks,
            usable_tracks=value.usable,
            wanted_tracks=value.wanted,
            first_seen_at=value.record.first_seen_at,
            last_seen_at=value.record.last_seen_at,
        )


class SourceList(BaseModel):
    """Sources, the first to post first."""

    items: list[SourceOut]


router = APIRouter(prefix="/cameras/{camera_id}/sources", tags=["tracks"])


@router.get("")
def list_all(camera_id: str, state: StateDep, session: ReadDep) -> SourceList:
    """Who has posted tracks of a camera, and whose count."""
    found = sources.list_sources(session, state.settings, camera_id)
    return SourceList(items=[SourceOut.from_value(value) for value in found])


@router.post("/{source:path}/use")
def use(
    camera_id: str,
    source: str,
    state: StateDep,
    session: WriteDep,
    actor: ActorDep,
    body: UseBody | None = None,
) -> SourceList:
    """Say that a source is to count: the reference is learned anew, of its tracks."""
    by = name_of(actor, None if body is None else body.by)
    sources.use_source(session, state.queue, state.settings, camera_id, source, by)
    found = sources.list_sources(session, state.settings, camera_id)
    return SourceList(items=[SourceOut.from_value(value) for value in found])


@router.delete("/{source:path}", status_code=204)
def remove(
    camera_id: str, source: str, session: WriteDep, actor: ActorDep, by: Text | None = None
) -> None:
    """Delete a source that does not count, with its tracks."""
    sources.remove_source(session, camera_id, source, name_of(actor, by))
