"""How far cameras' references are: who counts for them, of all that were posted."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from sqlalchemy.orm import Session

from service.cameras.status import CameraStatus
from service.enums import PoseState, ReferenceState
from service.references import people_so_far
from service.settings import Settings
from service.store import fleet
from service.store.references import SiteReferenceRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceView:
    """The served part of a camera's reference.

    `counted` of `wanted` people are there, by `tracks` of which `pieces` go on others' walks; they
    are of so many different `hours` of date and time.
    """

    state: ReferenceState
    tracks: int
    counted: int
    pieces: int
    hours: int
    wanted: int
    walking_speed_mps: float | None

    @property
    def ready(self) -> bool:
        """True once it is learned."""
        return self.state == ReferenceState.READY

    @classmethod
    def of(cls, record: SiteReferenceRecord, settings: Settings, tracks: int) -> Self:
        """A reference of so many tracks."""
        return cls(
            state=ReferenceState.LEARNING if record.ready_at is None else ReferenceState.READY,
            tracks=tracks,
            counted=people_so_far(record, settings, tracks),
            pieces=record.pieces,
            hours=record.hours,
            wanted=record.wanted,
            walking_speed_mps=record.walking_speed_mps,
        )


def reference_views(
    session: Session, settings: Settings, statuses: Mapping[str, CameraStatus]
) -> dict[str, ReferenceView]:
    """The served part of the reference of each camera, by one statement for all that learn."""
    learning = {
        camera_id: each.attended.spans
        for camera_id, each in statuses.items()
        # Of who is unconnected nothing is stored.
        if each.reference.ready_at is None and each.state != PoseState.UNCONNECTED
    }
    counts = fleet.learning_counts(session, learning.keys(), learning) if learning else {}
    return {
        camera_id: ReferenceView.of(
            each.reference,
            settings,
            each.reference.tracks if each.reference.ready_at else counts.get(camera_id, 0),
        )
        for camera_id, each in statuses.items()
    }
