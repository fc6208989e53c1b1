"""A monitor run between two full estimates: it reads, scores and stores the new tracks alone."""

from dataclasses import dataclass, replace

import numpy as np
from sqlalchemy.orm import Session

from models.assessment import (
    AssessmentLimits,
    ChartBasis,
    ScoredTracks,
    WindowContext,
    chart_of_scored,
    context_from_bytes,
    score_part,
    scored_from_bytes,
    scored_to_bytes,
    tail_of,
)
from models.durations import DAY_S
from models.geometry.rotation import Index
from models.tracks.trajectory import Trajectory, end_key
from service.enums import AlertKind
from service.estimation.carried_state import last_estimate
from service.estimation.due import Circumstances, PreviousEstimate, is_full_estimate_due
from service.estimation.evidence import Unpacked, assessment_limits
from service.estimation.monitor_state import basis_digest, monitor_basis
from service.estimation.site_cache import SiteCache
from service.references import window_of
from service.settings import Settings
from service.store import alerts, monitor_states, references, tracks, windows
from service.store.alerts import MOVED_KINDS
from service.store.cameras import CameraRecord
from service.store.monitor_states import MonitorStateRecord

_LARGEST_PART = 0.25  # of the window, in tracks to score: a run of more scores the whole window


@dataclass(frozen=True, slots=True, kw_only=True)
class NewTracks:
    """The input of a monitor run.

    `scored` are the tracks of the window before, `newer` those of them that came after the last
    run which scored the whole window. `keys` are the tracks to score, new ones and the tail before
    them, in the order of their ends. The window is of so many `people` and begins at `days_s`
    before its newest track.
    """

    camera_id: str
    basis: bytes
    scored: ScoredTracks
    newer: ScoredTracks
    keys: Index
    trajectories: tuple[Trajectory, ...]
    chart: ChartBasis
    context: WindowContext
    limits: AssessmentLimits
    people: int
    days_s: float
    last_pk: int
    circumstances: Circumstances


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitoredTracks:
    """The result of a monitor run: the scores to store, as bytes."""

    camera_id: str
    basis: bytes
    newer: bytes


def load_new_tracks(
    session: Session,
    settings: Settings,
    camera_id: str,
    sites: SiteCache,
    unpacked: Unpacked,
    *,
    asked: bool,
) -> NewTracks | None:
    """The input of a monitor run; None if the run has to score the whole window.

    It has to if anything but tracks is new, on the first run of a day, and if a full estimate is
    due by what is known before the new tracks are scored.
    """
    kept = session.get(MonitorStateRecord, camera_id)
    if asked or kept is None:
        return None
    camera = session.get(CameraRecord, camera_id)
    reference = references.newest_if_any(session, camera_id)
    if camera is None or reference is None:
        return None
    last = last_estimate(session, reference)
    inputs = monitor_states.inputs(session, camera_id, reference.id)
    bounds = window_of(session, reference, settings)
    if last is None or inputs.snapshot_waits:
        return None
    basis = monitor_basis(session, camera, reference, bounds, inputs)
    if basis_digest(basis, last.id) != kept.basis:
        return None
    newer = scored_from_bytes(kept.newer)
    scored = scored_from_bytes(kept.scored).merged(newer)
    new = windows.newer_than(session, bounds, int(scored.key.max()))
    if unpacked.budget.leave_out([each.size for each in new]):
        return None
    if any(each.ended_s // DAY_S > scored.ended_s[-1] // DAY_S for each in new):
        return None
    tail = tail_of(scored, min((each.started_s for each in new), default=np.inf))
    keys = np.concatenate([tail, [each.size.id for each in new]]).astype(np.int64)
    if keys.size > _LARGEST_PART * scored.key.size:
        return None
    records = tracks.some(session, keys.tolist()) if new else ()
    chart = sites.basis_of(session, camera, reference, inputs)
    if chart is None or len(records) != keys.size:
        return None
    records = sorted(records, key=lambda record: end_key(unpacked.feet(record)))
    firing = alerts.firing_by_estimates(session, camera_id)
    previous = PreviousEstimate(
        state=last.state, moved=last.moved, new_tracks=0, has_new_input=False
    )
    circumstances = Circumstances(
        asked=asked,
        learned=reference.ready_at is not None,
        previous=previous,
        alerted=bool(firing & set(MOVED_KINDS)),
        unsure=AlertKind.UNSURE in firing,
        tracks=scored.key.size + len(new),
    )
    if is_full_estimate_due(circumstances):
        return None
    return NewTracks(
        camera_id=camera_id,
        basis=kept.basis,
        scored=scored,
        newer=newer,
        keys=np.array([record.id for record in records], dtype=np.int64),
        trajectories=tuple(unpacked.seen(record, camera.intrinsics) for record in records),
        chart=chart,
        context=context_from_bytes(kept.context),
        limits=assessment_limits(settings, camera, kept.tracks_a_year),
        people=bounds.tracks,
        days_s=bounds.days * DAY_S,
        last_pk=last.newest_track_pk,
        circumstances=circumstances,
    )


def monitor_new_tracks(found: NewTracks) -> MonitoredTracks | None:
    """Score the new tracks and read the chart; None if a full estimate is due."""
    window, newer = found.scored, found.newer
    if found.keys.size:  # else an earlier run has read all tracks
        part = score_part(found.keys, found.trajectories, found.chart, found.context)
        window, newer = window.merged(part), newer.merged(part)
    window = window.newest(found.people, float(window.ended_s[-1]) - found.days_s)
    chart = chart_of_scored(window, found.chart, found.limits)
    previous = found.circumstances.previous
    assert previous is not None
    new = int((window.key > found.last_pk).sum())
    circumstances = replace(
        found.circumstances,
        previous=replace(previous, new_tracks=new),
        tracks=window.key.size,
        suspicious=chart is not None and chart.suspicious,
    )
    if is_full_estimate_due(circumstances):
        return None
    return MonitoredTracks(
        camera_id=found.camera_id, basis=found.basis, newer=scored_to_bytes(newer)
    )
