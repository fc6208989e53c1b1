"""Bodies of `/cameras/{id}/maintenance`."""

from datetime import UTC, datetime
from typing import Self

from pydantic import BaseModel, ConfigDict, Field

from service.api.schemas.base import Body, Moment, Who
from service.enums import WindowState
from service.store.tables.attendance import MaintenanceRecord


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


class WindowOut(BaseModel):
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
        return cls(
            id=record.id,
            camera_id=record.camera_id,
            state=state,
            from_=record.from_at,
            to=record.to_at,
            ended_at=record.ended_at,
            reason=record.reason,
            by=record.requested_by,
            created_at=record.created_at,
            updated_at=record.updated_at,
        )


class WindowList(BaseModel):
    """Windows in the order of their beginnings."""

    items: list[WindowOut]
