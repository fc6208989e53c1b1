"""The input of an estimate, read in one transaction: tracks of so many people, and what else."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

import numpy as np
import numpy.typing as npt
from sqlalchemy.orm import Session

from models.assessment import MOST_PIECES, AssessmentLimits, AssessmentState
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.pose import LinkScale, linked
from models.simulation.walkers import WalkConfig
from models.tracks.trajectory import Trajectory, end_key
from models.walking.config import FEWEST_WALKERS
from service.estimation.carried_state import carried_state, last_estimate
from service.estimation.due import PreviousEstimate
from service.estimation.monitor_state import monitor_basis
from service.estimation.seen_picture import SeenPicture, seen_picture
from service.references import drift_limits, made_against, window_of
from service.settings import Settings
from service.store import alerts, cameras, estimates, references, tracks, trainings, windows, zones
from service.store.cameras import CameraRecord
from service.store.estimates import EstimateRecord
from service.store.references import (
    AnchorRecord,
    FlowMapRecord,
    LastPoseRecord,
    SiteReferenceRecord,
)
from service.store.run_budget import RunBudget
from service.store.tracks import StoredTrack, seen_of, trajectory_of
from service.store.trainings import ModelRecord
from service.store.windows import PredictionRecord, WindowBounds
from service.store.zones import ZonesRecord

# The store may give a deleted track's number to a new one; a budget may leave one point of it.
_Track = tuple[int, datetime, int]


class Unpacked:
    """A cache of unpacked tracks, and the budget by which they are read; of one look."""

    def __init__(self, budget: RunBudget | None = None) -> None:
        self.budget = budget or RunBudget()
        self._feet: dict[_Track, Trajectory] = {}
        self._seen: dict[_Track, tuple[Intrinsics, Trajectory]] = {}

    def feet(self, record: StoredTrack) -> Trajectory:
        """The foot points of a stored track."""
        track = _named(record)
        if track not in self._feet:
            self._feet[track] = trajectory_of(record)
        return self._feet[track]

    def seen(self, record: StoredTrack, intrinsics: Intrinsics) -> Trajectory:
        """The feet of a stored track, with the upper edges of its boxes or its heads, if any."""
        track = _named(record)
        lens, seen = self._seen.get(track, (None, None))
        if seen is None or (lens is not intrinsics and lens != intrinsics):
            seen = seen_of(record, self.feet(record), intrinsics)
            self._seen[track] = (intrinsics, seen)
        return seen


def _named(record: StoredTrack) -> _Track:
    return record.id, record.received_at, len(record.points)


_SPARE = 40
_EXACT_ROUNDS, _LARGE_ROUND = 12, 0.25  # then by a quarter of the people wanted, at least


@dataclass(frozen=True, slots=True, kw_only=True)
class Gathered:
    """Tracks, and whether there are `enough`: of as many people as were wanted.

    `before` is the piece before each of a walk, as of `link_pieces`, `link_scale` the scale by
    which they were linked.
    """

    records: Sequence[StoredTrack]
    enough: bool
    before: npt.NDArray[np.int64]
    link_scale: LinkScale | None

    @property
    def pieces(self) -> int:
        """The number of tracks that go on others' walks."""
        return int((self.before >= 0).sum())


def until_so_many(
    load: Callable[[int], Sequence[StoredTrack]],
    wanted: int,
    intrinsics: Intrinsics,
    prior: CameraPose,
    unpacked: Unpacked,
    *,
    newest: bool = False,
) -> Gathered:
    """The fewest tracks that are of so many people; all that there are where these are too few.

    One track more is never two people more, so that asking for as many more as are missing ends at
    the same tracks whenever it is asked. Five times as many tracks as people do in any case, and
    of tracks that are nearly all pieces some more than the fewest: each time all are linked anew.

    `load` gives the first so many tracks, or the `newest`, which are the last in order; `prior` is
    about where the camera stands.
    """
    limit, most = wanted, MOST_PIECES * wanted
    loaded = limit + max(limit // _SPARE, 1)  # most trackers cut few walks: once is enough
    every = load(loaded)
    rounds = 0
    while True:
        rounds += 1
        if limit > loaded:
            loaded = limit
            every = load(loaded)
        all_there_are = len(every) < limit
        chosen = every if all_there_are else every[-limit:] if newest else every[:limit]
        records = sorted(chosen, key=lambda record: end_key(unpacked.feet(record)))
        links = linked([unpacked.seen(record, intrinsics) for record in records], intrinsics, prior)
        before = links.before
        missing = wanted - int((before < 0).sum())
        if all_there_are or missing <= 0 or limit == most:
            return Gathered(
                records=records,
                enough=not all_there_are,
                before=before,
                link_scale=links.scale,
            )
        if rounds >= _EXACT_ROUNDS:
            missing = max(missing, round(_LARGE_ROUND * wanted))
        limit = min(limit + missing, most)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenTrack:
    """A track of the window. `unanswered`: it came after the last alert was put right."""

    pk: int
    unanswered: bool
    started_s: float
    ended_s: float
    trajectory: Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchor:
    """The first map and chart of a reference, and its log of whole days.

    The log counts from `from_s` on: since then the camera has moved only by slow drift.
    """

    record: AnchorRecord
    from_s: float | None


def anchor_of(
    session: Session, reference: SiteReferenceRecord, bounds: WindowBounds
) -> Anchor | None:
    """The anchor of a reference; None where there is none. `bounds` are those of its window."""
    record = session.get(AnchorRecord, reference.id)
    if record is None:
        return None
    since = [at for at in (bounds.started_from_s, bounds.ended_from_s) if at is not None]
    return Anchor(record=record, from_s=max(since, default=None))


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """The tracks of a window in the order of their ends, and what they are judged by.

    `site` is the learned reference as bytes; None while it is being learned. So are `flow` and
    `chart`; None if there is none. `predictions` are by the model in use. `limits` are what an
    alarm depends on. `before` is the piece before each track of a walk, as from `link_pieces`; None
    if they were not linked yet. `last` is where the estimate before ended, `picture` the result of
    the newest image. `zones` depend on the pose; `state` is what earlier assessments and the
    operators' answers left, `previous` the last full estimate; `asked` is whether a page or an
    operator asks for another one. `link_scale` belongs to `before`; `monitor_basis` names what the
    scores of the tracks depend on.
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
    limits: AssessmentLimits
    model_id: str | None
    predictions: tuple[PredictionRecord, ...]
    before: npt.NDArray[np.int64] | None = None
    last: LastPoseRecord | None = None
    picture: SeenPicture | None = None
    zones: ZonesRecord | None = None
    state: AssessmentState = field(default_factory=AssessmentState)
    previous: PreviousEstimate | None = None
    asked: bool = False
    link_scale: LinkScale | None = None
    monitor_basis: str = ""


def load_evidence(
    session: Session,
    settings: Settings,
    camera_id: str,
    unpacked: Unpacked | None = None,
    *,
    asked: bool = False,
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
        lambda limit: windows.window(session, replace(bounds, tracks=limit), unpacked.budget),
        bounds.tracks,
        intrinsics,
        prior,
        unpacked,
        newest=True,
    )
    records, model = gathered.records, trainings.newest_model(session, camera_id)
    picture = seen_picture(session, reference, bounds)
    if len(records) < FEWEST_WALKERS or not _is_news(session, reference, model, records, picture):
        return None
    drawn = zones.of_camera(session, camera_id)
    kept = session.get(FlowMapRecord, reference.id)
    answered_at = alerts.answered_at(session, camera_id)
    seen = [
        SeenTrack(
            pk=record.id,
            unanswered=answered_at is None or record.received_at > answered_at,
            started_s=record.started_s,
            ended_s=record.ended_s,
            trajectory=unpacked.seen(record, intrinsics),
        )
        for record in records
    ]
    pks = [record.id for record in records]
    rows = () if model is None else windows.predictions(session, model.id, pks)
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
        limits=assessment_limits(settings, camera, tracks.a_year(session, camera_id)),
        model_id=None if model is None else model.id,
        predictions=tuple(rows),
        before=gathered.before,
        last=session.get(LastPoseRecord, reference.id),
        picture=picture,
        zones=drawn,
        state=carried_state(session, reference),
        previous=_previous(last_estimate(session, reference), model, pks, picture),
        asked=asked,
        link_scale=gathered.link_scale,
        monitor_basis=monitor_basis(session, camera, reference, bounds),
    )


def _previous(
    last: EstimateRecord | None,
    model: ModelRecord | None,
    pks: Sequence[int],
    picture: SeenPicture | None,
) -> PreviousEstimate | None:
    if last is None:
        return None
    other_model = last.model_id != (None if model is None else model.id)
    return PreviousEstimate(
        state=last.state,
        moved=last.moved,
        new_tracks=sum(pk > last.newest_track_pk for pk in pks),
        has_new_input=other_model or (picture is not None and not picture.was_told(last)),
    )


def assessment_limits(
    settings: Settings, camera: CameraRecord, tracks_a_year: float
) -> AssessmentLimits:
    """What an alarm about a camera depends on, at this rate of tracks."""
    return AssessmentLimits(
        drift=drift_limits(settings),
        alarms_a_year=settings.false_alarms_per_year,
        tracks_a_year=tracks_a_year,
        moved_prior=settings.moved_prior,
        frame_rate_hz=camera.frame_rate_hz,
    )


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
    picture: SeenPicture | None,
) -> bool:
    """True where the last estimate was of others: tracks, a picture, a model, a reference."""
    last = estimates.newest(session, reference.camera_id)
    if last is None or last.reference_id != reference.id:
        return True
    if reference.ready_at is not None and not made_against(reference, last):
        return True
    if picture is not None and not picture.was_told(last):
        return True
    seen = (None if model is None else model.id, max(r.id for r in records), len(records))
    return (last.model_id, last.newest_track_pk, last.tracks) != seen
