"""When somebody was at a camera: what it saw then says nothing of how it stands."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from service.store import maintenance
from service.store.maintenance import MaintenanceRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Attendance:
    """The times, from and to, in which somebody was or will be at a camera, by its windows.

    `judged_from_s` is when the last of them ended, or will, that has begun; what the camera saw
    before does not say how it stands after it. `announced` has when each window began, and when it
    was last told of or changed.
    """

    spans: tuple[tuple[float, float], ...]
    judged_from_s: float | None
    announced: tuple[tuple[float, datetime], ...]

    def announced_late(self, known_at: datetime, known_to_s: float) -> bool:
        """Whether a window was told of after a time that reaches into what was known then."""
        return any(from_s <= known_to_s and at > known_at for from_s, at in self.announced)

    def free_since_s(self, now: datetime) -> float | None:
        """When somebody last left the camera; None where nobody was there."""
        left = [to_s for _, to_s in self.spans if to_s <= now.timestamp()]
        return left[-1] if left else None

    def under_way(self, now: datetime) -> bool:
        """Whether somebody is at the camera."""
        return any(from_s <= now.timestamp() < to_s for from_s, to_s in self.spans)


def attendance_of(session: Session, camera_id: str, now: datetime) -> Attendance:
    """When somebody was at a camera."""
    return attendance_by(maintenance.of_camera(session, camera_id), now)


def attendance_by(records: Sequence[MaintenanceRecord], now: datetime) -> Attendance:
    """The same by windows in the order of their beginnings; overlapping ones are one time."""
    spans: list[tuple[float, float]] = []
    for record in records:
        from_s, to_s = record.from_at.timestamp(), record.until.timestamp()
        if spans and from_s <= spans[-1][1]:
            spans[-1] = (spans[-1][0], max(spans[-1][1], to_s))
        else:
            spans.append((from_s, to_s))
    begun = [to_s for from_s, to_s in spans if from_s <= now.timestamp()]
    return Attendance(
        spans=tuple(spans),
        judged_from_s=begun[-1] if begun else None,
        announced=tuple((record.from_at.timestamp(), record.updated_at) for record in records),
    )
