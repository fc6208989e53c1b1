"""The computation of an estimate: no transaction is open; what fails beside it stops nobody."""

import hashlib
import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from models.errors import CheckpointError
from models.geometry.rotation import Array
from models.monitoring.verdict import LIKELY, may_be_told, pose_after
from models.pose import (
    CREEP_SHARE,
    AlarmRate,
    CameraSite,
    Cause,
    ChartResult,
    Creep,
    FusedEstimate,
    JointEstimate,
    MovedBetween,
    Observations,
    PartialFailure,
    PoseFinding,
    PosePosterior,
    WarmStart,
    alarm_chart_result,
    assume_site,
    chart_from_bytes,
    count_walks,
    drift_of,
    estimate_pose,
    observe_walks,
    paths_from_bytes,
    raised_by_creep,
    reference_from_bytes,
    since_alarm,
    smallest_told,
    unless_failed,
    warm_start_from_bytes,
    warm_start_to_bytes,
    with_time_of_move,
)
from models.reasons import Reason
from models.regression.averaging import (
    FEWEST_TRACKS,
    PoseEstimate,
    TrackPredictions,
    averaged_estimate,
)
from models.walking.config import FEWEST_WALKERS
from service.estimation.anchoring import creep_of, first_site
from service.estimation.evidence import MOST_PIECES, Evidence, SeenTrack
from service.estimation.moved_zones import MovedZones, moved_zones
from service.estimation.seen_picture import SeenPicture
from service.reasons import Reasons, ServiceCode
from service.store.references import LastPoseRecord
from service.store.windows import PredictionRecord

log = logging.getLogger("surefoot.recalibration")

_Made = TypeVar("_Made")


class PartialFailures:
    """The parts of a camera's estimate that could not be made; `reasons` say so."""

    def __init__(self, camera_id: str) -> None:
        self._camera_id = camera_id
        self.reasons: list[Reason] = []

    def unless_failed(self, part: str, make: Callable[[], _Made]) -> _Made | None:
        """Something made; None if it failed. `part` names it in the log, `flow_map` say."""
        found: list[PartialFailure] = []
        made = unless_failed(found, part, make)
        self.take(found)
        return made

    def take(self, found: Sequence[PartialFailure]) -> None:
        """Log and say what failed."""
        for failure in found:
            fields = {"camera_id": self._camera_id}
            if isinstance(failure.error, CheckpointError):
                log.warning(
                    f"{failure.part}_unreadable", extra=fields | {"why": str(failure.error)}
                )
                self.add(failure.part, "cannot be read")
            else:
                log.error(f"{failure.part}_failed", exc_info=failure.error, extra=fields)
                self.add(failure.part, repr(failure.error))

    def add(self, part: str, why: str) -> None:
        """Say that something is missing, and why."""
        reason = Reason(code=ServiceCode.WITHOUT_PART, values={"part": part, "why": why})
        if reason not in self.reasons:
            self.reasons.append(reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """The result of the evidence. `tracks` are those after the `change`, where one was found.

    `posterior` is over what moved, by the `fused` estimate; `power` (4, 3) the smallest moves that
    would be told of 60, 250 and 800 people, None before the site is known; `enough` people came
    since a person said how the camera stands, or not. `reading` is what the drift chart says of the
    tracks after the change, or of all where these are too few; None where there is no chart. Where
    it alarms and the pose does not rule it out, the `tracks` are those that it is of. `creep` is
    what the anchor says of weeks; once the camera has crept, all else is by its first map, too.
    `picture` is the newest one; where it counts beside the tracks, `people_moved` is whether these
    alone say that the camera moved.
    `causes` are how likely the clock or the lens is wrong before a camera that stands.
    `zones` are what the pose comes to for them, by the `tracks`.
    `pieces` says how many of the tracks are of others' walks, where these are many. `failures`
    names what should be there beside the served pose. `last` is where the next one may begin.
    """

    joint: JointEstimate
    fused: FusedEstimate
    posterior: PosePosterior
    power: Array | None
    enough: bool
    averaged: PoseEstimate | None
    reading: ChartResult | None
    creep: Creep | None
    tracks: tuple[SeenTrack, ...]
    change: SeenTrack | None
    between: MovedBetween | None = None
    picture: SeenPicture | None = None
    people_moved: bool | None = None
    causes: tuple[Cause, Cause] | None = None
    zones: MovedZones | None = None
    pieces: Reason | None = None
    failures: Reasons = ()
    last: LastPoseRecord | None = None

    @property
    def newest_pk(self) -> int:
        """The one of the tracks that was stored last."""
        return max(track.pk for track in self.tracks)


def compute_finding(
    evidence: Evidence, seed: int, failures: PartialFailures | None = None
) -> Finding | None:
    """The pose by all estimators, from the newest change on; None where too few people walk.

    It begins at what was found of the camera last, if that may be. `failures` are those of the look
    so far, of which it has those of the finding from then on.
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
    failures = failures or PartialFailures(evidence.camera_id)
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
    begin = begin_of(evidence.last, basis)
    found = estimate_pose(observed, site, begin, told=evidence.told)
    failures.take(found.failures)
    if found.first:
        reading = _read(evidence, observed, site, found.first, failures)
    moved_prior = evidence.moved_prior
    if crept:
        moved_prior = raised_by_creep(moved_prior, observed, evidence.alarms_a_year)
    found = replace(found, moved_prior=moved_prior)
    judged = partial(since_alarm, found, observed, site, reading)
    found = failures.unless_failed("chart", judged) or found
    picture = _picture_of(evidence, found, reading)
    people_moved = None
    if picture is not None:
        people_moved = found.posterior.moved >= LIKELY
        # It speaks of the same as the chart, by which the prior may be raised.
        found = replace(found, moved_prior=moved_prior, picture=picture.evidence)
    timed = partial(with_time_of_move, found, observed, site)
    found = failures.unless_failed("time of the move", timed) or found
    seen = evidence.tracks[found.first :]
    averaged = _averaged(evidence, seen, seed, failures)
    moved = None
    # They are told of with an alert: of a camera that stands, nobody asks.
    if site.learned and may_be_told(
        found.posterior.moved, evidence.limits, creep, told=evidence.told
    ):
        zones = partial(zones_of, evidence, seen, found.fused, found.posterior)
        moved = failures.unless_failed("zones", zones)
    return Finding(
        joint=found.joint,
        fused=found.fused,
        posterior=found.posterior,
        power=_power(found, site) if site.learned else None,
        enough=asked_enough(evidence),
        averaged=averaged,
        reading=reading,
        creep=creep,
        tracks=seen,
        change=None if found.change_idx is None else evidence.tracks[found.change_idx],
        between=found.between,
        picture=evidence.picture,
        people_moved=people_moved,
        causes=found.causes,
        zones=moved,
        pieces=walks.reason,
        failures=tuple(failures.reasons),
        last=None if found.warm_start is None else _kept(evidence, basis, found.warm_start),
    )


def zones_of(
    evidence: Evidence, seen: Sequence[SeenTrack], fused: FusedEstimate, posterior: PosePosterior
) -> MovedZones | None:
    """What the pose that would be served comes to for zones."""
    pose = pose_after(drift_of(posterior, fused), evidence.prior)
    trajectories = [track.trajectory for track in seen]
    return moved_zones(evidence.zones, evidence.intrinsics, pose, trajectories)


def _picture_of(
    evidence: Evidence, found: PoseFinding, reading: ChartResult | None
) -> SeenPicture | None:
    """The newest picture, where it counts beside all tracks that the pose may be judged by."""
    first = found.first
    if reading is not None and reading.moved:
        first = max(first, reading.track_idx)
    ended_s = [track.ended_s for track in evidence.tracks[first:]]
    picture = evidence.picture
    return picture if picture is not None and picture.counts(ended_s) else None


def _power(found: PoseFinding, site: CameraSite) -> Array:
    """The smallest moves (4, 3) that would be told at a site by its people."""
    return smallest_told(
        found.fused,
        found.joint.walking_groups,
        found.joint.walkers,
        math.inf if site.paths is None else site.paths.people,
        found.moved_prior,
    )


def basis_of(evidence: Evidence, *, crept: bool, suspicious: bool) -> bytes:
    """A digest of an estimate's site and of what its chart suspects."""
    parts = (
        evidence.site,
        evidence.flow,
        evidence.anchor.record.flow if crept and evidence.anchor else b"",
    )
    named = (evidence.reference_id, evidence.intrinsics, evidence.prior, suspicious)
    digest = hashlib.blake2b(repr(named).encode(), digest_size=16)
    for part in parts:
        digest.update(hashlib.blake2b(part or b"", digest_size=16).digest())
    return digest.digest()


def begin_of(kept: LastPoseRecord | None, basis: bytes) -> WarmStart | None:
    """The pose that an estimate may begin at; None where there is none on the same basis.

    One of another release cannot be read: that is as none.
    """
    if kept is None or kept.basis != basis:
        return None
    try:
        return warm_start_from_bytes(kept.data)
    except CheckpointError:
        return None


def _kept(evidence: Evidence, basis: bytes, found: WarmStart) -> LastPoseRecord:
    return LastPoseRecord(
        reference_id=evidence.reference_id, basis=basis, data=warm_start_to_bytes(found)
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
    unanswered = np.array([track.unanswered for track in evidence.tracks])
    rate = AlarmRate(
        alarms_a_year=(1 - CREEP_SHARE) * evidence.alarms_a_year,
        tracks_a_year=evidence.tracks_a_year,
        calm_ratio=evidence.limits.clear_ratio,
        calm_groups=evidence.limits.people,
    )
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
