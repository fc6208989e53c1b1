"""A camera's state in words: the headline of its page, its line in the fleet, their flags."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from models.monitoring.verdict import Drift
from models.reasons import Reason
from service.enums import AlertKind, AlertState, PoseState
from service.reasons import ServiceCode
from service.store.alerts import MOVED_KINDS, AlertRecord
from service.store.estimates import EstimateRecord
from service.wording.alerts import KINDS
from service.wording.moves import drift_words, moved_words, sure_words
from service.wording.reasons import in_words
from service.wording.times import Clock, duration

# What a camera is shown as: its state, but for a wrong clock, which moves no camera.
STATES: dict[PoseState | AlertKind, str] = {
    PoseState.DRIFTING: "Moved",
    AlertKind.CLOCK: "Clock",
    PoseState.UNSURE: "Unsure",
    PoseState.SUSPECTED: "Maybe moved",
    PoseState.NO_DATA: "No people",
    PoseState.UNCONNECTED: "Unconnected",
    PoseState.UNCALIBRATED: "Uncalibrated",
    PoseState.LEARNING: "Learning",
    PoseState.OK: "Steady",
}
_FEW_HOURS = 6  # of date and time: fewer are a morning's people; of words alone
# The alerts that a state speaks for; every other one is named.
_SPOKEN_FOR = {
    PoseState.DRIFTING: (AlertKind.DRIFT, AlertKind.CLOCK),
    PoseState.UNSURE: (AlertKind.UNSURE,),
    PoseState.NO_DATA: (AlertKind.NO_DATA,),
}


def shown_as(state: PoseState, alerts: Sequence[AlertRecord]) -> PoseState | AlertKind:
    """The word of `STATES` for a camera in a state, of which some alerts fire."""
    kinds = {alert.kind for alert in alerts}
    if state == PoseState.DRIFTING and AlertKind.CLOCK in kinds and AlertKind.DRIFT not in kinds:
        return AlertKind.CLOCK
    return state


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFacts:
    """The facts that a headline is made of.

    `alerts` fire, what needs a person most first. `learned` of `wanted` people make the reference,
    which is `ready` or not. `silence` says why nobody was seen since `silent_since_s`; None where
    people come.
    """

    state: PoseState
    judged: bool
    estimate: EstimateRecord | None
    alerts: Sequence[AlertRecord]
    answered_by: str | None
    ready: bool
    learned: int
    wanted: int
    silence: Sequence[Reason] | None
    silent_since_s: float | None


def headline(camera: CameraFacts, clock: Clock) -> str:
    """Has it moved, how far, since when, how sure: in one or two sentences."""
    if camera.silence is None or camera.silent_since_s is None:
        return _status_words(camera, clock)
    since = clock.when(clock.of(camera.silent_since_s))
    quiet = f"No people since {since}: {in_words(camera.silence)}."
    return f"{_status_words(camera, clock)} {quiet}"


def _status_words(camera: CameraFacts, clock: Clock) -> str:
    state, estimate = camera.state, camera.estimate
    known = estimate is not None and bool(estimate.identifiable)
    doubts = [alert for alert in camera.alerts if alert.kind in MOVED_KINDS]
    if state == PoseState.DRIFTING and not camera.judged:
        words = _moved(camera, estimate, clock) if estimate and known else _alarmed(doubts)
        return f"{words} That is what is known last: the next people will tell how it stands now."
    if estimate is not None and camera.judged and estimate.drifted:
        return _moved(camera, estimate, clock)
    if doubts:  # of a reference, or about a move whose size is not identifiable
        return _alarmed(doubts)
    if state == PoseState.UNSURE:
        return (
            "Something changed: people walk on none of the paths that were learned. The camera was "
            "turned far, or people walk elsewhere; a look at its picture tells which."
        )
    if state == PoseState.UNCONNECTED:
        return "Nobody has posted anybody's track for this camera yet."
    if state == PoseState.UNCALIBRATED:
        return (
            "Nobody has said how high it hangs and where it looks. The people before it tell: see "
            "below, and agree once it looks right."
        )
    if state == PoseState.LEARNING or estimate is None or not camera.judged:
        return _waiting(camera)
    if state == PoseState.NO_DATA:
        return "When it was last told, it stood where it should."
    if state == PoseState.SUSPECTED:
        how = moved_words(estimate)
        share = f"{100 * estimate.moved:.0f} %"
        return f"It may have moved ({share}){how and ': it ' + how}. The next people will tell."
    people = (
        f"{estimate.tracks} people of the last {duration(estimate.to_s - estimate.from_s)} show"
    )
    return f"Standing where it should, as {people}{sure_words(estimate)}."


def _alarmed(doubts: Sequence[AlertRecord]) -> str:
    return f"It may not stand where it should: {in_words(doubts[0].reasons)}."


def _moved(camera: CameraFacts, estimate: EstimateRecord, clock: Clock) -> str:
    since = ""
    if estimate.drift_since is not None:
        since = f" about {clock.when(estimate.drift_since)}"
    if any(alert.kind == AlertKind.CLOCK for alert in camera.alerts):
        how = moved_words(estimate)
        return (
            f"People seem to walk at another speed{since and ' since' + since}: a wrong clock or "
            f"frame rate looks like that{how and ', or the camera ' + how}{sure_words(estimate)}."
        )
    words = moved_words(estimate, since)
    if not words or not set(estimate.drifted) & set(estimate.identifiable):
        return f"The camera moved{since}; the newest people cannot tell how far."
    return f"The camera {words}{sure_words(estimate)}."


def _waiting(camera: CameraFacts) -> str:
    if camera.state in (PoseState.OK, PoseState.NO_DATA):
        who = camera.answered_by or "somebody"
        return f"Where it should be, as {who} said. The next people will tell."
    if not camera.ready:
        return f"Learning: {camera.learned} of {camera.wanted} people."
    return "Waiting for people: too few have come to tell how it stands."


def people_words(people: int, hours: int) -> str:
    """So many people; of how many hours, where they tell little of other times of day."""
    of_all = f"{people} {'person' if people == 1 else 'people'}"
    if not 0 < hours < _FEW_HOURS:
        return of_all
    return f"{of_all} of {'a single hour' if hours == 1 else f'{hours} different hours'}"


def few_hours_words(counted: int, wanted: int, hours: int) -> str:
    """What people of a few hours leave unknown; empty while most are still to come."""
    if not 0 < hours < _FEW_HOURS or 2 * counted < wanted:
        return ""
    when = "a single hour" if hours == 1 else f"{hours} hours"
    return (
        f"The reference is of {when} only, as of one morning: people of another time of day may "
        "walk elsewhere, and that may look as if something had changed. With more people "
        "(reference_tracks) it is of a whole day."
    )


def fleet_line(
    state: PoseState,
    kinds: Sequence[AlertKind],
    drift: Drift | None,
    *,
    judged: bool,
    learned: int | None,
    wanted: int,
    silent_s: float,
) -> str:
    """A camera's doings, in one line of the fleet.

    Args:
        state: of the camera.
        kinds: of the alerts that fire, what needs a person most first.
        drift: as far as it is sure.
        judged: whether the drift is of now, and not only the last that is known.
        learned: people of the reference; None where it is ready.
        wanted: as many make a reference.
        silent_s: since the newest track ended.
    """
    if state == PoseState.DRIFTING and AlertKind.CLOCK in kinds:
        return "people seem to walk too fast or too slowly: its clock or frame rate looks wrong"
    if kinds and kinds[0] == AlertKind.STALE:
        return "its estimate fails or lacks tracks: the alert says why, and since when"
    if state == PoseState.UNCONNECTED:
        return "nobody has posted tracks for it yet: its page says how"
    if state == PoseState.UNCALIBRATED:
        return "its pose is found by the people before it: its page has it, to be agreed to"
    if state == PoseState.LEARNING and learned is not None:
        return f"learning what is usual: {learned} of {wanted} people"
    if state == PoseState.LEARNING:
        return "waiting for people to tell how it stands now"
    if state == PoseState.UNSURE:
        return "people walk on none of the learned paths: turned far, or they walk elsewhere"
    if state == PoseState.NO_DATA:
        return f"no people seen for {duration(silent_s)}, longer than is usual here"
    if state == PoseState.OK:
        if judged:
            return "standing still"
        return "where it should be, as somebody said; the next people will tell"
    moved = drift_words(drift)
    if state == PoseState.SUSPECTED:
        return f"may have moved{moved and ': ' + moved}"
    if moved and not judged:
        return f"{moved} when it was last told"
    return moved or "moved, but by how much is not told yet"


def page_flags(
    lacks: Sequence[Reason], attended_until: datetime | None, clock: Clock
) -> Sequence[str]:
    """Flags of a camera's page, beside those of its alerts."""
    found = [
        f"Without the {str(lack.values['part']).replace('_', ' ')}"
        for lack in lacks
        if lack.code == ServiceCode.WITHOUT_PART
    ]
    if attended_until is not None:
        found.append(f"Maintenance until {clock.when(attended_until)}")
    return found


def page_alert_flags(alert: AlertRecord, group: AlertRecord | None, clock: Clock) -> Sequence[str]:
    """Flags of a camera's page, of an alert that fires."""
    found = []
    if alert.acknowledged_at is not None:
        found.append(f"Acknowledged by {alert.acknowledged_by}")
    if alert.silenced_until is not None and alert.is_silenced(clock.now):
        found.append(f"Silenced until {clock.when(alert.silenced_until)}")
    if group is not None:
        cameras = len(group.camera_ids or [])
        found.append(f"One of {cameras} cameras of {alert.track_source} at once")
    return found


def fleet_flags(
    state: PoseState, alerts: Sequence[AlertRecord], attended_until: datetime | None, now: datetime
) -> tuple[str, ...]:
    """The flags of a camera's line in the fleet, of what needs a person most first."""
    flags = []
    if attended_until is not None:
        flags.append(f"maintenance for {duration((attended_until - now).total_seconds())} more")
    if alerts:
        flags += fleet_alert_flags(alerts[0], now)
    elif state == PoseState.DRIFTING and attended_until is None:
        flags.append("no alert is open")
    for alert in alerts:
        if alert.kind not in _SPOKEN_FOR.get(state, ()):
            flags.append(f"alert: {KINDS[alert.kind].lower()}")
    return tuple(flags)


def fleet_alert_flags(alert: AlertRecord, now: datetime) -> tuple[str, ...]:
    """The flags of an alert in the fleet."""
    flags = []
    if alert.acknowledged_by is not None:
        flags.append(f"acknowledged by {alert.acknowledged_by}")
    elif alert.escalated_at is not None and alert.state == AlertState.FIRING:
        waits_s = (now - alert.opened_at).total_seconds()
        flags.append(f"escalated: nobody took it up in {duration(waits_s)}")
    if alert.silenced_until is not None and alert.is_silenced(now):
        flags.append(f"silenced for {duration((alert.silenced_until - now).total_seconds())} more")
    if alert.group_id is not None:
        flags.append("with its tracker")
    return tuple(flags)
