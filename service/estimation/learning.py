"""Learn a camera's reference once its tracks are there: a job's work, seconds of a core."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum

from sqlalchemy.orm import Session

from models.durations import HOUR_S
from models.errors import TooFewTrajectoriesError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.pose import CameraSite, learn_site, observe, reference_to_bytes
from models.reasons import Reason, TracksCode
from models.simulation.walkers import WalkConfig
from models.tracks.trajectory import Trajectory
from service.access.activity import note
from service.alerts.alerts import open_alert
from service.enums import Activity, AlertKind, AlertSource, Severity
from service.estimation.anchoring import keep_paths, paths_of
from service.estimation.evidence import Unpacked, until_so_many, walk_of
from service.notifications.events import tell_of_camera
from service.reasons import some
from service.references import attendance_of, wanted_tracks
from service.settings import Settings
from service.store import cameras, references, windows
from service.store.cameras import CameraRecord
from service.store.references import SiteReferenceRecord
from service.store.tracks import StoredTrack

# What does not fit the prior pose: speeds or statures out of all proportion, or the pose itself.
_DOUBT_KINDS: dict[StrEnum, AlertKind] = {
    TracksCode.SPEED_UNUSUAL: AlertKind.CLOCK,
    TracksCode.STATURE_UNUSUAL: AlertKind.CLOCK,
    TracksCode.PRIOR_POSE_DOUBTED: AlertKind.DRIFT,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferencePeriod:
    """The tracks of a reference, in the order of their ends, and what else it is learned of.

    There may not be `enough` yet. `pieces` of them go on others' walks; they ended in so many
    different `hours` of date and time (UTC). The image size of the `unstated` ones is not known.
    """

    reference_id: int
    enough: bool
    pieces: int
    hours: int
    intrinsics: Intrinsics
    prior: CameraPose
    walk: WalkConfig
    trajectories: tuple[Trajectory, ...]
    unstated: tuple[Trajectory, ...]

    @property
    def to_s(self) -> float:
        """The end of the last track."""
        return float(self.trajectories[-1].time_s[-1])


def load_reference_period(
    session: Session, settings: Settings, camera_id: str, unpacked: Unpacked | None = None
) -> ReferencePeriod | None:
    """The tracks to learn a camera's reference of, as far as they are there.

    None where nothing is to be learned now.
    """
    unpacked = unpacked or Unpacked()
    camera = session.get(CameraRecord, camera_id)
    reference = references.newest_if_any(session, camera_id)
    if camera is None or reference is None or reference.ready_at is not None:
        return None
    now = datetime.now(UTC)
    if references.maintenance_under_way(session, camera_id, now) is not None:
        return None  # what it doubts could not be told now
    wanted = wanted_tracks(reference, settings)
    attended = attendance_of(session, camera_id, now)
    intrinsics = camera.intrinsics
    prior = cameras.prior_pose(session, camera_id).pose
    gathered = until_so_many(
        lambda limit: windows.first(
            session, camera_id, reference.from_s, limit, attended.spans, unpacked.budget
        ),
        wanted,
        intrinsics,
        prior,
        unpacked,
    )
    records = gathered.records
    return ReferencePeriod(
        reference_id=reference.id,
        enough=gathered.enough,
        pieces=gathered.pieces,
        hours=len({record.ended_s // HOUR_S for record in records}),
        intrinsics=intrinsics,
        prior=prior,
        walk=walk_of(camera),
        trajectories=tuple(unpacked.seen(record, intrinsics) for record in records),
        unstated=unstated_tracks(camera, reference.source, records, unpacked),
    )


def unstated_tracks(
    camera: CameraRecord, source: str | None, records: Sequence[StoredTrack], unpacked: Unpacked
) -> tuple[Trajectory, ...]:
    """Tracks of a source whose image size is neither stated nor declared."""
    if source is None or source in (camera.image_sizes or {}):
        return ()
    return tuple(
        unpacked.seen(record, camera.intrinsics)
        for record in records
        if record.first_px is not None
    )


def compute_reference(period: ReferencePeriod, seed: int) -> CameraSite | None:
    """The walkers and paths that are usual at the site; None where too few of the tracks walk."""
    observed = observe(period.trajectories, period.intrinsics, period.prior)
    try:
        return learn_site(observed, period.intrinsics, period.prior, period.walk, seed=seed)
    except TooFewTrajectoriesError:
        return None


def save_progress(
    session: Session, camera_id: str, period: ReferencePeriod, doubt: Reason | None
) -> None:
    """Store the progress of a reference, and a doubt about the image size of its tracks."""
    record = references.newest_if_any(session, camera_id)
    if record is None or record.id != period.reference_id or record.ready_at is not None:
        return
    record.pieces, record.hours = period.pieces, period.hours
    save_doubt(session, record, doubt)


def save_doubt(session: Session, record: SiteReferenceRecord, doubt: Reason | None) -> None:
    """Store a doubt about the image size of the tracks of a reference, or that there is none."""
    camera = session.get(CameraRecord, record.camera_id)
    if camera is None or record.source in (camera.image_sizes or {}):
        doubt = None  # it was declared while this was computed
    if record.doubts != some(doubt):
        record.doubts = some(doubt)
        tell_of_camera(session, record.camera_id)


def save_reference(
    session: Session,
    settings: Settings,
    camera_id: str,
    period: ReferencePeriod,
    learned: CameraSite | None,
) -> None:
    """Make a learned reference the one that counts, unless another has begun meanwhile.

    Where too few of the tracks walk, as many again are waited for.
    """
    record = references.newest_if_any(session, camera_id)
    if record is None or record.id != period.reference_id or record.ready_at is not None:
        return
    record.pieces, record.hours, record.doubts = period.pieces, period.hours, ()
    if learned is None:
        record.wanted += max(record.wanted, 1)
        return
    site, paths = learned.speed_reference, paths_of(learned)
    record.to_s = period.to_s
    record.tracks = len(period.trajectories)
    record.data = reference_to_bytes(site)
    record.walking_speed_mps = site.walking_speed_mps
    record.doubts = some(site.implausible)
    record.ready_at = datetime.now(UTC)
    details = {"tracks": record.tracks, "walking_speed_mps": site.walking_speed_mps}
    note(session, Activity.REFERENCE_LEARNED, by=None, camera_id=camera_id, details=details)
    keep_paths(
        session,
        record.id,
        paths,
        tracks=record.tracks,
        weight=float(record.tracks),
        to_s=period.to_s,
        learned_at=record.ready_at,
        anchored=True,
    )
    if site.implausible is not None:
        _warn(session, settings, camera_id, site.implausible)


def _warn(session: Session, settings: Settings, camera_id: str, doubt: Reason) -> None:
    open_alert(
        session,
        settings,
        camera_id,
        _DOUBT_KINDS[doubt.code],
        Severity.WARNING,
        drift={},
        changed_at=None,
        reasons=(doubt,),
        source=AlertSource.REFERENCE,
    )
