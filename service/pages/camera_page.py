"""`/ui/cameras/{id}`: the page of a camera, and all that it shows, read in one go."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse
from sqlalchemy.orm import Session

from models.geometry.ground import Misplacement, misplacements
from models.tracks.trajectory import Trajectory
from service.access.tokens import Caller
from service.alerts.alerts import list_alerts
from service.alerts.data_gaps import DataGap, data_gap_of
from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.cameras.cameras import CameraView, view_camera
from service.cameras.held_poses import drawn_since_move
from service.cameras.poses import PoseView, view_pose
from service.cameras.snapshots import image_facts, stood_at
from service.cameras.sources import SourceView, selectable_sources
from service.cameras.undo import UNDO_WITHIN, last_answer
from service.cameras.zones import ZonesView, view_zones
from service.degrees import in_degrees
from service.enums import AlertState, PoseState, TokenScope
from service.formats.zone_formats import ZoneFormat
from service.pages.camera_charts import RANGES, History, draw_charts, load_history, table_rows
from service.pages.camera_drawings import draw_camera
from service.pages.connecting import how_to_connect
from service.settings import Settings
from service.store import cameras, journal, references, tracks, trainings
from service.store.alerts import AlertFilter, AlertRecord
from service.store.cameras import PlanRecord, PriorPoseRecord, SnapshotRecord
from service.store.journal import ActivityRecord
from service.store.references import MaintenanceRecord
from service.store.tracks import StoredTrack, trajectory_of
from service.store.trainings import TrainingRecord
from service.wording import alerts as alert_words
from service.wording import camera as camera_words
from service.wording import image_sizes, moves
from service.wording.camera import CameraFacts
from service.wording.language import _
from service.wording.reasons import in_words
from service.wording.times import Clock
from service.wording.zones import (
    apply_words,
    corner_words,
    count_words,
    undetermined_words,
    zone_words,
)

_TRACKS = 120  # more are a carpet
_ALERTS, _ACTIVITY, _TRAININGS, _PRIORS, _PAST_WINDOWS = 50, 40, 5, 20, 5
DISTANCES_M = (5.0, 10.0, 20.0, 40.0, 80.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertStory:
    """An alert, and the group that it belongs to, if it does."""

    record: AlertRecord
    group: AlertRecord | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraPage:
    """The contents of a camera's page. Lists are newest first, windows in their order.

    `alerts` are all that fire, and then those that ended last.

    `tracks` are those that the served pose is of, the newest of them, and `before` the last ones of
    before a move. `misplaced` is what the drift
    means on the ground; empty where there is none. `sources` are those of its tracks, where there
    are several.
    """

    now: datetime
    camera: CameraView
    pose: PoseView
    silence: DataGap | None
    newest_track_s: float | None
    tracks: tuple[Trajectory, ...]
    before: tuple[Trajectory, ...]
    misplaced: tuple[Misplacement, ...]
    alerts: tuple[AlertStory, ...]
    priors: tuple[PriorPoseRecord, ...]
    windows: tuple[MaintenanceRecord, ...]
    trainings: tuple[TrainingRecord, ...]
    activity: tuple[ActivityRecord, ...]
    sources: tuple[SourceView, ...]
    snapshot: SnapshotRecord | None
    stood_at: datetime | None
    plan: PlanRecord | None
    zones: ZonesView
    snapshots_allowed: bool
    newest_event_id: int
    answer: ActivityRecord | None

    @property
    def firing(self) -> tuple[AlertStory, ...]:
        """The open alerts, what needs a person most first."""
        stories = {story.record.id: story for story in self.alerts}
        return tuple(stories[record.id] for record in self.pose.status.alerts)

    @property
    def past(self) -> tuple[AlertStory, ...]:
        """The alerts that have ended."""
        return tuple(story for story in self.alerts if story.record.state != AlertState.FIRING)

    @property
    def attended(self) -> MaintenanceRecord | None:
        """The maintenance window that is under way, the one that ends last."""
        here = [each for each in self.windows if each.holds(self.now)]
        return max(here, key=lambda each: each.until, default=None)

    @property
    def facts(self) -> CameraFacts:
        """The facts that its headline is made of."""
        status, reference, silence = self.pose.status, self.pose.reference, self.silence
        if not status.silent or status.state == PoseState.LEARNING:
            silence = None  # as is usual, or nothing is known to be usual yet
        return CameraFacts(
            state=status.state,
            judged=status.judged,
            estimate=status.estimate,
            alerts=status.alerts,
            answered_by=status.reference.answered_by,
            ready=reference.ready,
            learned=reference.counted,
            wanted=reference.wanted,
            silence=None if silence is None else silence.reasons,
            silent_since_s=None if silence is None else silence.last_s,
        )


def view_camera_page(session: Session, settings: Settings, camera_id: str) -> CameraPage:
    """All that the page of a camera shows.

    Raises:
        NotFoundError: there is no such camera.
    """
    now = datetime.now(UTC)
    # Taken first: what happens while the rest is read is told again, and not missed.
    newest_event_id = journal.newest_event_id(session)
    camera = view_camera(session, settings, camera_id)
    pose = view_pose(session, settings, camera_id)
    estimate = pose.status.estimate
    ended = AlertFilter(state=AlertState.RESOLVED, camera_id=camera_id)
    found = [*pose.status.alerts, *list_alerts(session, ended, _ALERTS)]
    windows = references.maintenance_of(session, camera_id)
    over = sum(window.until <= now for window in windows)
    priors = cameras.prior_poses(session, camera_id, _PRIORS)
    shown = tracks.newest(
        session, camera_id, _TRACKS, None if estimate is None else estimate.from_s
    )
    earlier: Sequence[StoredTrack] = ()
    if estimate is not None and estimate.drifted:
        moved_s = [each.changed_at.timestamp() for each in pose.status.alerts if each.changed_at]
        stood_to_s = min([estimate.from_s, *moved_s])
        earlier = tracks.newest(session, camera_id, _TRACKS // 2, ended_to_s=stood_to_s)
    misplaced: tuple[Misplacement, ...] = ()
    # Of a camera that stands still it would tell of the estimate's noise.
    if (
        estimate is not None
        and estimate.identifiable
        and (estimate.drifted or estimate.drift_streak > 0)
    ):
        misplaced = misplacements(camera.intrinsics, pose.pose, camera.prior_pose, DISTANCES_M)
    return CameraPage(
        now=now,
        camera=camera,
        pose=pose,
        silence=data_gap_of(session, settings, camera_id, now),
        newest_track_s=tracks.newest_end_s(session, camera_id),
        tracks=tuple(trajectory_of(record) for record in shown),
        before=tuple(trajectory_of(record) for record in earlier),
        misplaced=misplaced,
        alerts=tuple(
            AlertStory(
                record=record,
                group=None
                if record.group_id is None
                else session.get(AlertRecord, record.group_id),
            )
            for record in found
        ),
        priors=tuple(priors),
        windows=tuple(windows[max(over - _PAST_WINDOWS, 0) :]),
        trainings=tuple(trainings.of_camera(session, camera_id, _TRAININGS)),
        activity=tuple(journal.newest_activity(session, camera_id, _ACTIVITY)),
        sources=selectable_sources(session, settings, camera_id),
        snapshot=image_facts(session, settings, SnapshotRecord, camera_id),
        stood_at=stood_at(session, settings, camera_id),
        plan=image_facts(session, settings, PlanRecord, camera_id),
        zones=view_zones(session, camera_id),
        snapshots_allowed=settings.snapshots == "pictures",
        newest_event_id=newest_event_id,
        answer=last_answer(session, camera_id, now),
    )


router = APIRouter(include_in_schema=False)


@router.get("/ui/cameras/{camera_id}")
def show(
    camera_id: str,
    request: Request,
    state: StateDep,
    session: ReadDep,
    days: Annotated[int, Query(ge=0, le=3660, description="of the charts; 0 for all")] = 0,
) -> HTMLResponse:
    """Has the camera moved, how far, since when, how sure, and what to do now."""
    page = view_camera_page(session, state.settings, camera_id)
    state.watched.note(camera_id)
    zone = state.settings.zone
    clock = Clock(now=page.now, zone=zone)
    learned = page.pose.reference
    caller: Caller | None = request.state.caller
    operates = caller is None or caller.may(TokenScope.OPERATE)
    proposal = page.pose.proposed
    history = History(
        items=load_history(session, camera_id, days, page.now),
        priors=page.priors,
        alerts=[story.record for story in page.alerts],
        acts=page.activity,
        windows=page.windows,
    )
    return render(
        request,
        "camera/page.html",
        page=page,
        clock=clock,
        zone_name=state.settings.timezone,
        people=camera_words.people_words(learned.counted, learned.hours),
        few_hours=camera_words.few_hours_words(learned.counted, learned.wanted, learned.hours),
        headline=camera_words.headline(page.facts, clock),
        shown=camera_words.shown_as(page.pose.status.state, page.pose.status.alerts),
        undo=_undo(page, caller),
        drawings=draw_camera(
            page.camera,
            page.pose,
            page.tracks,
            page.before,
            page.misplaced,
            page.snapshot if operates else None,
            page.zones,
        ),
        proposed=moves.proposed_rows(proposal.pose, proposal.sd) if proposal else None,
        zones=_zone_rows(page.zones, _counts(page)),
        undetermined=_undetermined(page.zones),
        applied=apply_words(page.zones.record.form if page.zones.record else None),
        frigate=_frigate(state.settings, page.zones),
        parameters=moves.parameter_rows(
            page.camera.prior_pose, page.pose.pose, page.pose.status.estimate
        ),
        deaf=moves.deaf_words(page.pose.status.estimate),
        told_by=moves.TOLD_BY,
        misplaced=moves.misplaced_words(page.misplaced),
        flags=_flags(page, clock),
        activity=[(entry, alert_words.entry_words(entry, clock)) for entry in page.activity],
        connect=None if learned.ready else how_to_connect(request, state.settings, camera_id),
        operates=operates,
        administers=caller is None or caller.may(TokenScope.ADMIN),
        plan=_plan(page.plan),
        words=alert_words,
        in_words=in_words,
        question_words=image_sizes.question_words,
        fix_words=image_sizes.fix_words,
        keep_words=image_sizes.keep_words,
        states=camera_words.STATES,
        training_words=camera_words.TRAININGS,
        charts=draw_charts(history, clock),
        chart_rows=table_rows(history.items, clock),
        days=days,
        ranges=RANGES,
        newest_event=page.newest_event_id,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class UndoWords:
    """An answer that can be taken back: `who` gave it, named or "You"."""

    by: str | None
    who: str
    words: str
    at: datetime
    until: datetime


def _undo(page: CameraPage, caller: Caller | None) -> UndoWords | None:
    entry = page.answer
    if entry is None:
        return None
    own = caller is not None and caller.name == entry.by
    return UndoWords(
        by=entry.by,
        who=_("You") if own else entry.by or _("Someone"),
        words=_(alert_words.ANSWERED[entry.what]),
        at=entry.at,
        until=entry.at + UNDO_WITHIN,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneRow:
    """A zone in words: the effect of a move, counts of a line, the error of its corners.

    Any may be empty.
    """

    name: str
    overlap: float
    meaning: str = ""
    counted: str = ""
    sure: str = ""


def _counts(page: CameraPage) -> dict[str, str]:
    """Whom lines counted, by their names, as the alert says; not of lines that are drawn since."""
    record, counts = page.zones.record, {}
    for story in page.firing:
        moved = (story.record.evidence or {}).get("zones")
        if moved and record is not None and story.record.updated_at >= record.updated_at:
            for each in moved["zones"]:
                counts[each["id"]] = count_words(
                    each["crossed"], each["missed"], each["false_counts"]
                )
    return counts


def _zone_rows(view: ZonesView, counts: Mapping[str, str]) -> list[ZoneRow]:
    rows = []
    for each in view.zones:
        sizes = [] if each.now.ellipses is None else each.now.ellipses[:, 0].tolist()
        worst_px = max((size for size in sizes if math.isfinite(size)), default=None)
        words = {"sure": corner_words(worst_px)}
        if view.moved:
            shares = {"overlap": each.now.overlap, "in_view": each.now.in_view}
            words["meaning"] = zone_words(each.zone.on, **shares)
            words["counted"] = counts.get(each.zone.id, "")
        rows.append(ZoneRow(name=each.zone.id, overlap=each.now.overlap, **words))
    return rows


def _undetermined(view: ZonesView) -> str:
    """What zones do not follow, in words; empty unless the camera moved since they were drawn."""
    if view.record is None or not view.held.drifted or drawn_since_move(view.record, view.held):
        return ""
    return undetermined_words(view.held.identifiable)


def _plan(record: PlanRecord | None) -> dict[str, Any] | None:
    """A plan as the API has it, for the script that shows it."""
    names = ("sha256", "width", "height", "metres_per_pixel", "north_rad")
    return None if record is None else in_degrees({name: getattr(record, name) for name in names})


def _frigate(settings: Settings, zones: ZonesView) -> str | None:
    """Where Frigate's configuration is edited; None of other zones, or where nobody says it."""
    of_frigate = zones.record is not None and zones.record.form == ZoneFormat.FRIGATE
    if not of_frigate or settings.mqtt_frigate_url is None:
        return None
    return f"{settings.mqtt_frigate_url.rstrip('/')}/config"


def _flags(page: CameraPage, clock: Clock) -> list[str]:
    """Flags of open alerts and maintenance, each once."""
    until = None if page.attended is None else page.attended.to_at
    flags = [*camera_words.page_flags(page.camera.record.missing_parts, until, clock)]
    for story in page.firing:
        flags += camera_words.page_alert_flags(story.record, story.group, clock)
    return list(dict.fromkeys(flags))
