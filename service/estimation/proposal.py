"""The proposed pose of a camera without a prior pose: a job's work, some tenths of a second."""

from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from models.errors import TooFewTrajectoriesError
from models.geometry.intrinsics import Intrinsics
from models.pose import SelfCalibration, self_calibrate
from models.reasons import Reason
from models.simulation.walkers import WalkConfig
from models.tracks.trajectory import Trajectory
from service.enums import PoseState
from service.estimation.evidence import Unpacked, walk_of
from service.estimation.learning import save_doubt, unstated_tracks
from service.notifications.events import tell_of_camera
from service.references import window_of
from service.settings import Settings
from service.store import cameras, references, windows
from service.store.cameras import CameraRecord, ProposedPoseRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class People:
    """The newest people before a camera, by their ends, and what was measured of its pose.

    The image size of the `unstated` ones is not known, and may be `doubted` already.
    """

    prior_pose_id: int
    intrinsics: Intrinsics
    walk: WalkConfig
    measured: dict[str, float]
    tracks: tuple[Trajectory, ...]
    unstated: tuple[Trajectory, ...]
    doubted: bool


def load_people(
    session: Session, settings: Settings, camera_id: str, unpacked: Unpacked
) -> People | None:
    """The people who tell the pose of a camera; None where a prior pose was said or agreed to."""
    camera = session.get(CameraRecord, camera_id)
    reference = references.newest_if_any(session, camera_id)
    if camera is None or reference is None:
        return None
    prior = cameras.prior_pose(session, camera_id)
    if not prior.assumed:
        return None
    bounds = window_of(session, reference, settings)
    records = windows.window(session, bounds, unpacked.budget)
    intrinsics = camera.intrinsics
    return People(
        prior_pose_id=prior.id,
        intrinsics=intrinsics,
        walk=walk_of(camera),
        measured=prior.measured,
        tracks=tuple(unpacked.seen(record, intrinsics) for record in records),
        unstated=unstated_tracks(camera, reference.source, records, unpacked),
        doubted=bool(reference.doubts),
    )


def compute_proposal(people: People) -> SelfCalibration | None:
    """The pose that people tell; None where too few of them walk."""
    try:
        return self_calibrate(people.tracks, people.intrinsics, people.walk, people.measured)
    except TooFewTrajectoriesError:
        return None


def save_proposal(
    session: Session,
    camera_id: str,
    people: People,
    found: SelfCalibration | None,
    doubt: Reason | None,
) -> None:
    """Store a proposed pose, and a doubt about the image size of the tracks, if there is one.

    Nothing is stored if the camera got another prior pose in the meantime.
    """
    if cameras.prior_pose(session, camera_id).id != people.prior_pose_id:
        return
    save_doubt(session, references.newest(session, camera_id), doubt)
    if found is None:
        return
    record = ProposedPoseRecord(
        prior_pose_id=people.prior_pose_id,
        height_m=found.pose.height_m,
        tilt_rad=found.pose.tilt_rad,
        roll_rad=found.pose.roll_rad,
        covariance=found.covariance.tolist(),
        identifiable=list(found.identifiable),
        tracks=len(people.tracks),
        walking_groups=found.walking_groups,
        created_at=datetime.now(UTC),
    )
    session.merge(record)
    tell_of_camera(session, camera_id, state=PoseState.UNCALIBRATED)
