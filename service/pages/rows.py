"""Lines of the fleet page as its templates take them: words, numbers and drawings, no records."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, tzinfo

from markupsafe import Markup

from service.enums import AlertKind, PoseState, Severity
from service.pages.drawings.sparkline import sparkline
from service.pages.views.fleet import FleetAlert, FleetCamera, FleetGroup
from service.pages.wording.camera_words import KINDS
from service.pages.wording.words import STATES, ago, clock_time, duration, from_seconds, situation
from service.reason_words import group_in_words

# What a state says by itself; every other alert is named.
_SAID = {
    PoseState.DRIFTING: (AlertKind.DRIFT, AlertKind.CLOCK),
    PoseState.NO_DATA: (AlertKind.NO_DATA,),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A camera's line. `key` sorts lines as strings, `text` is what a search looks in.

    `alerts` are the ids of all that fire.
    """

    id: str
    name: str
    state: PoseState
    word: str
    words: str
    flags: tuple[str, ...]
    training: int | None
    share: int | None
    spark: Markup
    alerts: str
    since: str
    since_clock: str
    since_words: str
    last: str
    last_clock: str
    last_words: str
    key: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Banner:
    """An alert about a tracker."""

    title: str
    words: str
    severity: Severity
    since: str
    since_clock: str
    since_words: str
    flags: tuple[str, ...]
    cameras: tuple[tuple[str, str], ...]


def rows_of(cameras: Sequence[FleetCamera], now: datetime, zone: tzinfo) -> list[Row]:
    """The lines of some cameras."""
    return [_row(camera, now, zone) for camera in cameras]


def banners_of(groups: Sequence[FleetGroup], now: datetime, zone: tzinfo) -> list[Banner]:
    """The alerts about trackers."""
    return [
        Banner(
            title=f"Tracker {group.track_source}:",
            words=group_in_words(group.alert.reasons),
            severity=group.alert.severity,
            since=group.alert.since.isoformat(),
            since_clock=clock_time(group.alert.since, zone),
            since_words=ago(group.alert.since, now),
            flags=_alert_flags(group.alert, now),
            cameras=group.cameras,
        )
        for group in groups
    ]


def counts_of(cameras: Sequence[FleetCamera]) -> list[tuple[PoseState, str, int]]:
    """Each state with its word and how many cameras are in it."""
    count = Counter(camera.state for camera in cameras)
    return [(state, word, count[state]) for state, word in STATES.items()]


def urgent(cameras: Sequence[FleetCamera]) -> int:
    """How many have moved."""
    return sum(camera.state == PoseState.DRIFTING for camera in cameras)


def _row(camera: FleetCamera, now: datetime, zone: tzinfo) -> Row:
    last = None if camera.last_track_s is None else from_seconds(camera.last_track_s)
    since = camera.since
    share = None
    if camera.learned is not None:
        share = round(100 * camera.learned / camera.wanted)
    return Row(
        id=camera.camera_id,
        name=camera.name,
        state=camera.state,
        word=STATES[camera.state],
        words=situation(camera, now),
        flags=_flags(camera, now),
        training=None if camera.training is None else round(100 * camera.training.share),
        share=share,
        spark=sparkline(camera.history),
        alerts=" ".join(alert.alert_id for alert in camera.alerts),
        since=since.isoformat(timespec="seconds"),
        since_clock=clock_time(since, zone),
        since_words=ago(since, now),
        last="" if last is None else last.isoformat(timespec="seconds"),
        last_clock="" if last is None else clock_time(last, zone),
        last_words="" if last is None else ago(last, now),
        key=_key(camera),
        text=f"{camera.name} {camera.camera_id}".lower(),
    )


def _key(camera: FleetCamera) -> str:
    """What `views.fleet.order` says, as a string: newest first is what remains to 2**40."""
    rank, negative_s, name = camera.order
    return f"{rank}-{2**40 + negative_s:016.1f}-{name}-{camera.camera_id}"


def _flags(camera: FleetCamera, now: datetime) -> tuple[str, ...]:
    flags = []
    if camera.attended_until is not None:
        left_s = (camera.attended_until - now).total_seconds()
        flags.append(f"maintenance for {duration(left_s)} more")
    if camera.alert is not None:
        flags += _alert_flags(camera.alert, now)
    elif camera.state == PoseState.DRIFTING and camera.attended_until is None:
        flags.append("no alert is open")
    for alert in camera.alerts:
        if alert.kind not in _SAID.get(camera.state, ()):
            flags.append(f"alert: {KINDS[alert.kind].lower()}")
    return tuple(flags)


def _alert_flags(alert: FleetAlert, now: datetime) -> tuple[str, ...]:
    flags = []
    if alert.acknowledged_by is not None:
        flags.append(f"seen by {alert.acknowledged_by}")
    if alert.silenced_until is not None:
        flags.append(f"silenced for {duration((alert.silenced_until - now).total_seconds())} more")
    if alert.grouped:
        flags.append("with its tracker")
    return tuple(flags)
