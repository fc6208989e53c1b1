"""Bodies of `/activity`."""

from datetime import datetime
from typing import Any

from pydantic import BaseModel, ConfigDict

from service.enums import Activity, AlertKind, Outcome


class EntryOut(BaseModel):
    """What somebody did; without a name, the service by itself."""

    model_config = ConfigDict(from_attributes=True)

    id: int
    at: datetime
    what: Activity
    by: str | None
    via: str | None
    camera_id: str | None
    subject_id: str | None
    kind: AlertKind | None
    until: datetime | None
    outcome: Outcome | None
    note: str | None
    details: dict[str, Any]


class ActivityPage(BaseModel):
    """Entries, oldest first; `next_cursor` is the `after` of the next page."""

    items: list[EntryOut]
    next_cursor: int | None
