"""`/cameras/{id}/sources`: whose tracks a camera is judged by."""

from datetime import datetime

from fastapi import APIRouter
from pydantic import BaseModel

from service.api.ignored import NamingRoute
from service.api.middleware.dependencies import ReadDep, StateDep, WriteDep
from service.api.schemas import Body, Out, Text, Who
from service.cameras import sources
from service.store.access import name_in


class UseBody(Body):
    """Who says that a source is to count."""

    by: Who | None = None


class SourceOut(Out):
    """A source of tracks; `usable_tracks` of `wanted_tracks` would make a reference of it.

    `token_id` is of the token whose name it is; null where access was off. `size` or `normalised`
    are declared for its posts that state no image size (`PATCH /cameras/{id}`).
    """

    name: str
    counts: bool
    tracks: int
    usable_tracks: int
    wanted_tracks: int
    first_seen_at: datetime
    last_seen_at: datetime
    token_id: str | None
    size: list[float] | None = None
    normalised: bool = False


class SourceList(BaseModel):
    """Sources, the first to post first."""

    items: list[SourceOut]


router = APIRouter(prefix="/cameras/{camera_id}/sources", tags=["tracks"], route_class=NamingRoute)


@router.get("")
def list_all(camera_id: str, state: StateDep, session: ReadDep) -> SourceList:
    """Who has posted tracks of a camera, and whose count."""
    found = sources.list_sources(session, state.settings, camera_id)
    items = [
        SourceOut.of(
            each.record,
            counts=each.counts,
            usable_tracks=each.usable,
            wanted_tracks=each.wanted,
            size=None if each.image_size is None else each.image_size.stored,
            normalised=each.image_size is not None and each.image_size.normalised,
        )
        for each in found
    ]
    return SourceList(items=items)


@router.post("/{source:path}/use")
def use(
    camera_id: str,
    source: str,
    state: StateDep,
    session: WriteDep,
    body: UseBody | None = None,
) -> SourceList:
    """Say that a source is to count: the reference is learned anew, of its tracks."""
    by = name_in(session, None if body is None else body.by)
    sources.use_source(session, state.queue, state.settings, camera_id, source, by)
    return list_all(camera_id, state, session)


@router.delete("/{source:path}", status_code=204)
def remove(camera_id: str, source: str, session: WriteDep, by: Text | None = None) -> None:
    """Delete a source that does not count, with its tracks."""
    sources.remove_source(session, camera_id, source, name_in(session, by))
