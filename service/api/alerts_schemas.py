"""Bodies of `/alerts`."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any, Self

from pydantic import BaseModel, Field

from service.api.fields import Body, Moment, ReasonCode, ReasonValues, Who
from service.enums import AlertActivity, AlertKind, AlertState, Answer, Outcome, Severity
from service.notifications.outbox import alert_body
from service.store.activity import ActivityRecord
from service.store.alerts import AlertRecord


class AcknowledgeBody(Body):
    """Who has seen the alert."""

    by: Who | None = None


class SilenceBody(Body):
    """Until when nobody is to be woken by the alert, and why; null ends a silence."""

    until: Moment | None
    reason: str | None = Field(None, max_length=2000)
    by: Who | None = None


class ResolveBody(Body):
    """How an alert ended."""

    outcome: Answer
    note: str | None = Field(None, max_length=2000)
    by: Who | None = None


class AlertOut(BaseModel):
    """An alert; a group's has no `camera_id` but `camera_ids`.

    `acknowledged` and `silenced` are flags of a firing alert, not states.
    """

    id: str
    camera_id: str | None
    kind: AlertKind
    state: AlertState
    severity: Severity
    reason: str
    reason_code: ReasonCode | None
    reason_values: ReasonValues
    drift: dict[str, Any]
    opened_at: datetime
    changed_at: datetime | None
    updated_at: datetime
    acknowledged: bool = False
    acknowledged_by: str | None
    acknowledged_at: datetime | None
    silenced: bool = False
    silenced_until: datetime | None
    silence_reason: str | None
    silenced_by: str | None
    resolved_at: datetime | None
    resolved_by: str | None
    outcome: Outcome | None
    note: str | None
    track_source: str | None
    camera_ids: list[str] | None
    group_id: str | None

    @classmethod
    def from_record(cls, record: AlertRecord) -> Self:
        """The body of a stored alert."""
        return cls.model_validate(alert_body(record))


class ActOut(BaseModel):
    """What somebody did with an alert; without a name, the service by itself."""

    at: datetime
    act: AlertActivity
    by: str | None
    until: datetime | None
    outcome: Outcome | None
    note: str | None

    @classmethod
    def from_record(cls, record: ActivityRecord) -> Self:
        """The body of an entry of the log."""
        values = {name: getattr(record, name) for name in cls.model_fields if name != "act"}
        return cls.model_validate({**values, "act": record.what.partition(".")[2]})


class AlertDetail(AlertOut):
    """An alert, and what was done with it, oldest first."""

    acts: list[ActOut] = []

    @classmethod
    def from_records(cls, record: AlertRecord, acts: Sequence[ActivityRecord]) -> Self:
        """The body of a stored alert with its acts."""
        body = cls.from_record(record)
        body.acts = [ActOut.from_record(act) for act in acts]
        return body


class AlertList(BaseModel):
    """Alerts, newest first."""

    items: list[AlertOut]
