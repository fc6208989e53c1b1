"""The flow map of a reference grows while its camera is known to be still, and forgets slowly.

It follows habits. What the camera is believed to have crept by is taken out of the tracks first;
the window that it is to judge stays out of it; and its anchor, the first map, never grows.
"""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from sqlalchemy.orm import Session

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.monitoring.creep_serialization import creep_log_from_bytes
from models.paths.serialization import paths_from_bytes
from models.pose import learn_site, observe, without_creep
from models.pose.config import FEWEST_BESIDE
from models.tracks.trajectory import Trajectory
from models.walking.serialization import reference_from_bytes
from service.estimation.anchoring import Anchor, anchor_of, keep_anchor
from service.estimation.paths import LearnedPaths, paths_of
from service.settings import Settings
from service.store import alerts, cameras, estimates, flow_maps, references
from service.store.packing import intrinsics_of, pose_of_prior
from service.store.tables.references import FlowMapRecord, SiteReferenceRecord
from service.store.tracks import tracks, windows
from service.windows.attendance import Attendance, attendance_of
from service.windows.references import is_outdated, made_against, window_beside, window_of
from service.windows.stillness import Doubt, doubts, still_bounds
from service.windows.unpacked import Unpacked

_FEWEST_NEW = 50
_NEW_SHARE = 0.25  # of the tracks that the map was learned of
_DAY_S = 86_400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class GrowthPeriod:
    """All that a map is to be learned of anew, in the order of the tracks' ends.

    `weights` (N,) are what they count for. `kept` is the map that there is, as bytes, where all of
    it is known to be still. `replaces` is when the map that there is was learned,
    `spoilt` whether it has tracks in it of a time that is no longer known to be still.
    """

    reference_id: int
    site: bytes
    anchor: Anchor | None
    intrinsics: Intrinsics
    prior: CameraPose
    trajectories: tuple[Trajectory, ...]
    weights: Array
    kept: bytes | None
    to_s: float
    taken_at: datetime
    replaces: datetime | None
    spoilt: bool


def load_growth(
    session: Session, settings: Settings, camera_id: str, unpacked: Unpacked | None = None
) -> GrowthPeriod | None:
    """The tracks to learn a camera's map anew of; None where it is to stay as it is."""
    unpacked = unpacked or Unpacked()
    camera = cameras.find(session, camera_id)
    reference = references.newest_if_any(session, camera_id)
    if camera is None or reference is None or reference.ready_at is None:
        return None
    kept = flow_maps.find(session, reference.id)
    past = doubts(session, settings, reference)
    assert reference.to_s is not None
    assert reference.data is not None
    attended = attendance_of(session, camera_id, datetime.now(UTC))
    spoilt = kept is not None and _is_spoilt(kept, reference.to_s, past, attended)
    since_s = None if kept is None else kept.to_s
    enough = max(_FEWEST_NEW, _NEW_SHARE * (0 if kept is None else kept.tracks))
    # Asked at every look, and hardly ever due: what is counted quickly says so first.
    if not spoilt and tracks.count_since(session, camera_id, since_s) < enough:
        return None
    if _in_doubt(session, settings, reference, kept, past):
        return None
    judged = window_beside(attended, reference, settings)
    judged_from_s = windows.oldest_end_s(session, judged)
    bounds = still_bounds(settings, reference, past, attended, judged_from_s)
    if not spoilt and windows.count_still(session, bounds, since_s) < enough:
        return None
    records = windows.still(session, bounds, min(settings.flow_tracks, settings.keep_tracks))
    to_s = records[-1].ended_s if records else reference.to_s
    age_s = to_s - np.array([record.ended_s for record in records])
    weights = _faded(age_s, settings)
    if kept is not None and not spoilt:
        still_counts = kept.weight * float(_faded(np.array(to_s - kept.to_s), settings))
        if weights.sum() < still_counts:
            return None  # retention has deleted more than has come: the map knows more than they
    intrinsics = intrinsics_of(camera)
    return GrowthPeriod(
        reference_id=reference.id,
        site=reference.data,
        anchor=anchor_of(session, reference, judged),
        intrinsics=intrinsics,
        prior=pose_of_prior(cameras.prior_pose(session, camera_id)),
        trajectories=tuple(unpacked.seen(record, intrinsics) for record in records),
        weights=weights,
        kept=None if kept is None or spoilt else kept.data,
        to_s=to_s,
        taken_at=datetime.now(UTC),
        replaces=None if kept is None else kept.learned_at,
        spoilt=spoilt,
    )


def compute_growth(period: GrowthPeriod, seed: int) -> LearnedPaths | None:
    """The map and the chart of a period; None where too few of its tracks walk.

    Some 10 seconds of a core at the most.
    """
    if not period.trajectories:
        return None
    trajectories, weights = period.trajectories, period.weights
    anchor = period.anchor
    if anchor is not None and anchor.log is not None:
        log = creep_log_from_bytes(anchor.log)
        stood = without_creep(trajectories, period.intrinsics, period.prior, log, anchor.from_s)
        trajectories = tuple(track for track in stood if track is not None)
        weights = weights[[track is not None for track in stood]]
    grown = learn_site(
        observe(trajectories, period.intrinsics, period.prior),
        period.intrinsics,
        period.prior,
        seed=seed,
        speed_reference=reference_from_bytes(period.site),
        weights=weights,
        chosen=None if period.kept is None else paths_from_bytes(period.kept).bandwidths,
    )
    return paths_of(grown)


def save_growth(
    session: Session, camera_id: str, period: GrowthPeriod, learned: LearnedPaths | None
) -> bool:
    """Put a grown map in its predecessor's place, unless either has been replaced meanwhile."""
    reference = references.newest_if_any(session, camera_id)
    if reference is None or reference.id != period.reference_id:
        return False
    kept = flow_maps.find(session, reference.id)
    if (None if kept is None else kept.learned_at) != period.replaces:
        return False
    if learned is None and kept is not None and kept.data is not None and not period.spoilt:
        return False
    grown = FlowMapRecord(
        reference_id=reference.id,
        data=None if learned is None else learned.flow,
        chart=None if learned is None else learned.chart,
        tracks=len(period.trajectories),
        weight=float(period.weights.sum()),
        to_s=period.to_s,
        learned_at=period.taken_at,
    )
    session.merge(grown)
    anchor = flow_maps.anchor(session, reference.id)
    # The first map is kept; or, where tracks of a move are in it, this one in its place.
    if anchor is None or (period.spoilt and anchor.to_s > (reference.to_s or 0.0)):
        keep_anchor(session, reference.id, learned, to_s=period.to_s, learned_at=period.taken_at)
    return True


def _in_doubt(
    session: Session,
    settings: Settings,
    reference: SiteReferenceRecord,
    kept: FlowMapRecord | None,
    past: tuple[Doubt, ...],
) -> bool:
    """Whether the camera may have moved by now, or people walk elsewhere than they did."""
    last = estimates.newest(session, reference.camera_id)
    if last is None or not made_against(reference, last) or not last.identifiable:
        return True
    if is_outdated(last, window_of(session, reference, settings)):
        return True  # somebody was at the camera, and nobody knows yet how it stands since
    if last.drift_streak > 0 or last.drifted or last.suspected:
        return True
    if any(alerts.firing(session, reference.camera_id, kind) for kind in alerts.POSE_KINDS):
        return True
    had_map = kept is not None and kept.data is not None and kept.learned_at <= last.created_at
    if had_map and "registered" not in last.raw:
        return True  # the paths have changed, or too few people walk them to tell
    return reference.changed_s is not None and not _is_explained(session, reference, past)


def _is_explained(
    session: Session, reference: SiteReferenceRecord, past: tuple[Doubt, ...]
) -> bool:
    """Whether a person has said what the newest change was: put back by now, or none at all."""
    changed_s = reference.changed_s
    assert changed_s is not None
    for doubt in past:
        if not doubt.by_person or changed_s < doubt.from_s:
            continue
        # A camera is put back before that is said, but seen there again only as people come.
        between = tracks.count_between(session, reference.camera_id, doubt.to_s, changed_s)
        if changed_s <= doubt.to_s or between <= FEWEST_BESIDE:
            return True
    return False


def _is_spoilt(
    kept: FlowMapRecord, reference_to_s: float, past: tuple[Doubt, ...], attended: Attendance
) -> bool:
    if attended.announced_late(kept.learned_at, kept.to_s):
        return True
    return kept.to_s > reference_to_s and any(
        doubt.excluded and doubt.from_s <= kept.to_s and doubt.resolved_at > kept.learned_at
        for doubt in past
    )


def _faded(age_s: Array, settings: Settings) -> Array:
    return np.asarray(0.5 ** (age_s / (settings.flow_half_life_days * _DAY_S)))
