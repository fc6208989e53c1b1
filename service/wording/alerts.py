"""Alerts in words, as pages and an Alertmanager show them, and entries of the log as sentences."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from service.enums import Activity, AlertKind, AlertSource, Answer, Outcome, Severity
from service.store.alerts import AlertRecord
from service.store.estimates import EstimateRecord
from service.store.journal import ActivityRecord
from service.wording.actions import ACTIONS
from service.wording.language import N_, _, inner
from service.wording.moves import NAMES, offset_words
from service.wording.reasons import in_words, percent
from service.wording.times import Clock, duration

KINDS = {
    AlertKind.DRIFT: N_("The camera moved"),
    AlertKind.CLOCK: N_("The clock looks wrong"),
    AlertKind.LENS: N_("The lens was changed"),
    AlertKind.UNSURE: N_("Something changed"),
    AlertKind.NO_DATA: N_("No people come"),
    AlertKind.STALE: N_("Its estimate fails or lacks tracks"),
    AlertKind.TRACKER: N_("Another tracker posts"),
    AlertKind.PICTURE: N_("Its picture is not as it should be"),
    AlertKind.MANY_MOVED: N_("Cameras of a tracker moved together"),
    AlertKind.MANY_SILENT: N_("Cameras of a tracker fell silent together"),
}
# In a line of a list, where an alert has no numbers that tell it.
LINES = {
    AlertKind.CLOCK: N_(
        "people seem to walk too fast or too slowly: its clock or frame rate looks wrong"
    ),
    AlertKind.LENS: N_("it shows another angle of view: zoomed, or its picture is cut otherwise"),
    AlertKind.UNSURE: N_(
        "people walk on none of the learned paths: turned far, or they walk elsewhere"
    ),
}
# The kinds in a word, for a badge.
BADGES = {
    AlertKind.DRIFT: N_("Moved"),
    AlertKind.CLOCK: N_("Clock"),
    AlertKind.LENS: N_("Lens"),
    AlertKind.UNSURE: N_("Unsure"),
    AlertKind.NO_DATA: N_("No people"),
    AlertKind.STALE: N_("Not looked at"),
    AlertKind.TRACKER: N_("Tracker"),
    AlertKind.PICTURE: N_("Picture"),
    AlertKind.MANY_MOVED: N_("Many moved"),
    AlertKind.MANY_SILENT: N_("Many silent"),
}
SEVERITIES = {Severity.CRITICAL: N_("Critical"), Severity.WARNING: N_("Warning")}
OUTCOMES = {
    Outcome.PUT_BACK: N_("put back"),
    Outcome.ACCEPTED: N_("new aim kept"),
    Outcome.FIXED: N_("fixed"),
    Outcome.RELEARNED: N_("learned anew"),
    Outcome.FALSE_ALARM: N_("false alarm"),
    Outcome.CLEARED: N_("ended by itself"),
    Outcome.CAMERA_REMOVED: N_("camera removed"),
}
_NOTHING_WRONG = N_("Nothing was wrong. The next people tell.")
_OF_POSE = {
    Answer.PUT_BACK: N_("It stands as it did. What was learned there stays; the next people tell."),
    Answer.ACCEPTED: N_("Where it looks now is right from now on, and is learned anew."),
    Answer.FALSE_ALARM: N_("It did not move. The next people tell."),
}
# What a person may answer, and what it comes to.
_ANSWERS = {
    AlertKind.DRIFT: _OF_POSE,
    AlertKind.UNSURE: _OF_POSE,
    AlertKind.CLOCK: {
        Answer.FIXED: N_("Clock and frame rate are as they should be; the next people tell."),
        Answer.FALSE_ALARM: _NOTHING_WRONG,
    },
    AlertKind.LENS: {
        Answer.FIXED: N_("Zoom and picture size are as they should be; the next people tell."),
        Answer.FALSE_ALARM: _NOTHING_WRONG,
    },
    AlertKind.NO_DATA: {
        Answer.FIXED: N_("Camera or tracker was repaired. Should it go on, another alert opens."),
        Answer.FALSE_ALARM: N_("Nobody was to come: such a silence counts as usual from now on."),
    },
    AlertKind.STALE: {
        Answer.FIXED: N_("Should it go on, another alert opens."),
        Answer.FALSE_ALARM: N_("Nothing was wrong. Should it go on, another alert opens."),
    },
    AlertKind.TRACKER: {
        Answer.FIXED: N_("The other one is off: only one tracker posts from now on."),
        Answer.FALSE_ALARM: N_("Both may post: the one that counts counts, without an alert."),
    },
    AlertKind.PICTURE: {
        Answer.FIXED: N_("The view is free and sharp. Should it go on, another alert opens."),
        Answer.FALSE_ALARM: N_("Nothing was wrong. Later pictures are compared with the next one."),
    },
    AlertKind.MANY_MOVED: {
        Answer.FIXED: N_(
            "The tracker, its clock or frame rate is as it should be. Its cameras are monitored "
            "again; cameras that turned keep their alerts."
        ),
        Answer.FALSE_ALARM: N_(
            "Nothing was wrong. Its cameras are monitored again; cameras that turned keep their "
            "alerts."
        ),
    },
    AlertKind.MANY_SILENT: {
        Answer.FIXED: N_("The tracker was repaired. Should it go on, another alert opens."),
        Answer.FALSE_ALARM: N_("Nobody was to come before any of its cameras."),
    },
}
# After "You" or a name, of an answer that can be taken back.
ANSWERED = {
    Activity.POSE_ACCEPTED: N_("kept the new aim"),
    Activity.POSE_PUT_BACK: N_("said that it was put back"),
    Activity.POSE_FIXED: N_("reported it as fixed"),
    Activity.POSE_FALSE_ALARM: N_("called it a false alarm"),
    Activity.REFERENCE_RESET: N_("had it learned anew at the old aim"),
}
# Notes on alerts that ended by themselves.
TRACKS_COME_AGAIN = N_("tracks come again")
ESTIMATED_AGAIN = N_("its tracks are looked at again")
BRIDGE_WORKS = N_("the bridge works again")
ONE_SOURCE_POSTS = N_("only one source posts")
_TOLD_AS = {
    AlertKind.DRIFT: N_("it is told as drift now"),
    AlertKind.CLOCK: N_("it is told as clock now"),
    AlertKind.LENS: N_("it is told as lens now"),
    AlertKind.UNSURE: N_("it is told as unsure now"),
}
# A test alert's description.
TEST_ENDS = "This is a test of surefoot; it ends by itself."
# By a person; of those that the service does by itself, what happened.
_DONE = {
    Activity.CAMERA_REGISTERED: N_("{who} registered the camera"),
    Activity.CAMERA_CHANGED: N_("{who} changed what is said of the camera"),
    Activity.CAMERA_DESCRIBED: N_("{who} changed its {fields}"),
    Activity.CAMERA_REMOVED: N_("{who} removed the camera"),
    Activity.POSE_CONFIRMED: N_("{who} confirmed the proposed pose"),
    Activity.POSE_ACCEPTED: N_("{who} kept the new aim"),
    Activity.POSE_PUT_BACK: N_("{who} said that it was put back"),
    Activity.POSE_FIXED: N_("{who} reported it as fixed"),
    Activity.POSE_FALSE_ALARM: N_("{who} called it a false alarm"),
    Activity.POSE_UNDONE: N_("{who} undid the last answer"),
    Activity.REFERENCE_RESET: N_("{who} had it learned anew at the old aim"),
    Activity.SOURCE_USED: N_("{who} said whose tracks count; the reference is learned anew"),
    Activity.SOURCE_REMOVED: N_("{who} removed a source of tracks with its tracks"),
    Activity.ALERT_ACKNOWLEDGED: N_("{who} acknowledged {alert}"),
    Activity.ALERT_GIVEN_BACK: N_("{who} gave {alert} back: it waits for a person again"),
    Activity.ALERT_SILENCED: N_("{who} silenced {alert} until {until}"),
    Activity.ALERT_SILENCE_ENDED: N_("{who} ended the silence of {alert}"),
    Activity.ALERT_RESOLVED: N_("{who} closed {alert}: {outcome}"),
    Activity.ALERT_REOPENED: N_("{who} opened {alert} again"),
    Activity.MAINTENANCE_PLANNED: N_("{who} planned maintenance until {until}"),
    Activity.MAINTENANCE_CHANGED: N_("{who} changed the maintenance: until {until}"),
    Activity.MAINTENANCE_ENDED: N_("{who} ended the maintenance that was planned until {until}"),
    Activity.MAINTENANCE_WITHDRAWN: N_(
        "{who} took back the maintenance that was planned until {until}"
    ),
    Activity.TRAINING_REQUESTED: N_("{who} asked for a training"),
    Activity.SNAPSHOT_KEPT: N_("{who} put a new still image"),
    Activity.SNAPSHOT_REMOVED: N_("{who} deleted the still image"),
    Activity.PLAN_KEPT: N_("{who} put a plan of the site"),
    Activity.PLAN_REMOVED: N_("{who} deleted the plan of the site"),
    Activity.ZONES_DRAWN: N_("{who} drew the zones anew"),
    Activity.HANDOVER_GIVEN: N_("{who} handed over"),
    Activity.HANDOVER_TAKEN: N_("{who} took over"),
}
_HAPPENED = {
    Activity.ALERT_OPENED: N_("Alert: {kind}"),
    Activity.ALERT_GREW: N_("It grew: {alert} is critical now"),
    Activity.ALERT_ESCALATED: N_("Nobody took up {alert}: it was told once more"),
    Activity.ALERT_MAILED: N_("A mail told that nobody took up {alert}"),
    Activity.REFERENCE_LEARNED: N_("The reference was learned"),
    Activity.MAINTENANCE_OVER: N_("The maintenance is over"),
    Activity.TRAINING_SUCCEEDED: N_("A training ended: its model is in use"),
    Activity.TRAINING_FAILED: N_("A training failed"),
    Activity.TRAINING_CANCELLED: N_("A training was cancelled"),
}
_LEAST_WEIGHT = 0.01  # of a hypothesis that is worth a line
_UNASKED = (Outcome.CLEARED, Outcome.CAMERA_REMOVED)
_BY_ITSELF = {
    Activity.ALERT_RESOLVED: N_("The alert “{kind}” ended: {outcome}"),
    Activity.ALERT_SILENCE_ENDED: N_("The silence of {alert} ended"),
    Activity.SOURCE_USED: N_("Another source's tracks count; the reference is learned anew"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceRow:
    """A part of an alert's evidence: what it is, a share of 1 to be drawn, and in words."""

    label: str
    share: float
    words: str


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerWords:
    """An answer to an alert as its button says it, what it comes to, and once it is `done`."""

    outcome: Answer
    label: str
    consequence: str
    done: str


def alert_line(alert: AlertRecord) -> str:
    """What an alert tells of, in a line of a list."""
    if alert.kind in LINES:
        return _(LINES[alert.kind])
    if alert.kind == AlertKind.DRIFT and (moved := offset_words(alert.drift)):
        return moved
    return in_words(alert.reasons)


def about_words(alert: AlertRecord, names: Mapping[str, str]) -> str:
    """The camera that an alert is about by its name, or how many of which tracker."""
    if alert.camera_id is None:
        return _(
            "{n} cameras of {tracker}", n=len(alert.camera_ids or ()), tracker=alert.track_source
        )
    return names.get(alert.camera_id, alert.camera_id)


def done_words(alert: AlertRecord, now: datetime) -> str:
    """What was done about an alert, by whom, after how long: "put back by Ada after 3 hours"."""

    def after(at: datetime) -> str:
        return duration((at - alert.opened_at).total_seconds())

    if alert.resolved_at is not None and alert.outcome is not None:
        said = {"outcome": _(OUTCOMES[alert.outcome]), "time": after(alert.resolved_at)}
        if alert.resolved_by:
            return _("{outcome} by {name} after {time}", name=alert.resolved_by, **said)
        return _("{outcome} after {time}", **said)
    if alert.acknowledged_at is not None:
        return _(
            "acknowledged by {name} after {time}, open for {all}",
            name=alert.acknowledged_by,
            time=after(alert.acknowledged_at),
            all=after(now),
        )
    if alert.is_silenced(now):
        return _("silenced by {name}, open for {time}", name=alert.silenced_by, time=after(now))
    return _("nobody took it up in {time}", time=after(now))


def note_words(alert: AlertRecord) -> str:
    """The note on an alert; the service's own in the language, a person's as it was typed."""
    note = alert.note or ""
    return _(note) if alert.outcome == Outcome.CLEARED else note


def answers(kind: AlertKind) -> list[AnswerWords]:
    """What a person may answer to an alert of a kind, that it was real first."""
    return [
        AnswerWords(
            outcome=answer,
            label=_(ACTIONS[answer].one),
            consequence=_(comes_to),
            done=_(ACTIONS[answer].done),
        )
        for answer, comes_to in _ANSWERS[kind].items()
    ]


def why_words(alert: AlertRecord, estimate: EstimateRecord | None, clock: Clock) -> str:
    """Why an alert is believed, in one sentence without a statistic."""
    if alert.source == AlertSource.ESTIMATE and estimate is not None:
        if alert.kind == AlertKind.DRIFT:
            return _(
                "Where the last {n} people walk, and how fast, fits a camera that has moved; that "
                "it still stands where it did is {share} likely.",
                n=estimate.tracks,
                share=percent(1 - estimate.moved),
            )
        if alert.kind == AlertKind.CLOCK:
            return _(
                "The last {n} people keep to their paths, but all of them seem to walk too fast or "
                "too slowly. A clock or a frame rate does that by itself; a camera seldom rises "
                "without turning.",
                n=estimate.tracks,
            )
        if alert.kind == AlertKind.LENS:
            return _(
                "Where the last {n} people walk, and how fast, fits a camera that stands and shows "
                "another angle of view, better than any that moved.",
                n=estimate.tracks,
            )
        if alert.kind == AlertKind.UNSURE:
            return _(
                "Of the last {n} people, next to nobody keeps to a path that was learned.",
                n=estimate.tracks,
            )
    words = in_words(alert.reasons, clock.zone)
    return f"{words[:1].upper()}{words[1:]}." if words else ""


def evidence_rows(evidence: Mapping[str, Any]) -> list[EvidenceRow]:
    """What may have moved, as likely as it is, and how far tests are beyond their levels."""
    rows = []
    for each in evidence["hypotheses"]:
        if each["weight"] >= _LEAST_WEIGHT:
            named = ", ".join(_(NAMES[name]) for name in each["moved"])
            what = _("{numbers} moved", numbers=named) if named else _("it stands")
            rows.append(
                EvidenceRow(
                    label=what[0].upper() + what[1:] + (_(", far") if each["far"] else ""),
                    share=each["weight"],
                    words=f"{100 * each['weight']:.0f} %",
                )
            )
    for name, label in (("chart", N_("Drift chart")), ("creep", N_("Slow turn"))):
        test = evidence[name]
        if test is not None:
            ratio = test["statistic"] / test["level"]
            words = _("{ratio:.1f} of its alarm level", ratio=ratio)
            rows.append(EvidenceRow(label=_(label), share=min(ratio / 2, 1.0), words=words))
    return rows


def source_change(name: str, last: str | None) -> str:
    """A change of the source that counts: "new instead of old"."""
    return f"{name} instead of {last}"


def fired_as(kind: AlertKind) -> str:
    """The note on an alert that ended since another kind tells the same."""
    return _TOLD_AS[kind]


def alert_summary(
    kind: str, camera_id: str | None, camera_ids: Sequence[str] | None, track_source: str | None
) -> str:
    """An alert in a line: "no data: camera north-1", "drift: 4 cameras of bytetrack"."""
    whose = f"camera {camera_id}"
    if camera_id is None and track_source:
        whose = f"{len(camera_ids or ())} cameras of {track_source}"
    return f"{kind.replace('_', ' ')}: {whose}"


def is_action(entry: ActivityRecord) -> bool:
    """True of what a person did to cameras and alerts."""
    return entry.what in _DONE and not _by_itself(entry)


def _by_itself(entry: ActivityRecord) -> bool:
    nobody = entry.by is None and entry.outcome in (None, *_UNASKED)
    return entry.what in _BY_ITSELF and nobody


def entry_words(entry: ActivityRecord, clock: Clock) -> str:
    """A sentence without the time: who did what."""
    kind = "" if entry.kind is None else inner(_(KINDS[entry.kind]))
    words = {
        "kind": kind,
        "alert": _("the alert “{kind}”", kind=kind),
        "until": "" if entry.until is None else clock.when(entry.until),
        "outcome": "" if entry.outcome is None else _(OUTCOMES[entry.outcome]),
        "fields": ", ".join(entry.details.get("fields", ())),
        "who": entry.by or _("Someone"),
    }
    if entry.what in _HAPPENED:
        sentence = _(_HAPPENED[entry.what], **words)
    elif _by_itself(entry):
        sentence = _(_BY_ITSELF[entry.what], **words)
    else:
        done = _DONE.get(entry.what, f"{{who}} {entry.what}")
        sentence = _(done, **words)
    note = _(entry.note) if entry.by is None and entry.note else entry.note
    return f"{sentence}. {note}" if note else f"{sentence}."
