"""`/cameras/{id}/sources`: whose tracks a camera is judged by."""

from fastapi import APIRouter

from service.api.middleware.dependencies import ActorDep, ReadDep, StateDep, WriteDep, name_of
from service.api.schemas.base import Text
from service.api.schemas.cameras.sources import SourceList, SourceOut, UseBody
from service.cameras import sources

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
