"""What an estimate is made of, read in one transaction, and what it comes to without one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from sqlalchemy.orm import Session

from models.drift.chart import RUN, DriftChart, Reading, read_chart
from models.drift.chart_packing import chart_from_bytes
from models.drift.party_scores import Usual, score_parties
from models.drift.verdict import DriftLimits
from models.estimation.averaged import (
    FEWEST_TRACKS,
    PoseEstimate,
    TrackPredictions,
    averaged_estimate,
)
from models.estimation.joint.estimate import JointEstimate, joint_estimate
from models.estimation.joint.observations import Observations, observe, of_tracks
from models.estimation.joint.packing import reference_from_bytes
from models.estimation.joint.reference import assumed_reference
from models.flow.fusion import FusedEstimate, by_speeds_alone, fused_estimate
from models.flow.packing import flow_from_bytes
from models.flow.reference import FlowReference
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.simulation.walkers import WalkConfig
from models.trajectory import Trajectory
from service.kinds import AlertKind
from service.reasons import Reasons
from service.recalibration.alerts import fired_by_estimate
from service.recalibration.changes import change_among
from service.recalibration.lacks import Lacks
from service.recalibration.limits import drift_limits
from service.recalibration.references import FEWEST_WALKERS, made_against, window_of
from service.recalibration.second_look import drift_of, look_again
from service.settings import Settings
from service.store import alerts, cameras, estimates, flow_maps, references, tracks, trainings
from service.store.packing import intrinsics_of, pose_of_prior, seen_of
from service.store.tables import (
    CameraRecord,
    ModelRecord,
    PredictionRecord,
    SiteReferenceRecord,
    TrackRecord,
)


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

    `site` is the learned reference as bytes; None while it is being learned. So are `flow` and
    `chart`; None where there is none. `predictions` has what the model in use says of the tracks.
    `tracks_a_year` is how many come; `alarms_a_year` how many false ones are allowed. `drifting`
    says that an alert tells of a drift by now.
    """

    camera_id: str
    reference_id: int
    site: bytes | None
    flow: bytes | None
    chart: bytes | None
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
    these are too few, long before a pose can say how far; None where there is no chart.
    `lacks` names what should be there beside the served pose and failed.
    """

    joint: JointEstimate
    fused: FusedEstimate
    earlier: FusedEstimate | None
    averaged: PoseEstimate | None
    reading: Reading | None
    tracks: tuple[SeenTrack, ...]
    change: SeenTrack | None
    lacks: Reasons = ()

    @property
    def newest_pk(self) -> int:
        """The one of the tracks that was stored last."""
        return max(track.pk for track in self.tracks)


def gather(session: Session, settings: Settings, camera_id: str) -> Evidence | None:
    """What there is to judge a camera by; None where there is nothing, or nothing new."""
    camera = cameras.find(session, camera_id)
    reference = references.newest_if_any(session, camera_id)
    if camera is None or reference is None:
        return None
    records = tracks.window(session, window_of(session, reference, settings))
    model = trainings.newest_model(session, camera_id)
    if len(records) < FEWEST_WALKERS or not _is_news(session, reference, model, records):
        return None
    intrinsics = intrinsics_of(camera)
    answered_at = alerts.answered_at(session, camera_id)
    kept = flow_maps.find(session, reference.id)
    predictions: Sequence[PredictionRecord] = []
    if model is not None:
        pks = [record.id for record in records]
        predictions = tracks.predictions(session, model.id, pks)
    return Evidence(
        camera_id=camera_id,
        reference_id=reference.id,
        site=reference.data,
        flow=None if kept is None else kept.data,
        chart=None if kept is None else kept.chart,
        intrinsics=intrinsics,
        prior=pose_of_prior(cameras.prior_pose(session, camera_id)),
        walk=walk_of(camera),
        tracks=tuple(
            SeenTrack(
                pk=record.id,
                unanswered=answered_at is None or record.received_at > answered_at,
                started_s=record.started_s,
                ended_s=record.ended_s,
                trajectory=seen_of(record, intrinsics),
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


def weigh(evidence: Evidence, seed: int) -> Finding | None:
    """The pose by all estimators, from the newest change on; None where too few people walk."""
    observations = observe([track.trajectory for track in evidence.tracks], evidence.intrinsics)
    if observations.walkers < FEWEST_WALKERS:
        return None
    lens, prior = evidence.intrinsics, evidence.prior
    seen, change, first = evidence.tracks, None, 0
    reading = earlier = None
    lacks = Lacks(evidence.camera_id)
    if evidence.site is None:
        joint = joint_estimate(
            observations, prior, assumed_reference(observations, prior, evidence.walk)
        )
        fused = by_speeds_alone(joint, prior)
    else:
        site = reference_from_bytes(evidence.site)
        flow, chart = _paths_of(evidence, lacks)
        ends_s = np.array([track.ended_s for track in seen])
        every = observations
        among = partial(change_among, every, ends_s, lens, prior, site)
        changed = None if flow is None else lacks.unless_failed("flow_map", partial(among, flow))
        if changed is None:
            flow = None
        found, observations, joint = changed or among(None)
        if found is not None:
            change = seen[found]
            seen = tuple(track for track in seen if track.ended_s >= change.ended_s)
            first = len(evidence.tracks) - len(seen)
        if flow is not None and chart is not None:
            reading = lacks.unless_failed(
                "chart", partial(_read, evidence, every, flow, chart, first)
            )
        fused = by_speeds_alone(joint, prior)
        if flow is not None:
            by_map = partial(fused_estimate, observations, lens, prior, joint, flow)
            found_by_map = lacks.unless_failed("flow_map", by_map)
            fused, flow = (fused, None) if found_by_map is None else (found_by_map, flow)
        if asked_enough(evidence):
            earlier = look_again(
                observations,
                drift_of(fused, prior),
                evidence.limits,
                drifting=evidence.drifting,
                intrinsics=lens,
                prior=prior,
                site=site,
                flow=flow,
            )
    used = {track.pk for track in seen}
    predictions = as_predictions([row for row in evidence.predictions if row.track_pk in used])
    averaged = None
    if len(predictions) >= FEWEST_TRACKS:
        averaged = lacks.unless_failed("averaged", partial(averaged_estimate, predictions, seed))
    return Finding(
        joint=joint,
        fused=fused,
        earlier=earlier,
        averaged=averaged,
        reading=reading,
        tracks=seen,
        change=change,
        lacks=tuple(lacks.said),
    )


def _paths_of(evidence: Evidence, lacks: Lacks) -> tuple[FlowReference | None, DriftChart | None]:
    """The flow map and its chart, of which the pose needs neither; None where there is none.

    One of another release cannot be read: the next growth of the map brings new ones.
    """
    flow, chart = None, None
    if evidence.flow is not None:
        flow = lacks.unless_failed("flow_map", partial(flow_from_bytes, evidence.flow))
    if flow is not None and evidence.chart is not None:
        chart = lacks.unless_failed("chart", partial(chart_from_bytes, evidence.chart))
    return flow, chart


def _read(
    evidence: Evidence,
    observations: Observations,
    flow: FlowReference,
    chart: DriftChart,
    first: int,
) -> Reading | None:
    """What the chart says of the tracks from the first after a change on, or else of all.

    At the level that the allowed alarms come to. Once a person has said that the camera is where
    it should be, it begins anew.
    """
    unanswered = np.flatnonzero([track.unanswered for track in evidence.tracks])
    usual = Usual(prior=evidence.prior, paces=chart.paces, paths=flow.site(evidence.intrinsics))
    for asked in (unanswered[unanswered >= first], unanswered):
        if not asked.size:
            continue
        scores = score_parties(of_tracks(observations, asked), usual)
        parties_a_year = evidence.tracks_a_year * max(scores.last.size, 1) / asked.size
        reading = read_chart(
            chart,
            scores,
            RUN * evidence.alarms_a_year / parties_a_year,
            calm_ratio=evidence.limits.clear_ratio,
            calm_parties=evidence.limits.people,
        )
        if reading is not None:
            return replace(reading, track_idx=int(asked[reading.track_idx]))
    return None


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
