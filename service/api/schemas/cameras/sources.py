"""Bodies of `/cameras/{id}/sources`."""

from datetime import datetime
from typing import Self

from pydantic import BaseModel

from service.api.schemas.base import Body, Who
from service.cameras.sources import SourceView


class UseBody(Body):
    """Who says that a source is to count."""

    by: Who | None = None


class SourceOut(BaseModel):
    """A source of tracks; `usable_tracks` of `wanted_tracks` would make a reference of it."""

    name: str
    counts: bool
    tracks: int
    usable_tracks: int
    wanted_tracks: int
    first_seen_at: datetime
    last_seen_at: datetime

    @classmethod
    def from_value(cls, value: SourceView) -> Self:
        """The body of a source."""
        return cls(
            name=value.record.name,
            counts=value.counts,
            tracks=value.record.tracks,
            usable_tracks=value.usable,
            wanted_tracks=value.wanted,
            first_seen_at=value.record.first_seen_at,
            last_seen_at=value.record.last_seen_at,
        )


class SourceList(BaseModel):
    """Sources, the first to post first."""

    items: list[SourceOut]
