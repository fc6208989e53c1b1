"""What an estimate is made of, read in one transaction, and what it comes to without one."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from sqlalchemy.orm import Session

from models.drift.chart import Reading
from models.drift.chart_packing import chart_from_bytes
from models.drift.creep import SHARE
from models.drift.verdict import DriftLimits
from models.estimation.averaged import (
    FEWEST_TRACKS,
    PoseEstimate,
    TrackPredictions,
    averaged_estimate,
)
from models.estimation.joint.estimate import JointEstimate
from models.estimation.joint.packing import reference_from_bytes
from models.estimation.joint.reference import FEWEST_WALKERS
from models.flow.fusion import FusedEstimate
from models.flow.packing import flow_from_bytes
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.recalibration import (
    AlarmRate,
    CameraSite,
    Creep,
    Observations,
    SecondLook,
    assume_site,
    estimate_pose,
    observe,
    read_alarm_chart,
)
from models.simulation.walkers import WalkConfig
from models.trajectory import Trajectory
from service.alerting.alerts import fired_by_estimate
from service.estimation.anchoring import Anchor, anchor_of, creep_of, first_site
from service.estimation.lacks import Lacks
from service.estimation.limits import drift_limits
from service.kinds import AlertKind
from service.reasons import Reasons
from service.settings import Settings
from service.store import alerts, cameras, estimates, flow_maps, references, trainings
from service.store.packing import intrinsics_of, pose_of_prior
from service.store.tables.cameras import CameraRecord
from service.store.tables.references import SiteReferenceRecord
from service.store.tables.tracks import PredictionRecord, TrackRecord
from service.store.tables.trainings import ModelRecord
from service.store.tracks import predictions as stored_predictions
from service.store.tracks import tracks, windows
from service.windows.references import made_against, window_of
from service.windows.unpacked import Unpacked


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenTrack:
    """A track of the window. `unanswered`: it came after the last alert was put right."""

    pk: int
    unanswered: bool
    started_s: float
    ended_s: float
    trajectory: Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """The tracks of a window in the order of their ends, and what they are judged by.

    `site` is the learned reference as bytes; None while it is being learned. So are `flow`, `chart`
    and `anchor`; None where there is none. `predictions` has what the model in use says of the
    tracks. `tracks_a_year` is how many come; `alarms_a_year` how many false ones are allowed.
    `drifting` says that an alert tells of a drift by now.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What the evidence comes to. `tracks` are those after the `change`, where one was found.

    `fused` is to be served, `earlier` the same without the newest people, where the verdict asks
    for it. `reading` is what the drift chart says of the tracks after the change, or of all where
    these are too few, long before a pose can say how far; None where there is no chart. `creep`
    is what the anchor says of weeks; once the camera has crept, all else is by its first map, too.
    `lacks` names what should be there beside the served pose and failed.
    """

    joint: JointEstimate
    fused: FusedEstimate
    earlier: FusedEstimate | None
    averaged: PoseEstimate | None
    reading: Reading | None
    creep: Creep | None
    tracks: tuple[SeenTrack, ...]
    change: SeenTrack | None
    lacks: Reasons = ()

    @property
    def newest_pk(self) -> int:
        """The one of the tracks that was stored last."""
        return max(track.pk for track in self.tracks)


def load_evidence(
    session: Session, settings: Settings, camera_id: str, unpacked: Unpacked | None = None
) -> Evidence | None:
    """What there is to judge a camera by; None where there is nothing, or nothing new.

    Tracks that were `unpacked` already are not unpacked again.
    """
    unpacked = unpacked or Unpacked()
    camera = cameras.find(session, camera_id)
    reference = references.newest_if_any(session, camera_id)
    if camera is None or reference is None:
        return None
    bounds = window_of(session, reference, settings)
    records = windows.window(session, bounds)
    model = trainings.newest_model(session, camera_id)
    if len(records) < FEWEST_WALKERS or not _is_news(session, reference, model, records):
        return None
    intrinsics = intrinsics_of(camera)
    answered_at = alerts.answered_at(session, camera_id)
    kept = flow_maps.find(session, reference.id)
    predictions: Sequence[PredictionRecord] = []
    if model is not None:
        pks = [record.id for record in records]
        predictions = stored_predictions.predictions(session, model.id, pks)
    return Evidence(
        camera_id=camera_id,
        reference_id=reference.id,
        site=reference.data,
        flow=None if kept is None else kept.data,
        chart=None if kept is None else kept.chart,
        anchor=anchor_of(session, reference, bounds),
        intrinsics=intrinsics,
        prior=pose_of_prior(cameras.prior_pose(session, camera_id)),
        walk=walk_of(camera),
        tracks=tuple(
            SeenTrack(
                pk=record.id,
                unanswered=answered_at is None or record.received_at > answered_at,
                started_s=record.started_s,
                ended_s=record.ended_s,
                trajectory=unpacked.seen(record, intrinsics),
            )
            for record in records
        ),
        tracks_a_year=tracks.a_year(session, camera_id),
        alarms_a_year=settings.false_alarms_per_year,
        limits=drift_limits(settings),
        drifting=bool(fired_by_estimate(session, camera_id) & {AlertKind.DRIFT, AlertKind.CLOCK}),
        model_id=None if model is None else model.id,
        predictions=tuple(predictions),
    )


def compute_finding(evidence: Evidence, seed: int) -> Finding | None:
    """The pose by all estimators, from the newest change on; None where too few people walk."""
    observed = observe([track.trajectory for track in evidence.tracks], evidence.intrinsics)
    if observed.walkers < FEWEST_WALKERS:
        return None
    lacks = Lacks(evidence.camera_id)
    site = _site_of(evidence, observed, lacks)
    creep = lacks.unless_failed(
        "anchor", partial(creep_of, evidence.anchor, evidence.alarms_a_year)
    )
    if creep is not None and creep.moved and evidence.anchor is not None:
        first = lacks.unless_failed("anchor", partial(first_site, site, evidence.anchor))
        site = first or site
    judged = SecondLook(limits=evidence.limits, drifting=evidence.drifting)
    found = estimate_pose(observed, site, judged if asked_enough(evidence) else None)
    lacks.take(found.lacks)
    reading = None
    if site.chart is not None:
        reading = lacks.unless_failed(
            "chart", partial(_read, evidence, observed, site, found.first)
        )
    seen = evidence.tracks[found.first :]
    used = {track.pk for track in seen}
    predictions = as_predictions([row for row in evidence.predictions if row.track_pk in used])
    averaged = None
    if len(predictions) >= FEWEST_TRACKS:
        averaged = lacks.unless_failed("averaged", partial(averaged_estimate, predictions, seed))
    return Finding(
        joint=found.joint,
        fused=found.fused,
        earlier=found.earlier,
        averaged=averaged,
        reading=reading,
        creep=creep,
        tracks=seen,
        change=None if found.change_idx is None else evidence.tracks[found.change_idx],
        lacks=tuple(lacks.said),
    )


def _site_of(evidence: Evidence, observed: Observations, lacks: Lacks) -> CameraSite:
    """What is known of the site. The pose needs neither the flow map nor its chart.

    One of another release cannot be read: the next growth of the map brings new ones.
    """
    if evidence.site is None:
        return assume_site(observed, evidence.intrinsics, evidence.prior, evidence.walk)
    speed_reference = reference_from_bytes(evidence.site)
    flow, chart = None, None
    if evidence.flow is not None:
        flow = lacks.unless_failed("flow_map", partial(flow_from_bytes, evidence.flow))
    if flow is not None and evidence.chart is not None:
        chart = lacks.unless_failed("chart", partial(chart_from_bytes, evidence.chart))
    return CameraSite(
        intrinsics=evidence.intrinsics,
        prior=evidence.prior,
        speed_reference=speed_reference,
        flow=flow,
        chart=chart,
    )


def _read(
    evidence: Evidence, observed: Observations, site: CameraSite, first: int
) -> Reading | None:
    """What the chart says; once a person has said how the camera stands, it begins anew."""
    rate = AlarmRate(
        alarms_a_year=(1 - SHARE) * evidence.alarms_a_year,
        tracks_a_year=evidence.tracks_a_year,
        calm_ratio=evidence.limits.clear_ratio,
        calm_groups=evidence.limits.people,
    )
    unanswered = np.array([track.unanswered for track in evidence.tracks])
    return read_alarm_chart(observed, site, rate, counted=unanswered, first=first)


def asked_enough(evidence: Evidence) -> bool:
    """Whether enough people came since a person last said how the camera stands."""
    return sum(track.unanswered for track in evidence.tracks) >= evidence.limits.people


def walk_of(camera: CameraRecord) -> WalkConfig:
    """How fast people are assumed to walk where a camera looks."""
    return WalkConfig(
        speed_mean_mps=camera.walking_speed_mean_mps, speed_sd_mps=camera.walking_speed_sd_mps
    )


def as_predictions(records: Sequence[PredictionRecord]) -> TrackPredictions:
    """What a model says of tracks, as a value."""
    return TrackPredictions(
        height_m=np.array([record.height_m for record in records], dtype=np.float64),
        quaternion_wxyz=np.array(
            [(r.qw, r.qx, r.qy, r.qz) for r in records], dtype=np.float64
        ).reshape(-1, 4),
    )


def _is_news(
    session: Session,
    reference: SiteReferenceRecord,
    model: ModelRecord | None,
    records: Sequence[TrackRecord],
) -> bool:
    """Whether the last estimate was of other tracks, another model or another reference."""
    last = estimates.newest(session, reference.camera_id)
    if last is None or last.reference_id != reference.id:
        return True
    if reference.ready_at is not None and not made_against(reference, last):
        return True
    seen = (None if model is None else model.id, max(r.id for r in records), len(records))
    return (last.model_id, last.newest_track_pk, last.tracks) != seen
