"""Events for open pages and clients of what has no estimate to tell of it."""

from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.enums import EventType, PoseState
from service.store import journal


def tell_proposed(session: Session, camera_id: str) -> None:
    """Tell that another pose is proposed for a camera without a prior pose."""
    event = {"camera_id": camera_id, "state": PoseState.UNCALIBRATED}
    journal.add_event(session, EventType.POSE, event, datetime.now(UTC))
