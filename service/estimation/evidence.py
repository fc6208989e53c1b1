"""The input of an estimate, read in one transaction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
import numpy.typing as npt
from sqlalchemy.orm import Session

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.monitoring.verdict import DriftLimits
from models.simulation.walkers import WalkConfig
from models.tracks.trajectory import Trajectory
from models.walking.config import FEWEST_WALKERS
from service.alerts.alerts import fired_by_estimate
from service.estimation.anchoring import Anchor, anchor_of
from service.estimation.limits import drift_limits
from service.estimation.people import Unpacked, until_so_many
from service.references import made_against, window_of
from service.settings import Settings
from service.store import alerts, cameras, estimates, references, tracks, trainings, windows
from service.store.cameras import CameraRecord
from service.store.references import FlowMapRecord, LastPoseRecord, SiteReferenceRecord
from service.store.tracks import StoredTrack
from service.store.trainings import ModelRecord
from service.store.windows import PredictionRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenTrack:
    """A track of the window. `unanswered`: it came after the last alert was put right."""

    pk: int
    unanswered: bool
    started_s: float
    ended_s: float
    trajectory: Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptPose:
    """A last pose as bytes, and the `basis` that it hangs on: the site and what is suspected."""

    basis: bytes
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """The tracks of a window in the order of their ends, and what they are judged by.

    `site` is the learned reference as bytes; None while it is being learned. So are `flow`, `chart`
    and `anchor`; None where there is none. `predictions` has what the model in use says of the
    tracks. `tracks_a_year` is how many come; `alarms_a_year` how many false ones are allowed.
    `drifting` says that an alert tells of a drift by now. `before` is the piece before each of the
    tracks of a walk, as of `link_pieces`; None where nobody has looked yet. `last` is where the
    estimate before ended.
    """

    camera_id: str
    reference_id: int
    site: bytes | None
    flow: bytes | None
    chart: bytes | None
    anchor: Anchor | None
    intrinsics: Intrinsics
    prior: CameraPose
    walk: WalkConfig
    tracks: tuple[SeenTrack, ...]
    tracks_a_year: float
    alarms_a_year: float
    limits: DriftLimits
    drifting: bool
    model_id: str | None
    predictions: tuple[PredictionRecord, ...]
    before: npt.NDArray[np.int64] | None = None
    last: KeptPose | None = None


def load_evidence(
    session: Session, settings: Settings, camera_id: str, unpacked: Unpacked | None = None
) -> Evidence | None:
    """The tracks to judge a camera by, and what else; None where there is nothing, or nothing new.

    Tracks that were `unpacked` already are not unpacked again.
    """
    unpacked = unpacked or Unpacked()
    camera = session.get(CameraRecord, camera_id)
    reference = references.newest_if_any(session, camera_id)
    if camera is None or reference is None:
        return None
    intrinsics = camera.intrinsics
    prior = cameras.prior_pose(session, camera_id).pose
    bounds = window_of(session, reference, settings)
    gathered = until_so_many(
        lambda limit: windows.window(session, replace(bounds, tracks=limit)),
        bounds.tracks,
        intrinsics,
        prior,
        unpacked,
        newest=True,
    )
    records, model = gathered.records, trainings.newest_model(session, camera_id)
    if len(records) < FEWEST_WALKERS or not _is_news(session, reference, model, records):
        return None
    kept = session.get(FlowMapRecord, reference.id)
    last = session.get(LastPoseRecord, reference.id)
    answered_at = alerts.answered_at(session, camera_id)
    seen = [_seen(record, answered_at, intrinsics, unpacked) for record in records]
    return Evidence(
        camera_id=camera_id,
        reference_id=reference.id,
        site=reference.data,
        flow=None if kept is None else kept.data,
        chart=None if kept is None else kept.chart,
        anchor=anchor_of(session, reference, bounds),
        intrinsics=intrinsics,
        prior=prior,
        walk=walk_of(camera),
        tracks=tuple(seen),
        tracks_a_year=tracks.a_year(session, camera_id),
        alarms_a_year=settings.false_alarms_per_year,
        limits=drift_limits(settings),
        drifting=bool(fired_by_estimate(session, camera_id)),
        model_id=None if model is None else model.id,
        predictions=_predictions(session, model, records),
        before=gathered.before,
        last=None if last is None else KeptPose(basis=last.basis, data=last.data),
    )


def _seen(
    record: StoredTrack, answered_at: datetime | None, intrinsics: Intrinsics, unpacked: Unpacked
) -> SeenTrack:
    return SeenTrack(
        pk=record.id,
        unanswered=answered_at is None or record.received_at > answered_at,
        started_s=record.started_s,
        ended_s=record.ended_s,
        trajectory=unpacked.seen(record, intrinsics),
    )


def _predictions(
    session: Session, model: ModelRecord | None, records: Sequence[StoredTrack]
) -> tuple[PredictionRecord, ...]:
    if model is None:
        return ()
    pks = [record.id for record in records]
    return tuple(windows.predictions(session, model.id, pks))


def walk_of(camera: CameraRecord) -> WalkConfig:
    """The assumed walking speed where a camera looks."""
    return WalkConfig(
        speed_mean_mps=camera.walking_speed_mean_mps, speed_sd_mps=camera.walking_speed_sd_mps
    )


def _is_news(
    session: Session,
    reference: SiteReferenceRecord,
    model: ModelRecord | None,
    records: Sequence[StoredTrack],
) -> bool:
    """True where the last estimate was of other tracks, another model or another reference."""
    last = estimates.newest(session, reference.camera_id)
    if last is None or last.reference_id != reference.id:
        return True
    if reference.ready_at is not None and not made_against(reference, last):
        return True
    seen = (None if model is None else model.id, max(r.id for r in records), len(records))
    return (last.model_id, last.newest_track_pk, last.tracks) != seen
