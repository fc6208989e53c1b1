"""The anchor of a reference: its first map and chart, and each whole day held against them."""

import math
from dataclasses import dataclass, replace
from datetime import datetime

from sqlalchemy.orm import Session

from models.assessment import begin_slow_drift_log, log_slow_drift
from models.durations import DAY_S
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.pose import (
    CameraSite,
    chart_from_bytes,
    chart_to_bytes,
    observe,
    paths_from_bytes,
    paths_to_bytes,
    reference_from_bytes,
    slow_drift_log_from_bytes,
    slow_drift_log_to_bytes,
)
from models.tracks.trajectory import Trajectory
from service.estimation.evidence import Anchor, Unpacked, anchor_of
from service.references import window_of
from service.settings import Settings
from service.store import cameras, references, windows
from service.store.cameras import CameraRecord
from service.store.references import AnchorRecord, FlowMapRecord

_MOST_A_DAY = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedPaths:
    """A flow map and the drift chart that goes with it, as bytes."""

    flow: bytes
    chart: bytes | None


def paths_of(site: CameraSite) -> LearnedPaths | None:
    """The map and the chart of a site; None where too few walking groups walk."""
    if site.paths is None:
        return None
    return LearnedPaths(
        flow=paths_to_bytes(site.paths),
        chart=None if site.chart is None else chart_to_bytes(site.chart),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorDays:
    """The tracks of whole days that are to be held against an anchor, in the order of their ends.

    They end at `to_s`.
    """

    site: bytes
    anchor: Anchor
    intrinsics: Intrinsics
    prior: CameraPose
    trajectories: tuple[Trajectory, ...]
    to_s: float


def keep_paths(
    session: Session,
    reference_id: int,
    paths: LearnedPaths | None,
    *,
    tracks: int,
    weight: float,
    to_s: float,
    learned_at: datetime,
    anchored: bool,
) -> None:
    """Make a map and its chart those of a reference; and its anchor, where there is a chart."""
    made = {"reference_id": reference_id, "to_s": to_s, "learned_at": learned_at}
    flow, chart = (None, None) if paths is None else (paths.flow, paths.chart)
    session.merge(FlowMapRecord(**made, data=flow, chart=chart, tracks=tracks, weight=weight))
    if anchored and chart is not None:
        session.merge(AnchorRecord(**made, flow=flow, chart=chart, creep=None, logged_to_s=None))


def load_anchor_days(
    session: Session, settings: Settings, camera_id: str, unpacked: Unpacked | None = None
) -> AnchorDays | None:
    """The whole days that a camera's anchor has not seen; None where there is none."""
    unpacked = unpacked or Unpacked()
    camera = session.get(CameraRecord, camera_id)
    reference = references.newest_if_any(session, camera_id)
    if camera is None or reference is None or reference.data is None:
        return None
    bounds = window_of(session, reference, settings)
    anchor = anchor_of(session, reference, bounds)
    if anchor is None:
        return None
    newest_s = windows.newest_end_s(session, bounds)
    if newest_s is None:
        return None
    # The day of the newest track is not over yet.
    to_s = math.floor(newest_s / DAY_S) * DAY_S
    record = anchor.record
    after_s = record.to_s if record.logged_to_s is None else record.logged_to_s
    if to_s <= after_s:
        return None
    found = windows.of_days(session, bounds, after_s, to_s, _MOST_A_DAY, unpacked.budget)
    intrinsics = camera.intrinsics
    return AnchorDays(
        site=reference.data,
        anchor=anchor,
        intrinsics=intrinsics,
        prior=cameras.prior_pose(session, camera_id).pose,
        trajectories=tuple(unpacked.seen(track, intrinsics) for track in found),
        to_s=to_s,
    )


def compute_anchor_days(days: AnchorDays) -> bytes | None:
    """The log with some days more, as bytes."""
    first = first_site(
        CameraSite(
            intrinsics=days.intrinsics,
            prior=days.prior,
            speed_reference=reference_from_bytes(days.site),
        ),
        days.anchor,
    )
    kept = days.anchor.record
    log = None if kept.creep is None else slow_drift_log_from_bytes(kept.creep)
    log = log or begin_slow_drift_log(first, kept.to_s)
    if log is None:
        return None
    if days.trajectories:
        log = log_slow_drift(log, observe(days.trajectories, days.intrinsics, days.prior), first)
    return slow_drift_log_to_bytes(log)


def save_anchor_days(session: Session, days: AnchorDays, log: bytes | None) -> None:
    """Keep a log, unless its anchor or its days have become others meanwhile."""
    before = days.anchor.record
    record = session.get(AnchorRecord, before.reference_id)
    if record is None or record.learned_at != before.learned_at:
        return
    if record.logged_to_s == before.logged_to_s:
        record.creep, record.logged_to_s = log, days.to_s


def first_site(site: CameraSite, anchor: Anchor) -> CameraSite:
    """A site as it was first learned.

    Raises:
        CheckpointError: what is stored cannot be read.
    """
    kept = anchor.record
    return replace(site, paths=paths_from_bytes(kept.flow), chart=chart_from_bytes(kept.chart))
