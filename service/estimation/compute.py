"""The middle step of an estimate, between load and save: no transaction is open."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from models.assessment import (
    Assessment,
    DatedFactor,
    Monitored,
    TrackWindow,
    UnlearnedSite,
    assess,
    may_be_alerted,
    monitor,
)
from models.errors import CheckpointError, TooFewTrajectoriesError
from models.monitoring.drift import pose_after
from models.pose import (
    Baseline,
    CameraSite,
    PartialFailure,
    WarmStart,
    chart_from_bytes,
    paths_from_bytes,
    reference_from_bytes,
    slow_drift_log_from_bytes,
    unless_failed,
    warm_start_from_bytes,
    warm_start_to_bytes,
)
from models.regression.averaging import (
    FEWEST_TRACKS,
    PoseEstimate,
    TrackPredictions,
    averaged_estimate,
)
from service.estimation.due import Circumstances, is_full_estimate_due
from service.estimation.evidence import Evidence, SeenTrack
from service.estimation.moved_zones import MovedZones, moved_zones
from service.estimation.partial_failures import PartialFailures
from service.reasons import Reasons
from service.store.references import LastPoseRecord
from service.store.windows import PredictionRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class ComputedEstimate:
    """An assessment, and what the service adds to it.

    The pose is estimated by `tracks`. `averaged` is the regressor's estimate,
    `zones` the consequence of a move for zones, `last` where the next search may begin.
    """

    assessment: Assessment
    tracks: tuple[SeenTrack, ...]
    averaged: PoseEstimate | None = None
    zones: MovedZones | None = None
    failures: Reasons = ()
    last: LastPoseRecord | None = None
    monitored: Monitored | None = None

    @property
    def reasons(self) -> Reasons:
        """The reasons of the assessment, then the parts that failed."""
        return (*self.assessment.reasons, *self.failures)

    @property
    def newest_pk(self) -> int:
        """Key of the track that was stored last."""
        return max(track.pk for track in self.tracks)


def compute_estimate(
    evidence: Evidence, seed: int, failures: PartialFailures | None = None
) -> ComputedEstimate | Monitored | None:
    """Assess the tracks of a window, or monitor them alone if that is enough.

    None if fewer than five people walk.

    `failures` are those of the run so far; the failures of the assessment join them.
    """
    failures = failures or PartialFailures(evidence.camera_id)
    failed: list[PartialFailure] = []
    site, limits = site_of(evidence, failed), evidence.limits
    window = TrackWindow(
        trajectories=[track.trajectory for track in evidence.tracks],
        unanswered=np.array([track.unanswered for track in evidence.tracks]),
        before=evidence.before,
    )
    try:
        monitored = monitor(window, site, limits, failed)
    except TooFewTrajectoriesError:
        return None
    circumstances = Circumstances(
        asked=evidence.asked,
        learned=evidence.site is not None,
        previous=evidence.previous,
        alerted=evidence.state.alerted,
        unsure=evidence.state.unsure,
        tracks=len(evidence.tracks),
        suspicious=monitored.suspicious,
        drifts_slowly=monitored.drifts_slowly,
    )
    if not is_full_estimate_due(circumstances):
        failures.take(monitored.failures)
        return monitored
    basis = basis_of(evidence)
    state = replace(evidence.state, warm_start=begin_of(evidence, basis))
    found = assess(monitored, site, state, limits, factors_of(evidence))
    failures.take(found.failures)
    seen = evidence.tracks[found.estimated.first :]
    averaged = _averaged(evidence, seen, seed, failures)
    zones = None
    if evidence.site is not None and _may_be_alerted(evidence, found):
        made = partial(zones_of, evidence, seen, found)
        zones = failures.unless_failed("zones", made)
    return ComputedEstimate(
        assessment=found,
        tracks=seen,
        averaged=averaged,
        zones=zones,
        failures=tuple(failures.reasons),
        last=None if found.warm_start is None else _kept(evidence, basis, found.warm_start),
        monitored=monitored,
    )


def factors_of(evidence: Evidence) -> list[DatedFactor]:
    """The evidence beside the tracks: the newest image, if it matched."""
    picture = evidence.picture
    if picture is None or picture.evidence is None:
        return []
    return [DatedFactor(factor=picture.evidence, at_s=picture.taken_s, reason=picture.reason)]


def zones_of(evidence: Evidence, seen: Sequence[SeenTrack], found: Assessment) -> MovedZones | None:
    """The consequence of the pose that would be served for zones."""
    pose = pose_after(found.drift, evidence.prior)
    trajectories = [track.trajectory for track in seen]
    return moved_zones(evidence.zones, evidence.intrinsics, pose, trajectories)


def site_of(evidence: Evidence, failed: list[PartialFailure]) -> CameraSite | UnlearnedSite:
    """The site as far as it is known. The pose needs neither the map nor its chart.

    A part from another release cannot be read: the next growth of the map brings a new one.
    """
    intrinsics, prior = evidence.intrinsics, evidence.prior
    if evidence.site is None:
        return UnlearnedSite(intrinsics=intrinsics, prior=prior, walk=evidence.walk)
    speed_reference = reference_from_bytes(evidence.site)
    paths, chart = None, None
    if evidence.flow is not None:
        paths = unless_failed(failed, "flow_map", partial(paths_from_bytes, evidence.flow))
    if paths is not None and evidence.chart is not None:
        chart = unless_failed(failed, "chart", partial(chart_from_bytes, evidence.chart))
    return CameraSite(
        intrinsics=intrinsics,
        prior=prior,
        speed_reference=speed_reference,
        paths=paths,
        chart=chart,
        baseline=unless_failed(failed, "anchor", partial(_baseline, evidence)),
    )


def _baseline(evidence: Evidence) -> Baseline | None:
    anchor = evidence.anchor
    if anchor is None or anchor.record.creep is None:
        return None
    return Baseline(
        paths=paths_from_bytes(anchor.record.flow),
        chart=chart_from_bytes(anchor.record.chart),
        days=slow_drift_log_from_bytes(anchor.record.creep),
        from_s=anchor.from_s,
    )


def basis_of(evidence: Evidence) -> bytes:
    """A digest of the site that an estimate is made on."""
    anchor = b"" if evidence.anchor is None else evidence.anchor.record.flow
    named = (evidence.reference_id, evidence.intrinsics, evidence.prior)
    digest = hashlib.blake2b(repr(named).encode(), digest_size=16)
    for part in (evidence.site, evidence.flow, anchor):
        digest.update(hashlib.blake2b(part or b"", digest_size=16).digest())
    return digest.digest()


def begin_of(evidence: Evidence, basis: bytes) -> WarmStart | None:
    """Where the search may begin; None if none was kept on this basis, by this release."""
    kept = evidence.last
    if kept is None or kept.basis != basis:
        return None
    try:
        return warm_start_from_bytes(kept.data)
    except CheckpointError:
        return None


def _kept(evidence: Evidence, basis: bytes, found: WarmStart) -> LastPoseRecord:
    return LastPoseRecord(
        reference_id=evidence.reference_id,
        basis=basis,
        data=warm_start_to_bytes(found),
    )


def _may_be_alerted(evidence: Evidence, found: Assessment) -> bool:
    """True if an alert may report zones: zones of a stationary camera are never reported."""
    return may_be_alerted(
        found.posterior.moved,
        evidence.limits.drift,
        found.slow_drift,
        alerted=evidence.state.alerted,
    )


def _averaged(
    evidence: Evidence, seen: Sequence[SeenTrack], seed: int, failures: PartialFailures
) -> PoseEstimate | None:
    """The mean of the regressor's predictions; None of too few."""
    used = {track.pk for track in seen}
    predictions = as_predictions([row for row in evidence.predictions if row.track_pk in used])
    if len(predictions) < FEWEST_TRACKS:
        return None
    return failures.unless_failed("averaged", partial(averaged_estimate, predictions, seed))


def as_predictions(records: Sequence[PredictionRecord]) -> TrackPredictions:
    """A model's predictions of tracks, as a value."""
    return TrackPredictions(
        height_m=np.array([record.height_m for record in records], dtype=np.float64),
        quaternion_wxyz=np.array(
            [(r.qw, r.qx, r.qy, r.qz) for r in records], dtype=np.float64
        ).reshape(-1, 4),
    )
