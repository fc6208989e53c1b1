"""A report of some days: what moved and what was done, what needs a person, what moves often."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Annotated, Any

from pydantic import Field, TypeAdapter
from sqlalchemy.orm import Session

from service.cameras.status import alert_since, camera_statuses
from service.degrees import in_degrees
from service.enums import AlertKind, Outcome, PoseState
from service.settings import Settings
from service.store import alerts, fleet
from service.store.alerts import SCALE_KINDS, AlertFilter, AlertRecord
from service.wording.alerts import about_words, alert_line, done_words
from service.wording.times import from_seconds

_MOST_ALERTS, _MOST_COUNTED = 1_000, 20_000
_WEEKS, _OFTEN = 8, 10
WEEK = timedelta(days=7)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportedAlert:
    """An alert of a report: what it is about by name, what it tells, what was done about it.

    Seconds are since it was told: until somebody took it up, and until it ended.
    """

    alert_id: str
    camera_id: str | None
    name: str
    kind: AlertKind
    words: str
    drift: dict[str, Any]
    since: datetime
    opened_at: datetime
    acknowledged_by: str | None
    resolved_by: str | None
    resolved_at: datetime | None
    taken_up_after_s: float | None
    ended_after_s: float | None
    outcome: Outcome | None
    note: str | None
    done: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportedCamera:
    """A camera that needs a person as a report is made, and since when."""

    camera_id: str
    name: str
    state: PoseState
    since: datetime


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Numbers of alerts that were opened: of all, of moves, and of those that were called false."""

    alerts: int
    moved: int
    false_alarms: int


@dataclass(frozen=True, slots=True, kw_only=True)
class WeekCounts(Counts):
    """Those of a week."""

    begins_at: datetime


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraCounts(Counts):
    """Those of a camera."""

    camera_id: str
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A report: alerts that were open at any time of its days, newest first, by what they are.

    `unsure`, `silent`, `unconnected` and `uncalibrated` are cameras as they stand when it is made.
    `weeks` are the eight that end with it, oldest first; `often` has the cameras with most alerts
    in them. `more` alerts were open than a thousand, of which the newest are here.
    """

    from_: Annotated[datetime, Field(serialization_alias="from")]
    to: datetime
    made_at: datetime
    cameras: int
    moved: tuple[ReportedAlert, ...]
    clocks: tuple[ReportedAlert, ...]
    others: tuple[ReportedAlert, ...]
    false_alarms: tuple[ReportedAlert, ...]
    more: bool
    unsure: tuple[ReportedCamera, ...]
    silent: tuple[ReportedCamera, ...]
    unconnected: tuple[ReportedCamera, ...]
    uncalibrated: tuple[ReportedCamera, ...]
    weeks: tuple[WeekCounts, ...]
    often: tuple[CameraCounts, ...]

    @property
    def last_at(self) -> datetime:
        """The last moment that it is of: of one up to midnight, on the day before."""
        return self.to - timedelta(microseconds=1)


_BODY = TypeAdapter(Report)


def report_body(report: Report) -> dict[str, Any]:
    """A report as JSON."""
    body: dict[str, Any] = _BODY.dump_python(report, mode="json", by_alias=True)
    return body


def make_report(session: Session, settings: Settings, from_: datetime, to: datetime) -> Report:
    """The report of what was between two times."""
    now = datetime.now(UTC)
    names = dict(fleet.names(session, None))
    wanted = AlertFilter(open_since=from_, opened_to=to)
    found = _listed(session, wanted, now, _MOST_ALERTS + 1)
    reported = [_reported(record, names, now) for record in found[:_MOST_ALERTS]]
    cameras = _by_state(session, settings, names)
    since = _weeks_before(settings, to, _WEEKS)
    opened = _listed(session, AlertFilter(opened_from=since, opened_to=to), now, _MOST_COUNTED)
    return Report(
        from_=from_,
        to=to,
        made_at=now,
        cameras=len(names),
        **_by_section(reported),
        more=len(found) > _MOST_ALERTS,
        unsure=(*cameras[PoseState.UNSURE], *cameras[PoseState.SUSPECTED]),
        silent=tuple(cameras[PoseState.NO_DATA]),
        unconnected=tuple(cameras[PoseState.UNCONNECTED]),
        uncalibrated=tuple(cameras[PoseState.UNCALIBRATED]),
        weeks=tuple(_week(settings, to, back, opened) for back in range(_WEEKS, 0, -1)),
        often=tuple(_often(opened, names)),
    )


def _listed(session: Session, wanted: AlertFilter, now: datetime, limit: int) -> list[AlertRecord]:
    """Alerts, newest first; a group speaks for its members."""
    found = alerts.listed(session, wanted, now, limit, lean=True)
    return [record for record in found if record.group_id is None]


def _reported(record: AlertRecord, names: dict[str, str], now: datetime) -> ReportedAlert:
    taken_up = [at for at in (record.acknowledged_at, record.resolved_at) if at is not None]
    return ReportedAlert(
        alert_id=record.id,
        camera_id=record.camera_id,
        name=about_words(record, names),
        kind=record.kind,
        words=alert_line(record),
        drift=in_degrees(record.drift),
        since=alert_since(record),
        opened_at=record.opened_at,
        acknowledged_by=record.acknowledged_by,
        resolved_by=record.resolved_by,
        resolved_at=record.resolved_at,
        taken_up_after_s=_after_s(record, min(taken_up, default=None)),
        ended_after_s=_after_s(record, record.resolved_at),
        outcome=record.outcome,
        note=record.note,
        done=done_words(record, now),
    )


def _after_s(record: AlertRecord, at: datetime | None) -> float | None:
    return None if at is None else (at - record.opened_at).total_seconds()


def _by_section(found: Sequence[ReportedAlert]) -> dict[str, tuple[ReportedAlert, ...]]:
    sections = {AlertKind.DRIFT: "moved", **dict.fromkeys(SCALE_KINDS, "clocks")}
    parts: dict[str, list[ReportedAlert]] = defaultdict(list)
    for each in found:
        false = each.outcome == Outcome.FALSE_ALARM
        parts["false_alarms" if false else sections.get(each.kind, "others")].append(each)
    return {name: tuple(parts[name]) for name in ("moved", "clocks", "others", "false_alarms")}


def _by_state(
    session: Session, settings: Settings, names: dict[str, str]
) -> dict[PoseState, list[ReportedCamera]]:
    """Cameras by their states, of which one that has moved and is silent, too, has the latter."""
    cameras: dict[PoseState, list[ReportedCamera]] = defaultdict(list)
    for each in camera_statuses(session, settings, lean=True).values():
        state, since = each.state, each.since
        if each.silent and each.last_track_s is not None:
            state, since = PoseState.NO_DATA, from_seconds(each.last_track_s)
        name = names.get(each.camera_id, each.camera_id)
        cameras[state].append(
            ReportedCamera(camera_id=each.camera_id, name=name, state=state, since=since)
        )
    return cameras


def _weeks_before(settings: Settings, at: datetime, weeks: int) -> datetime:
    """The same hour so many weeks earlier, by the cameras' clock."""
    return (at.astimezone(settings.zone) - weeks * WEEK).astimezone(UTC)


def _week(settings: Settings, to: datetime, back: int, opened: Sequence[AlertRecord]) -> WeekCounts:
    begins_at, ends_at = (_weeks_before(settings, to, weeks) for weeks in (back, back - 1))
    mine = [each for each in opened if begins_at <= each.opened_at < ends_at]
    return WeekCounts(begins_at=begins_at, **_counts(mine))


def _often(opened: Sequence[AlertRecord], names: dict[str, str]) -> list[CameraCounts]:
    """The cameras with most alerts, of those that had two or more."""
    most = Counter(each.camera_id for each in opened if each.camera_id is not None)
    return [
        CameraCounts(
            camera_id=camera_id,
            name=names.get(camera_id, camera_id),
            **_counts([each for each in opened if each.camera_id == camera_id]),
        )
        for camera_id, count in most.most_common(_OFTEN)
        if count > 1
    ]


def _counts(opened: Sequence[AlertRecord]) -> dict[str, int]:
    false = sum(each.outcome == Outcome.FALSE_ALARM for each in opened)
    moved = sum(
        each.kind == AlertKind.DRIFT and each.outcome != Outcome.FALSE_ALARM for each in opened
    )
    return {"alerts": len(opened), "moved": moved, "false_alarms": false}
