"""A person's answer about a camera, and what is kept of how it was before, to take it back by."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from service.enums import Activity
from service.store import alerts, cameras, estimates, references, zones
from service.store.zones import ZonesRecord

ANSWERS = (
    Activity.POSE_ACCEPTED,
    Activity.POSE_PUT_BACK,
    Activity.POSE_FIXED,
    Activity.POSE_FALSE_ALARM,
    Activity.REFERENCE_RESET,
)
_OF_REFERENCE = ("window_from_s", "changed_after_s", "changed_s", "answer", "answered_by")
_OF_ESTIMATE = ("drift_streak", "drifted")
_OF_ZONES = (ZonesRecord.prior_pose_id.key, ZonesRecord.pose.key, ZonesRecord.covariance.key)


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """A person's answer about a camera: who, if they say so, and why."""

    camera_id: str
    by: str | None
    note: str | None = None


def state_before(session: Session, camera_id: str) -> dict[str, Any]:
    """What an answer is about to change, as JSON, to be kept with it."""
    reference = references.newest(session, camera_id)
    last = estimates.newest(session, camera_id)
    drawn = zones.of_camera(session, camera_id)
    firing = [alerts.firing(session, camera_id, kind) for kind in alerts.POSE_KINDS]
    return {
        "alerts": [record.id for record in firing if record is not None],
        "prior_pose_id": cameras.prior_pose(session, camera_id).id,
        "reference_id": reference.id,
        "reference": {name: getattr(reference, name) for name in _OF_REFERENCE}
        | {"answered_at": _kept(reference.answered_at)},
        "estimate_id": None if last is None else last.id,
        "streak": None
        if last is None
        else {name: getattr(last, name) for name in _OF_ESTIMATE}
        | {"drift_after": _kept(last.drift_after), "drift_since": _kept(last.drift_since)},
        "zones": None if drawn is None else {name: getattr(drawn, name) for name in _OF_ZONES},
    }


def _kept(at: datetime | None) -> str | None:
    return None if at is None else at.isoformat()
