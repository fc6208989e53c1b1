"""A track as it is read: a row, for hundreds are read for each estimate."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from service.store.tables.tracks import TrackRecord


class StoredTrack(NamedTuple):
    """What estimates need of a track; as a `TrackRecord` has it."""

    id: int
    track_id: str
    started_s: float
    ended_s: float
    points: bytes
    boxes: bytes | None
    heads: bytes | None
    received_at: datetime


_COLUMNS = [getattr(TrackRecord, name) for name in StoredTrack._fields]


def select_tracks() -> Select[Any]:
    """A statement whose rows `read` takes."""
    return select(*_COLUMNS)


def read(session: Session, statement: Select[Any]) -> Sequence[StoredTrack]:
    """The tracks that a statement finds."""
    return [StoredTrack._make(row) for row in session.execute(statement)]
