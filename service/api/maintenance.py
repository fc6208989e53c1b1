"""`/cameras/{id}/maintenance`: when somebody is at a camera."""

from datetime import UTC, datetime
from typing import Annotated, Self

from fastapi import APIRouter, Query, Response
from pydantic import BaseModel, ConfigDict, Field

from service.api.ignored import NamingRoute
from service.api.middleware.dependencies import ReadDep, StateDep, WriteDep
from service.api.schemas import Body, Moment, Out, Who
from service.cameras import maintenance
from service.enums import WindowState
from service.store.access import name_in
from service.store.references import MaintenanceRecord


class WindowBody(Body):
    """A time in which somebody is at a camera; it begins now, if not told otherwise."""

    from_: Moment | None = Field(None, alias="from")
    to: Moment
    reason: str | None = Field(None, max_length=2000)
    by: Who | None = None


class WindowPatch(Body):
    """What to change of a window; fields left out stay."""

    from_: Moment | None = Field(None, alias="from")
    to: Moment | None = None
    reason: str | None = Field(None, max_length=2000)


class WindowOut(Out):
    """A maintenance window: `to` as planned, `ended_at` when it really ended."""

    model_config = ConfigDict(serialize_by_alias=True)

    id: str
    camera_id: str
    state: WindowState
    from_: datetime = Field(serialization_alias="from")
    to: datetime
    ended_at: datetime | None
    reason: str | None
    by: str | None
    created_at: datetime
    updated_at: datetime

    @classmethod
    def from_record(cls, record: MaintenanceRecord) -> Self:
        """The body of a stored window."""
        now = datetime.now(UTC)
        state = WindowState.UNDER_WAY if record.from_at <= now else WindowState.PLANNED
        if record.until <= now:
            state = WindowState.OVER
        ends = {"from_": record.from_at, "to": record.to_at, "by": record.requested_by}
        return cls.of(record, **ends, state=state)


class WindowList(BaseModel):
    """Windows in the order of their beginnings."""

    items: list[WindowOut]


router = APIRouter(
    prefix="/cameras/{camera_id}/maintenance", tags=["maintenance"], route_class=NamingRoute
)


@router.post("", status_code=201)
def schedule_maintenance(
    camera_id: str,
    body: WindowBody,
    state: StateDep,
    session: WriteDep,
    response: Response,
) -> WindowOut:
    """Schedule maintenance of a camera.

    During a maintenance period the camera is not monitored, and no alert is opened.
    """
    record = maintenance.open_window(
        session,
        state.queue,
        state.settings,
        camera_id,
        from_at=body.from_,
        to_at=body.to,
        reason=body.reason,
        by=name_in(session, body.by),
    )
    response.headers["Location"] = f"/cameras/{camera_id}/maintenance/{record.id}"
    return WindowOut.from_record(record)


@router.get("")
def list_maintenance(camera_id: str, session: ReadDep) -> WindowList:
    """List the maintenance periods of a camera.

    They are planned, under way or over.
    """
    records = maintenance.list_windows(session, camera_id)
    return WindowList(items=[WindowOut.from_record(record) for record in records])


@router.patch("/{window_id}")
def change_maintenance(
    camera_id: str, window_id: str, body: WindowPatch, state: StateDep, session: WriteDep
) -> WindowOut:
    """Change the start or the end of a maintenance period."""
    record = maintenance.change_window(
        session,
        state.queue,
        state.settings,
        camera_id,
        window_id,
        from_at=body.from_,
        to_at=body.to,
        reason=body.reason,
    )
    return WindowOut.from_record(record)


@router.delete("/{window_id}", status_code=204)
def end_maintenance(
    camera_id: str,
    window_id: str,
    state: StateDep,
    session: WriteDep,
    by: Annotated[Who | None, Query(description="who ends it")] = None,
) -> None:
    """End a maintenance period.

    A planned one is withdrawn.
    """
    maintenance.end_window(session, state.queue, camera_id, window_id, by)
