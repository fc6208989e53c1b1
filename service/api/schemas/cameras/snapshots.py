"""Bodies of `/cameras/{id}/snapshot`."""

from datetime import datetime

from pydantic import BaseModel


class SnapshotOut(BaseModel):
    """What is known of a still image."""

    sha256: str
    width: int
    height: int
    stored_at: datetime
