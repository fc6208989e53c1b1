"""Events for open pages and clients of what no estimate, alert or training tells of."""

from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from service.enums import EventType
from service.store import journal


def tell_of_camera(session: Session, camera_id: str, **what: Any) -> None:
    """Tell that a camera is another than it was: registered, changed, removed, proposed a pose.

    It is an event of its pose, with the same fields; what they are now is to be asked for.
    """
    event = {"camera_id": camera_id, "state": None, "tracks": 0, "drift": None, **what}
    journal.add_event(session, EventType.POSE, event, datetime.now(UTC))
