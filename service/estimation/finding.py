"""The computation of an estimate; no transaction is open meanwhile."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from models.monitoring.chart import ChartResult
from models.monitoring.config import CREEP_SHARE
from models.monitoring.serialization import chart_from_bytes
from models.paths.serialization import paths_from_bytes
from models.pose import (
    AlarmRate,
    CameraSite,
    Creep,
    Observations,
    SecondLook,
    alarm_chart_result,
    assume_site,
    count_walks,
    estimate_pose,
    observe_walks,
)
from models.pose.pose_fit import FusedEstimate
from models.reasons import Reason
from models.regression.averaging import (
    FEWEST_TRACKS,
    PoseEstimate,
    TrackPredictions,
    averaged_estimate,
)
from models.walking.config import FEWEST_WALKERS
from models.walking.estimate import JointEstimate
from models.walking.serialization import reference_from_bytes
from service.estimation.anchoring import creep_of, first_site
from service.estimation.evidence import Evidence, KeptPose, SeenTrack
from service.estimation.last_poses import basis_of, begin_of, kept_of
from service.estimation.partial_failures import PartialFailures
from service.estimation.people import MOST_PIECES
from service.reasons import Reasons
from service.store.windows import PredictionRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """The result of the evidence. `tracks` are those after the `change`, where one was found.

    `fused` is to be served, `earlier` the same without the newest people, where the verdict asks
    for it. `reading` is what the drift chart says of the tracks after the change, or of all where
    these are too few, long before a pose can say how far; None where there is no chart. `creep`
    is what the anchor says of weeks; once the camera has crept, all else is by its first map, too.
    `pieces` says how many of the tracks are of others' walks, where these are many. `failures`
    names what should be there beside the served pose. `last` is where the next one may begin.
    """

    joint: JointEstimate
    fused: FusedEstimate
    earlier: FusedEstimate | None
    averaged: PoseEstimate | None
    reading: ChartResult | None
    creep: Creep | None
    tracks: tuple[SeenTrack, ...]
    change: SeenTrack | None
    pieces: Reason | None = None
    failures: Reasons = ()
    last: KeptPose | None = None

    @property
    def newest_pk(self) -> int:
        """The one of the tracks that was stored last."""
        return max(track.pk for track in self.tracks)


def compute_finding(evidence: Evidence, seed: int) -> Finding | None:
    """The pose by all estimators, from the newest change on; None where too few people walk.

    It begins at what was found of the camera last, if that may be.
    """
    walks = observe_walks(
        [track.trajectory for track in evidence.tracks],
        evidence.intrinsics,
        evidence.prior,
        evidence.before,
    )
    observed = walks.observations
    if observed.walkers < FEWEST_WALKERS:
        return None
    failures = PartialFailures(evidence.camera_id)
    site = _site_of(evidence, observed, failures)
    creep = failures.unless_failed(
        "anchor", partial(creep_of, evidence.anchor, evidence.alarms_a_year)
    )
    crept = creep is not None and creep.moved
    if crept and evidence.anchor is not None:
        first = partial(first_site, site, evidence.anchor)
        site = failures.unless_failed("anchor", first) or site
    reading = _read(evidence, observed, site, 0, failures)
    suspicious = reading is not None and reading.suspicious
    basis = basis_of(evidence, crept=crept, suspicious=suspicious)
    look_twice = SecondLook(limits=evidence.limits, drifting=evidence.drifting)
    found = estimate_pose(
        observed,
        site,
        look_twice if asked_enough(evidence) else None,
        begin_of(evidence.last, basis),
    )
    failures.take(found.failures)
    if found.first:
        reading = _read(evidence, observed, site, found.first, failures)
    seen = evidence.tracks[found.first :]
    averaged = _averaged(evidence, seen, seed, failures)
    return Finding(
        joint=found.joint,
        fused=found.fused,
        earlier=found.earlier,
        averaged=averaged,
        reading=reading,
        creep=creep,
        tracks=seen,
        change=None if found.change_idx is None else evidence.tracks[found.change_idx],
        pieces=walks.reason,
        failures=tuple(failures.reasons),
        last=kept_of(found.warm_start, basis),
    )


def _averaged(
    evidence: Evidence, seen: Sequence[SeenTrack], seed: int, failures: PartialFailures
) -> PoseEstimate | None:
    """The mean of what the model in use says of tracks; None where it says too little."""
    used = {track.pk for track in seen}
    predictions = as_predictions([row for row in evidence.predictions if row.track_pk in used])
    if len(predictions) < FEWEST_TRACKS:
        return None
    return failures.unless_failed("averaged", partial(averaged_estimate, predictions, seed))


def _site_of(evidence: Evidence, observed: Observations, failures: PartialFailures) -> CameraSite:
    """The site as it is known. The pose needs neither the flow map nor its chart.

    One of another release cannot be read: the next growth of the map brings new ones.
    """
    if evidence.site is None:
        return assume_site(observed, evidence.intrinsics, evidence.prior, evidence.walk)
    speed_reference = reference_from_bytes(evidence.site)
    flow, chart = None, None
    if evidence.flow is not None:
        flow = failures.unless_failed("flow_map", partial(paths_from_bytes, evidence.flow))
    if flow is not None and evidence.chart is not None:
        chart = failures.unless_failed("chart", partial(chart_from_bytes, evidence.chart))
    return CameraSite(
        intrinsics=evidence.intrinsics,
        prior=evidence.prior,
        speed_reference=speed_reference,
        paths=flow,
        chart=chart,
    )


def _read(
    evidence: Evidence,
    observed: Observations,
    site: CameraSite,
    first: int,
    failures: PartialFailures,
) -> ChartResult | None:
    """The chart's result; once a person has said how the camera stands, it begins anew."""
    if site.chart is None:
        return None
    rate = AlarmRate(
        alarms_a_year=(1 - CREEP_SHARE) * evidence.alarms_a_year,
        tracks_a_year=evidence.tracks_a_year,
        calm_ratio=evidence.limits.clear_ratio,
        calm_groups=evidence.limits.people,
    )
    unanswered = np.array([track.unanswered for track in evidence.tracks])
    read = partial(alarm_chart_result, observed, site, rate, counted=unanswered, first=first)
    return failures.unless_failed("chart", read)


def asked_enough(evidence: Evidence) -> bool:
    """True where enough people came since a person last said how the camera stands."""
    unanswered = [track.trajectory for track in evidence.tracks if track.unanswered]
    wanted = evidence.limits.people
    if not wanted <= len(unanswered) < MOST_PIECES * wanted:
        return len(unanswered) >= wanted
    return count_walks(unanswered, evidence.intrinsics, evidence.prior) >= wanted


def as_predictions(records: Sequence[PredictionRecord]) -> TrackPredictions:
    """A model's predictions of tracks, as a value."""
    return TrackPredictions(
        height_m=np.array([record.height_m for record in records], dtype=np.float64),
        quaternion_wxyz=np.array(
            [(r.qw, r.qx, r.qy, r.qz) for r in records], dtype=np.float64
        ).reshape(-1, 4),
    )
