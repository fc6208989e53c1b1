"""Bodies of `/alerts`."""

from datetime import datetime
from typing import Any, Literal, Self

from pydantic import BaseModel, Field

from service.schemas.base import Body, Who
from service.store.tables import AlertRecord


class AcknowledgeBody(Body):
    """Who has seen the alert."""

    by: Who | None = None


class ResolveBody(Body):
    """How an alert ended."""

    outcome: Literal["put_back", "accepted", "false_alarm"]
    note: str | None = Field(None, max_length=2000)
    by: Who | None = None


class AlertOut(BaseModel):
    """An alert."""

    id: str
    camera_id: str
    kind: str
    state: str
    severity: str
    reason: str
    drift: dict[str, Any]
    opened_at: datetime
    changed_at: datetime | None
    updated_at: datetime
    acknowledged_by: str | None
    acknowledged_at: datetime | None
    silenced_until: datetime | None
    resolved_at: datetime | None
    resolved_by: str | None
    outcome: str | None
    note: str | None

    @classmethod
    def from_record(cls, record: AlertRecord) -> Self:
        """The body of a stored alert."""
        return cls.model_validate(record, from_attributes=True)


class AlertList(BaseModel):
    """Alerts, newest first."""

    items: list[AlertOut]
