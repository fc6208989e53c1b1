"""`/cameras/{id}/sources`: whose tracks a camera is judged by."""

from datetime import datetime

from fastapi import APIRouter
from pydantic import AliasPath, BaseModel, Field

from service.api.middleware.dependencies import ReadDep, StateDep, WriteDep
from service.api.schemas import Body, Out, Text, Who
from service.cameras import sources
from service.store.access import name_in


class UseBody(Body):
    """Who says that a source is to count."""

    by: Who | None = None


class SourceOut(Out):
    """A source of tracks; `usable_tracks` of `wanted_tracks` would make a reference of it."""

    name: str = Field(validation_alias=AliasPath("record", "name"))
    counts: bool
    tracks: int = Field(validation_alias=AliasPath("record", "tracks"))
    usable_tracks: int = Field(validation_alias="usable")
    wanted_tracks: int = Field(validation_alias="wanted")
    first_seen_at: datetime = Field(validation_alias=AliasPath("record", "first_seen_at"))
    last_seen_at: datetime = Field(validation_alias=AliasPath("record", "last_seen_at"))


class SourceList(BaseModel):
    """Sources, the first to post first."""

    items: list[SourceOut]


router = APIRouter(prefix="/cameras/{camera_id}/sources", tags=["tracks"])


@router.get("")
def list_all(camera_id: str, state: StateDep, session: ReadDep) -> SourceList:
    """Who has posted tracks of a camera, and whose count."""
    found = sources.list_sources(session, state.settings, camera_id)
    return SourceList.model_validate({"items": found})


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
