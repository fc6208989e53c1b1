"""The pose that held at a time: the prior pose, or while an alert says so, the drifted one.

By what is known of that time now, which is more than was known then: a drift is told some people
after it began, and its pose best by those who came last.
"""

from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime

import numpy as np
from sqlalchemy.orm import Session

from models.geometry.pose import PARAMETERS, CameraPose
from models.geometry.rotation import Array
from models.monitoring.drift import served_error
from service.enums import PoseState
from service.reasons import ServiceCode
from service.store import alerts, cameras, estimates, zones
from service.store.cameras import PriorPoseRecord
from service.store.estimates import EstimateRecord
from service.store.zones import ZonesRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldPose:
    """A pose that held `since` a time.

    `identifiable` names the parameters that the tracks determine. `own` is the covariance (4, 4) of
    the pose's error relative to the prior pose, with those that they do not determine; None without
    an estimate. `prior` is the covariance of the prior pose, if that was estimated and accepted. If
    the camera has `drifted` and nothing is identifiable, its pose is unknown: `pose` is the prior
    pose, and wrong. An `assumed` pose is a usual one that nobody has confirmed.
    """

    pose: CameraPose
    drifted: bool
    since: datetime
    identifiable: tuple[str, ...]
    own: Array | None
    prior: Array | None
    prior_pose_id: int
    assumed: bool

    @property
    def covariance(self) -> Array | None:
        """How far off it may be in the world, as far as anything tells."""
        known = [each for each in (self.own, self.prior) if each is not None]
        return sum(known[1:], known[0]) if known else None


def held_pose(session: Session, camera_id: str, at: datetime | None = None) -> HeldPose:
    """The pose of a camera that there is, at a time, or now.

    An alert of kind `drift` says that it has moved, from its change until it is resolved, unless it
    was a false alarm. A wrong clock moves no camera.
    """
    at = at or datetime.now(UTC)
    prior = cameras.prior_pose_at(session, camera_id, at)
    if prior.assumed:
        return _held(prior, since=prior.created_at)
    drift = alerts.drift_at(session, camera_id, at)
    if drift is None:
        last = estimates.last_at(session, camera_id, prior.id, at.timestamp(), drifting=False)
        return _held(prior, last, since=prior.created_at)
    moved_s = None if drift.changed_at is None else drift.changed_at.timestamp()
    found = estimates.of_drift(
        session, camera_id, moved_s, drift.resolved_at, at.timestamp()
    ) or estimates.last_at(session, camera_id, prior.id, at.timestamp(), drifting=True)
    since = drift.changed_at or drift.opened_at
    if found is None:
        return _held(prior, since=since, drifted=True)
    prior = session.get_one(PriorPoseRecord, found.prior_pose_id)
    return _held(prior, found, since=since, drifted=True)


def drawn_since_move(record: ZonesRecord, held: HeldPose) -> bool:
    """True if zones were drawn while the camera was already where it is now, after a move."""
    return held.drifted and record.covariance is not None and record.drawn_at >= held.since


def keep_drawn(session: Session, camera_id: str, held: HeldPose) -> None:
    """Keep the zones as drawn at a new prior pose if the camera has not moved since.

    That applies to zones drawn since the drift whose pose is accepted: the new prior pose is an
    estimate of the position in which they were drawn. It also applies to zones drawn before the
    first pose was confirmed.

    Args:
        session: of a store.
        camera_id: of the camera.
        held: the pose that held until then.
    """
    record = zones.of_camera(session, camera_id)
    if record is None:
        return
    if held.assumed or drawn_since_move(record, held):
        prior = cameras.prior_pose(session, camera_id)
        record.prior_pose_id, record.pose, record.covariance = prior.id, asdict(prior.pose), None


def _four(covariance: list[list[float]]) -> Array:
    """A covariance (4, 4): people who propose a pose tell no heading."""
    known = np.array(covariance)
    return np.pad(known, (0, len(PARAMETERS) - len(known)))


def _learns_reference(estimate: EstimateRecord) -> bool:
    """True while nothing is judged: the camera is taken to be where it was registered."""
    return any(each.code == ServiceCode.LEARNING_REFERENCE for each in estimate.reasons)


def _held(
    prior: PriorPoseRecord,
    estimate: EstimateRecord | None = None,
    *,
    since: datetime,
    drifted: bool = False,
) -> HeldPose:
    pose, own = prior.pose, None
    names: tuple[str, ...] = ()
    if estimate is not None and drifted:
        pose = replace(pose, **asdict(estimate.pose))
    if estimate is not None and not _learns_reference(estimate):
        covariance = np.array(estimate.covariance)
        own = served_error(estimate.drift, prior.pose, covariance, pose, moved=drifted)
        if estimate.state not in (PoseState.UNSURE, PoseState.LEARNING):
            names = tuple(estimate.identifiable)
    return HeldPose(
        pose=pose,
        drifted=drifted,
        since=since,
        identifiable=names,
        own=own,
        prior=None if prior.covariance is None else _four(prior.covariance),
        prior_pose_id=prior.id,
        assumed=prior.assumed,
    )
