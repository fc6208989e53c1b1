"""`/cameras/{id}/maintenance`: when somebody is at a camera."""

from fastapi import APIRouter, Response

from service.api.middleware.dependencies import ActorDep, ReadDep, StateDep, WriteDep, name_of
from service.api.schemas.cameras.maintenance import WindowBody, WindowList, WindowOut, WindowPatch
from service.cameras import maintenance
from service.cameras.maintenance import WindowChange

router = APIRouter(prefix="/cameras/{camera_id}/maintenance", tags=["maintenance"])


@router.post("", status_code=201)
def begin(
    camera_id: str,
    body: WindowBody,
    state: StateDep,
    session: WriteDep,
    actor: ActorDep,
    response: Response,
) -> WindowOut:
    """Say that somebody is at a camera: it is not judged, and opens no alert."""
    record = maintenance.open_window(
        session,
        state.queue,
        state.settings,
        camera_id,
        from_at=body.from_,
        to_at=body.to,
        reason=body.reason,
        by=name_of(actor, body.by),
    )
    response.headers["Location"] = f"/cameras/{camera_id}/maintenance/{record.id}"
    return WindowOut.from_record(record)


@router.get("")
def list_all(camera_id: str, session: ReadDep) -> WindowList:
    """A camera's windows: planned, under way and over."""
    records = maintenance.list_windows(session, camera_id)
    return WindowList(items=[WindowOut.from_record(record) for record in records])


@router.patch("/{window_id}")
def change(
    camera_id: str, window_id: str, body: WindowPatch, state: StateDep, session: WriteDep
) -> WindowOut:
    """Move a window's ends."""
    wanted = WindowChange(from_at=body.from_, to_at=body.to, reason=body.reason)
    return WindowOut.from_record(
        maintenance.change_window(
            session, state.queue, state.settings, camera_id, window_id, wanted
        )
    )


@router.delete("/{window_id}", status_code=204)
def end(camera_id: str, window_id: str, state: StateDep, session: WriteDep) -> None:
    """End a window now, or take back one that has not begun."""
    maintenance.end_window(session, state.queue, camera_id, window_id)
