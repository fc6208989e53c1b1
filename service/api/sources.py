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
    """The caller that activates a source."""

    by: Who | None = None


class SourceOut(Out):
    """A source of tracks: `usable_tracks` of the `wanted_tracks` for a reference are available.

    `counts` is true for the active source. `token_id` is the token with the source's name; null if
    access control was off. `size` or `normalised` are declared for its posts that state no image
    size (`PATCH /cameras/{id}`).
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
    """Sources, ordered by their first post."""

    items: list[SourceOut]


router = APIRouter(prefix="/cameras/{camera_id}/sources", tags=["tracks"], route_class=NamingRoute)


@router.get("")
def list_sources(camera_id: str, state: StateDep, session: ReadDep) -> SourceList:
    """List the sources of a camera's tracks.

    `counts` marks the active source.
    """
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
def activate_source(
    camera_id: str,
    source: str,
    state: StateDep,
    session: WriteDep,
    body: UseBody | None = None,
) -> SourceList:
    """Activate a source of tracks.

    The reference is learned again from its tracks.
    """
    by = name_in(session, None if body is None else body.by)
    sources.use_source(session, state.queue, state.settings, camera_id, source, by)
    return list_sources(camera_id, state, session)


@router.delete("/{source:path}", status_code=204)
def delete_source(camera_id: str, source: str, session: WriteDep, by: Text | None = None) -> None:
    """Delete an inactive source with its tracks."""
    sources.remove_source(session, camera_id, source, name_in(session, by))
