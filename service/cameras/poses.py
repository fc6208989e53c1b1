"""The served pose, from the store alone, and its history."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from sqlalchemy.orm import Session

from models.geometry.pose import CameraPose
from service.cameras.cameras import no_camera, require_camera
from service.cameras.standing import Standing, standings
from service.cameras.state_words import reasons_of
from service.enums import PoseState
from service.reason_words import in_words
from service.reasons import Reasons
from service.references import tracks_so_far
from service.settings import Settings
from service.store import cameras, estimates, fleet
from service.store.estimates import EstimateRecord
from service.store.serialization import intrinsics_of, pose_of_prior


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceView:
    """What is served of a camera's reference."""

    ready: bool
    tracks: int
    wanted: int
    walking_speed_mps: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseView:
    """What is served of a camera's pose, and how the camera stands."""

    camera_id: str
    standing: Standing
    reasons: Reasons
    pose: CameraPose
    reference: ReferenceView
    model_id: str | None
    etag: str

    @property
    def state(self) -> PoseState:
        """How the camera stands, in a word."""
        return self.standing.state

    @property
    def reason(self) -> str:
        """Why it stands so, in words."""
        return in_words(self.reasons)

    @property
    def estimate(self) -> EstimateRecord | None:
        """What the pose is of; it may tell nothing yet."""
        return self.standing.estimate

    @property
    def identifiable(self) -> tuple[str, ...]:
        """Those of tilt, roll, height, heading that are estimated."""
        return self.standing.identifiable


def view_pose(session: Session, settings: Settings, camera_id: str) -> PoseView:
    """The served pose, from the store alone.

    Raises:
        NotFoundError: there is no such camera.
    """
    set_up = cameras.as_set_up(session, camera_id)
    if set_up is None:
        raise no_camera(camera_id)
    camera, prior, model_id = set_up
    standing = standings(session, settings, (camera_id,))[camera_id]
    record = standing.reference
    counts = {}
    if record.ready_at is None:
        attended = {camera_id: standing.attended.spans}
        counts = fleet.learning_counts(session, (camera_id,), attended)
    so_far = tracks_so_far(record, settings, counts.get(camera_id, 0))
    reasons = reasons_of(session, settings, standing, so_far)
    pose = pose_of_prior(prior)
    estimate = standing.estimate
    if estimate is not None:
        pose = replace(
            pose,
            height_m=estimate.pose.height_m,
            tilt_rad=estimate.pose.tilt_rad,
            roll_rad=estimate.pose.roll_rad,
            heading_rad=estimate.pose.heading_rad,
        )
    reference = ReferenceView(
        ready=record.ready_at is not None,
        tracks=so_far,
        wanted=record.wanted,
        walking_speed_mps=record.walking_speed_mps,
    )
    estimate_id = None if estimate is None else estimate.id
    # All that the answers are made of: the lens of `pose.yaml`, and reasons by their values, since
    # words round them.
    why, lens = (reasons, in_words(reasons)), intrinsics_of(camera)
    served = (standing.state.value, why, pose, estimate_id, reference, model_id, lens)
    return PoseView(
        camera_id=camera_id,
        standing=standing,
        reasons=reasons,
        pose=pose,
        reference=reference,
        model_id=model_id,
        etag=f'"{hashlib.sha256(repr(served).encode()).hexdigest()[:24]}"',
    )


def pose_history(
    session: Session, camera_id: str, start: datetime | None, end: datetime | None, limit: int
) -> Sequence[EstimateRecord]:
    """The estimates between two times, oldest first; the newest so many of them.

    Raises:
        NotFoundError: there is no such camera.
    """
    require_camera(session, camera_id)
    return estimates.between(session, camera_id, start, end, limit)


def thinned_history(
    session: Session, camera_id: str, start: datetime | None, end: datetime | None, most: int
) -> Sequence[EstimateRecord]:
    """At most so many of the estimates between two times, evenly thinned out, oldest first.

    Raises:
        NotFoundError: there is no such camera.
    """
    require_camera(session, camera_id)
    return estimates.thinned(session, camera_id, start, end, most)
