"""A camera's state in words: the headline of its page, its line in the fleet, their flags."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from models.monitoring.drift import Drift
from models.reasons import Reason
from service.enums import AlertKind, AlertState, PoseState, TrainingState
from service.reasons import ServiceCode
from service.store.alerts import MOVED_KINDS, SCALE_KINDS, AlertRecord
from service.store.estimates import EstimateRecord
from service.wording.alerts import KINDS, LINES
from service.wording.language import N_, _, _n, inner
from service.wording.moves import drift_words, moved_words, sure_words
from service.wording.reasons import in_words
from service.wording.times import Clock, duration

# What a camera is shown as: its state, but for a wrong clock or lens, which move no camera.
STATES: dict[PoseState | AlertKind, str] = {
    PoseState.DRIFTING: N_("Moved"),
    AlertKind.CLOCK: N_("Clock"),
    AlertKind.LENS: N_("Lens"),
    PoseState.UNSURE: N_("Unsure"),
    PoseState.SUSPECTED: N_("Maybe moved"),
    PoseState.NO_DATA: N_("No people"),
    PoseState.UNCONNECTED: N_("Unconnected"),
    PoseState.UNCALIBRATED: N_("Uncalibrated"),
    PoseState.LEARNING: N_("Learning"),
    PoseState.OK: N_("Steady"),
}
TRAININGS = {
    TrainingState.QUEUED: N_("Queued"),
    TrainingState.RUNNING: N_("Running"),
    TrainingState.SUCCEEDED: N_("Succeeded"),
    TrainingState.FAILED: N_("Failed"),
    TrainingState.CANCELLED: N_("Cancelled"),
}
_FEW_HOURS = 6  # of date and time: fewer are a morning's people; of words alone
# The alerts that a state speaks for; every other one is named.
_SPOKEN_FOR = {
    PoseState.DRIFTING: MOVED_KINDS,
    PoseState.UNSURE: (AlertKind.UNSURE,),
    PoseState.NO_DATA: (AlertKind.NO_DATA,),
}


def shown_as(state: PoseState, alerts: Sequence[AlertRecord]) -> PoseState | AlertKind:
    """The word of `STATES` for a camera in a state, of which some alerts fire."""
    kinds = {alert.kind for alert in alerts}
    if state == PoseState.DRIFTING and AlertKind.DRIFT not in kinds:
        return next((kind for kind in SCALE_KINDS if kind in kinds), state)
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
    quiet = _("No people since {time}: {why}.", time=since, why=in_words(camera.silence))
    return f"{_status_words(camera, clock)} {quiet}"


def _status_words(camera: CameraFacts, clock: Clock) -> str:
    state, estimate = camera.state, camera.estimate
    known = estimate is not None and bool(estimate.identifiable)
    doubts = [alert for alert in camera.alerts if alert.kind in MOVED_KINDS]
    if state == PoseState.DRIFTING and not camera.judged:
        words = _moved(camera, estimate, clock) if estimate and known else _alarmed(doubts)
        last = _("That is what is known last: the next people will tell how it stands now.")
        return f"{words} {last}"
    if estimate is not None and camera.judged and estimate.drifted:
        return _moved(camera, estimate, clock)
    if doubts:  # of a reference, or about a move whose size is not identifiable
        return _alarmed(doubts)
    if state == PoseState.UNSURE:
        return _(
            "Something changed: people walk on none of the paths that were learned. The camera was "
            "turned far, or people walk elsewhere; a look at its picture tells which."
        )
    if state == PoseState.UNCONNECTED:
        return _("Nobody has posted anybody's track for this camera yet.")
    if state == PoseState.UNCALIBRATED:
        return _(
            "The pose is not calibrated. It is estimated from the first tracks: see below, and "
            "confirm it if it looks right."
        )
    if state == PoseState.LEARNING or estimate is None or not camera.judged:
        return _waiting(camera)
    if state == PoseState.NO_DATA:
        return _("When it was last told, it stood where it should.")
    if state == PoseState.SUSPECTED:
        how = moved_words(estimate)
        share = f"{100 * estimate.moved:.0f} %"
        if not how:
            return _("It may have moved ({share}). The next people will tell.", share=share)
        if not estimate.tracks:
            return _(
                "It may have moved ({share}): it {how}. Another image or more tracks will show.",
                share=share,
                how=how,
            )
        return _(
            "It may have moved ({share}): it {how}. The next people will tell.",
            share=share,
            how=how,
        )
    if not estimate.tracks:
        at = clock.when(clock.of(estimate.to_s))
        sure = sure_words(estimate)
        return _("In its original position, by the image of {time}{sure}.", time=at, sure=sure)
    return _(
        "Standing where it should, as {n} people of the last {time} show{sure}.",
        n=estimate.tracks,
        time=duration(estimate.to_s - estimate.from_s),
        sure=sure_words(estimate),
    )


def _alarmed(doubts: Sequence[AlertRecord]) -> str:
    return _("It may not stand where it should: {why}.", why=in_words(doubts[0].reasons))


def _moved(camera: CameraFacts, estimate: EstimateRecord, clock: Clock) -> str:
    since = "" if estimate.drift_since is None else clock.when(estimate.drift_since)
    sure = sure_words(estimate)
    if any(alert.kind == AlertKind.LENS for alert in camera.alerts):
        if since:
            return _("The lens shows another angle of view since about {time}.", time=since)
        return _("The lens shows another angle of view.")
    if any(alert.kind == AlertKind.CLOCK for alert in camera.alerts):
        how = moved_words(estimate)
        if since:
            said = _("People seem to walk at another speed since about {time}", time=since)
        else:
            said = _("People seem to walk at another speed")
        if how:
            why = _("a wrong clock or frame rate looks like that, or the camera {how}", how=how)
        else:
            why = _("a wrong clock or frame rate looks like that")
        return f"{said}: {why}{sure}."
    words = moved_words(estimate, since)
    if words and set(estimate.drifted) & set(estimate.identifiable):
        return _("The camera {moved}{sure}.", moved=words, sure=sure)
    if since:
        return _(
            "The camera moved about {time}; the newest people cannot tell how far.", time=since
        )
    return _("The camera moved; the newest people cannot tell how far.")


def _waiting(camera: CameraFacts) -> str:
    if camera.state in (PoseState.OK, PoseState.NO_DATA):
        who = camera.answered_by or _("somebody")
        return _("Where it should be, as {name} said. The next people will tell.", name=who)
    if not camera.ready:
        return _("Learning: {n} of {wanted} people.", n=camera.learned, wanted=camera.wanted)
    return _("Waiting for people: too few have come to tell how it stands.")


def people_words(people: int, hours: int) -> str:
    """So many people; of how many hours, where they tell little of other times of day."""
    if not 0 < hours < _FEW_HOURS:
        return _n("{n} person", "{n} people", people)
    if hours == 1:
        return _n("{n} person of a single hour", "{n} people of a single hour", people)
    return _("{n} people of {hours} different hours", n=people, hours=hours)


def few_hours_words(counted: int, wanted: int, hours: int) -> str:
    """What people of a few hours leave unknown; empty while most are still to come."""
    if not 0 < hours < _FEW_HOURS or 2 * counted < wanted:
        return ""
    return _n(
        "The reference is of a single hour only, as of one morning: people of another time of day "
        "may walk elsewhere, and that may look as if something had changed. With more people "
        "(reference_tracks) it is of a whole day.",
        "The reference is of {n} hours only, as of one morning: people of another time of day "
        "may walk elsewhere, and that may look as if something had changed. With more people "
        "(reference_tracks) it is of a whole day.",
        hours,
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
    asked: bool = False,
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
        asked: whether a question about the image size of its tracks is open.
    """
    scaled = next((kind for kind in kinds if kind in SCALE_KINDS), None)
    if state == PoseState.DRIFTING and scaled is not None:
        return _(LINES[scaled])
    if kinds and kinds[0] == AlertKind.STALE:
        return _("its estimate fails or lacks tracks: the alert says why, and since when")
    if state == PoseState.UNCONNECTED:
        return _("nobody has posted tracks for it yet: its page says how")
    if asked:
        return _("a question about its tracks is open: its page asks it")
    if state == PoseState.UNCALIBRATED:
        return _("its pose is estimated from the first tracks; confirm it on its page")
    if state == PoseState.LEARNING and learned is not None:
        return _("learning what is usual: {n} of {wanted} people", n=learned, wanted=wanted)
    if state == PoseState.LEARNING:
        return _("waiting for people to tell how it stands now")
    if state == PoseState.UNSURE:
        return _(LINES[AlertKind.UNSURE])
    if state == PoseState.NO_DATA:
        time = duration(silent_s)
        return _("no people seen for {time}, longer than is usual here", time=time)
    if state == PoseState.OK:
        if judged:
            return _("standing still")
        return _("where it should be, as somebody said; the next people will tell")
    moved = drift_words(drift)
    if state == PoseState.SUSPECTED:
        return _("may have moved: {moved}", moved=moved) if moved else _("may have moved")
    if moved and not judged:
        return _("{moved} when it was last told", moved=moved)
    return moved or _("moved, but by how much is not told yet")


def page_flags(
    missing_parts: Sequence[Reason], attended_until: datetime | None, clock: Clock
) -> Sequence[str]:
    """Flags of a camera's page, beside those of its alerts."""
    found = [
        _("Without the {part}", part=str(lack.values["part"]).replace("_", " "))
        for lack in missing_parts
        if lack.code == ServiceCode.WITHOUT_PART
    ]
    if attended_until is not None:
        found.append(_("Maintenance until {time}", time=clock.when(attended_until)))
    return found


def page_alert_flags(alert: AlertRecord, group: AlertRecord | None, clock: Clock) -> Sequence[str]:
    """Flags of a camera's page, of an alert that fires."""
    found = []
    if alert.acknowledged_at is not None:
        found.append(_("Acknowledged by {name}", name=alert.acknowledged_by))
    if alert.silenced_until is not None and alert.is_silenced(clock.now):
        found.append(_("Silenced until {time}", time=clock.when(alert.silenced_until)))
    if group is not None:
        found.append(
            _(
                "One of {n} cameras of {tracker} at once",
                n=len(group.camera_ids or []),
                tracker=alert.track_source,
            )
        )
    return found


def fleet_flags(
    state: PoseState, alerts: Sequence[AlertRecord], attended_until: datetime | None, now: datetime
) -> tuple[str, ...]:
    """The flags of a camera's line in the fleet, of what needs a person most first."""
    flags = []
    if attended_until is not None:
        left = duration((attended_until - now).total_seconds())
        flags.append(_("maintenance for {time} more", time=left))
    if alerts:
        flags += fleet_alert_flags(alerts[0], now)
    elif state == PoseState.DRIFTING and attended_until is None:
        flags.append(_("no alert is open"))
    for alert in alerts:
        if alert.kind not in _SPOKEN_FOR.get(state, ()):
            flags.append(_("alert: {kind}", kind=inner(_(KINDS[alert.kind]))))
    return tuple(flags)


def fleet_alert_flags(alert: AlertRecord, now: datetime) -> tuple[str, ...]:
    """The flags of an alert in the fleet."""
    flags = []
    if alert.acknowledged_by is not None:
        flags.append(_("acknowledged by {name}", name=alert.acknowledged_by))
    elif alert.escalated_at is not None and alert.state == AlertState.FIRING:
        waits = duration((now - alert.opened_at).total_seconds())
        flags.append(_("escalated: nobody took it up in {time}", time=waits))
    if alert.silenced_until is not None and alert.is_silenced(now):
        left = duration((alert.silenced_until - now).total_seconds())
        flags.append(_("silenced for {time} more", time=left))
    if alert.group_id is not None:
        flags.append(_("with its tracker"))
    return tuple(flags)
