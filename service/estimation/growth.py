"""The flow map of a reference grows while its camera is known to be still, and forgets slowly.

It follows habits. What the camera is believed to have crept by is taken out of the tracks first;
the window that it is to judge stays out of it; and its anchor, the first map, never grows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from sqlalchemy.orm import Session

from models.assessment import without_slow_drift
from models.durations import DAY_S
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.pose import (
    FEWEST_BESIDE,
    learn_site,
    observe,
    paths_from_bytes,
    reference_from_bytes,
    slow_drift_log_from_bytes,
)
from models.tracks.trajectory import Trajectory
from service.estimation.anchoring import LearnedPaths, keep_paths, paths_of
from service.estimation.evidence import Anchor, Unpacked, anchor_of
from service.references import (
    Attendance,
    SuspectedMove,
    attendance_of,
    is_before,
    made_against,
    suspected_moves,
    window_beside,
    window_of,
)
from service.settings import Settings
from service.store import alerts, cameras, estimates, references, tracks, windows
from service.store.cameras import CameraRecord
from service.store.references import AnchorRecord, FlowMapRecord, SiteReferenceRecord
from service.store.run_budget import MAP_BUDGETS, RunBudget
from service.store.tracks import StoredTrack
from service.store.windows import StillBounds, WindowBounds

_FEWEST_NEW = 50
_NEW_SHARE = 0.25  # of the tracks that the map was learned of


@dataclass(frozen=True, slots=True, kw_only=True)
class GrowthPeriod:
    """All that a map is to be learned of anew, in the order of the tracks' ends.

    `weights` (N,) are what they count for. `kept` is the map that there is, `spoilt` where it has
    tracks in it of a time that is no longer known to be still.
    """

    reference_id: int
    site: bytes
    anchor: Anchor | None
    intrinsics: Intrinsics
    prior: CameraPose
    trajectories: tuple[Trajectory, ...]
    weights: Array
    kept: FlowMapRecord | None
    spoilt: bool
    to_s: float
    taken_at: datetime


def load_growth(
    session: Session, settings: Settings, camera_id: str, unpacked: Unpacked | None = None
) -> GrowthPeriod | None:
    """The tracks to learn a camera's map anew of; None where it is to stay as it is."""
    camera = session.get(CameraRecord, camera_id)
    reference = references.newest_if_any(session, camera_id)
    if camera is None or reference is None or reference.ready_at is None:
        return None
    assert reference.to_s is not None
    assert reference.data is not None
    kept = session.get(FlowMapRecord, reference.id)
    moves = suspected_moves(session, settings, reference)
    attended = attendance_of(session, camera_id, datetime.now(UTC))
    judged = window_beside(attended, reference, settings)
    spoilt = kept is not None and _is_spoilt(kept, reference.to_s, moves, attended)
    unpacked = unpacked or Unpacked()
    found = _still_tracks(
        session,
        settings,
        reference,
        kept,
        moves,
        attended,
        judged,
        spoilt,
        RunBudget(MAP_BUDGETS * unpacked.budget.share),
    )
    if found is None:
        return None
    to_s = found[-1].ended_s if found else reference.to_s
    weights = _faded(to_s - np.array([record.ended_s for record in found]), settings)
    if (
        kept is not None
        and not spoilt
        and weights.sum() < kept.weight * _faded(to_s - kept.to_s, settings)
    ):
        return None  # retention has deleted more than has come: the map knows more than they
    intrinsics = camera.intrinsics
    return GrowthPeriod(
        reference_id=reference.id,
        site=reference.data,
        anchor=anchor_of(session, reference, judged),
        intrinsics=intrinsics,
        prior=cameras.prior_pose(session, camera_id).pose,
        trajectories=tuple(unpacked.seen(record, intrinsics) for record in found),
        weights=weights,
        kept=kept,
        spoilt=spoilt,
        to_s=to_s,
        taken_at=datetime.now(UTC),
    )


def _still_tracks(
    session: Session,
    settings: Settings,
    reference: SiteReferenceRecord,
    kept: FlowMapRecord | None,
    moves: tuple[SuspectedMove, ...],
    attended: Attendance,
    judged: WindowBounds,
    spoilt: bool,
    budget: RunBudget,
) -> Sequence[StoredTrack] | None:
    """The tracks that are known to be of a still camera; None where too few of them are new.

    Asked at every look, and hardly ever due: what is counted quickly says so first.
    """
    since_s = None if kept is None else kept.to_s
    enough = max(_FEWEST_NEW, _NEW_SHARE * (0 if kept is None else kept.tracks))
    if not spoilt and tracks.count_since(session, reference.camera_id, since_s) < enough:
        return None
    if _may_have_moved(session, settings, reference, kept, moves):
        return None
    bounds = StillBounds(
        camera_id=reference.camera_id,
        started_from_s=reference.from_s,
        reference_to_s=reference.to_s or 0.0,
        later_before_s=windows.oldest_end_s(session, judged),  # later ones are to be judged by it
        unsure=settings.flow_unsure_tracks,  # of a move that nobody has noticed yet
        without=tuple((move.from_s, move.to_s) for move in moves if move.excluded),
        attended=attended.spans,
    )
    if not spoilt and windows.count_still(session, bounds, since_s) < enough:
        return None
    most = min(settings.flow_tracks, settings.keep_tracks)
    return windows.still(session, bounds, most, budget)


def compute_growth(period: GrowthPeriod, seed: int) -> LearnedPaths | None:
    """The map and the chart of a period; None where too few of its tracks walk.

    Some 10 seconds of a core at the most.
    """
    if not period.trajectories:
        return None
    trajectories, weights = period.trajectories, period.weights
    anchor = period.anchor
    if anchor is not None and anchor.record.creep is not None:
        log = slow_drift_log_from_bytes(anchor.record.creep)
        stood = without_slow_drift(
            trajectories, period.intrinsics, period.prior, log, anchor.from_s
        )
        # Some have lost their ends by that: another order.
        ends = {n: track.time_s[-1] for n, track in enumerate(stood) if track is not None}
        order = sorted(ends, key=ends.__getitem__)
        trajectories = tuple(track for n in order if (track := stood[n]) is not None)
        weights = weights[order]
    known = None if period.kept is None or period.spoilt else period.kept.data
    grown = learn_site(
        observe(trajectories, period.intrinsics, period.prior),
        period.intrinsics,
        period.prior,
        seed=seed,
        speed_reference=reference_from_bytes(period.site),
        weights=weights,
        chosen=None if known is None else paths_from_bytes(known).bandwidths,
    )
    return paths_of(grown)


def save_growth(
    session: Session, camera_id: str, period: GrowthPeriod, learned: LearnedPaths | None
) -> bool:
    """Put a grown map in its predecessor's place, unless either has been replaced meanwhile."""
    reference = references.newest_if_any(session, camera_id)
    if reference is None or reference.id != period.reference_id:
        return False
    kept, before = session.get(FlowMapRecord, reference.id), period.kept
    if (kept and kept.learned_at) != (before and before.learned_at):
        return False
    if learned is None and kept is not None and kept.data is not None and not period.spoilt:
        return False
    anchor = session.get(AnchorRecord, reference.id)
    keep_paths(
        session,
        reference.id,
        learned,
        tracks=len(period.trajectories),
        weight=float(period.weights.sum()),
        to_s=period.to_s,
        learned_at=period.taken_at,
        # The first map is kept; or, where tracks of a move are in it, this one in its place.
        anchored=anchor is None or (period.spoilt and anchor.to_s > (reference.to_s or 0.0)),
    )
    return True


def _may_have_moved(
    session: Session,
    settings: Settings,
    reference: SiteReferenceRecord,
    kept: FlowMapRecord | None,
    moves: tuple[SuspectedMove, ...],
) -> bool:
    """True where the camera may have moved by now, or people walk elsewhere than they did."""
    last = estimates.newest(session, reference.camera_id)
    if last is None or not made_against(reference, last) or not last.identifiable:
        return True
    if is_before(last.to_s, window_of(session, reference, settings)):
        return True  # somebody was at the camera, and nobody knows yet how it stands since
    if last.suspects_move:
        return True
    if alerts.pose_doubted(session, reference.camera_id):
        return True
    had_map = kept is not None and kept.data is not None and kept.learned_at <= last.created_at
    if had_map and "registered" not in last.raw:
        return True  # the paths have changed, or too few people walk them to tell
    return reference.changed_s is not None and not _is_explained(session, reference, moves)


def _is_explained(
    session: Session, reference: SiteReferenceRecord, moves: tuple[SuspectedMove, ...]
) -> bool:
    """True where a person has said what the newest change was: put back by now, or none at all."""
    changed_s = reference.changed_s
    assert changed_s is not None
    for move in moves:
        if not move.by_person or changed_s < move.from_s:
            continue
        # A camera is put back before that is said, but seen there again only as people come.
        between = tracks.count_between(session, reference.camera_id, move.to_s, changed_s)
        if changed_s <= move.to_s or between <= FEWEST_BESIDE:
            return True
    return False


def _is_spoilt(
    kept: FlowMapRecord,
    reference_to_s: float,
    moves: tuple[SuspectedMove, ...],
    attended: Attendance,
) -> bool:
    if attended.announced_late(kept.learned_at, kept.to_s):
        return True
    return kept.to_s > reference_to_s and any(
        move.excluded and move.from_s <= kept.to_s and move.resolved_at > kept.learned_at
        for move in moves
    )


def _faded(age_s: Array | float, settings: Settings) -> Array:
    return np.asarray(0.5 ** (np.asarray(age_s) / (settings.flow_half_life_days * DAY_S)))
