"""Alerts in words, as pages and an Alertmanager show them, and entries of the log as sentences."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from service.enums import Activity, AlertKind, AlertSource, Answer, Outcome
from service.store.alerts import AlertRecord
from service.store.estimates import EstimateRecord
from service.store.journal import ActivityRecord
from service.wording.acts import ACTS
from service.wording.moves import NAMES, offset_words
from service.wording.reasons import in_words, percent
from service.wording.times import Clock, duration

KINDS = {
    AlertKind.DRIFT: "The camera moved",
    AlertKind.CLOCK: "The clock looks wrong",
    AlertKind.UNSURE: "Something changed",
    AlertKind.NO_DATA: "No people come",
    AlertKind.STALE: "Its estimate fails or lacks tracks",
    AlertKind.TRACKER: "Another tracker posts",
    AlertKind.PICTURE: "Its picture is not as it should be",
    AlertKind.MANY_MOVED: "Cameras of a tracker moved together",
    AlertKind.MANY_SILENT: "Cameras of a tracker fell silent together",
}
# The same in a word, for a badge.
BADGES = {
    AlertKind.DRIFT: "Moved",
    AlertKind.CLOCK: "Clock",
    AlertKind.UNSURE: "Unsure",
    AlertKind.NO_DATA: "No people",
    AlertKind.STALE: "Not looked at",
    AlertKind.TRACKER: "Tracker",
    AlertKind.PICTURE: "Picture",
    AlertKind.MANY_MOVED: "Many moved",
    AlertKind.MANY_SILENT: "Many silent",
}
OUTCOMES = {
    Outcome.PUT_BACK: "put back",
    Outcome.ACCEPTED: "new aim kept",
    Outcome.MENDED: "put right",
    Outcome.RELEARNED: "learned anew",
    Outcome.FALSE_ALARM: "false alarm",
    Outcome.CLEARED: "ended by itself",
    Outcome.CAMERA_REMOVED: "camera removed",
}
_OF_POSE = {
    Answer.PUT_BACK: "It stands as it did. What was learned there stays; the next people tell.",
    Answer.ACCEPTED: "Where it looks now is right from now on, and is learned anew.",
    Answer.FALSE_ALARM: "It did not move. The next people tell.",
}
_AGAIN = "Should it go on, another alert opens."
# What a person may answer, and what it comes to.
_ANSWERS = {
    AlertKind.DRIFT: _OF_POSE,
    AlertKind.UNSURE: _OF_POSE,
    AlertKind.CLOCK: {
        Answer.MENDED: "Clock and frame rate are as they should be; the next people tell.",
        Answer.FALSE_ALARM: "Nothing was wrong. The next people tell.",
    },
    AlertKind.NO_DATA: {
        Answer.MENDED: f"Camera or tracker was repaired. {_AGAIN}",
        Answer.FALSE_ALARM: "Nobody was to come: such a silence counts as usual from now on.",
    },
    AlertKind.STALE: {Answer.MENDED: _AGAIN, Answer.FALSE_ALARM: f"Nothing was wrong. {_AGAIN}"},
    AlertKind.TRACKER: {
        Answer.MENDED: "The other one is off: only one tracker posts from now on.",
        Answer.FALSE_ALARM: "Both may post: the one that counts counts, without an alert.",
    },
    AlertKind.PICTURE: {
        Answer.MENDED: f"The view is free and sharp. {_AGAIN}",
        Answer.FALSE_ALARM: "Nothing was wrong. Later pictures are compared with the next one.",
    },
    AlertKind.MANY_MOVED: {
        Answer.MENDED: "The tracker, its clock or frame rate is as it should be. At each of its "
        "cameras the next people tell.",
        Answer.FALSE_ALARM: "Nothing was wrong. At each of its cameras the next people tell.",
    },
    AlertKind.MANY_SILENT: {
        Answer.MENDED: f"The tracker was repaired. {_AGAIN}",
        Answer.FALSE_ALARM: "Nobody was to come before any of its cameras.",
    },
}
# Notes on alerts that ended by themselves.
TRACKS_COME_AGAIN = "tracks come again"
ESTIMATED_AGAIN = "it is looked at again"
ONE_SOURCE_POSTS = "only one source posts"
# A test alert's description.
TEST_ENDS = "This is a test of surefoot; it ends by itself."
# By a person, after their name; of those that the service does by itself, what happened.
DONE = {
    Activity.CAMERA_REGISTERED: "registered the camera",
    Activity.CAMERA_CHANGED: "changed what is said of the camera",
    Activity.CAMERA_DESCRIBED: "changed its {fields}",
    Activity.CAMERA_REMOVED: "removed the camera",
    Activity.POSE_AGREED: "agreed to the pose that people told",
    Activity.POSE_ACCEPTED: "kept the new aim",
    Activity.POSE_PUT_BACK: "said that it was put back",
    Activity.POSE_MENDED: "said that it was put right",
    Activity.POSE_FALSE_ALARM: "called it a false alarm",
    Activity.POSE_UNDONE: "undid the last answer",
    Activity.REFERENCE_RESET: "had it learned anew at the old aim",
    Activity.SOURCE_USED: "said whose tracks count; the reference is learned anew",
    Activity.SOURCE_REMOVED: "removed a source of tracks with its tracks",
    Activity.ALERT_ACKNOWLEDGED: "acknowledged {alert}",
    Activity.ALERT_SILENCED: "silenced {alert} until {until}",
    Activity.ALERT_SILENCE_ENDED: "ended the silence of {alert}",
    Activity.ALERT_RESOLVED: "closed {alert}: {outcome}",
    Activity.ALERT_REOPENED: "opened {alert} again",
    Activity.MAINTENANCE_PLANNED: "planned maintenance until {until}",
    Activity.MAINTENANCE_CHANGED: "changed the maintenance: until {until}",
    Activity.MAINTENANCE_ENDED: "ended the maintenance that was planned until {until}",
    Activity.MAINTENANCE_WITHDRAWN: "took back the maintenance that was planned until {until}",
    Activity.TRAINING_REQUESTED: "asked for a training",
    Activity.SNAPSHOT_KEPT: "put a new still image",
    Activity.SNAPSHOT_REMOVED: "deleted the still image",
    Activity.PLAN_KEPT: "put a plan of the site",
    Activity.PLAN_REMOVED: "deleted the plan of the site",
    Activity.ZONES_DRAWN: "drew the zones anew",
    Activity.HANDOVER_GIVEN: "handed over",
    Activity.HANDOVER_TAKEN: "took over",
}
_HAPPENED = {
    Activity.ALERT_OPENED: "Alert: {kind}",
    Activity.ALERT_GREW: "It grew: {alert} is critical now",
    Activity.ALERT_ESCALATED: "Nobody took up {alert}: it was told once more",
    Activity.ALERT_MAILED: "A mail told that nobody took up {alert}",
    Activity.REFERENCE_LEARNED: "The reference was learned",
    Activity.MAINTENANCE_OVER: "The maintenance is over",
    Activity.TRAINING_SUCCEEDED: "A training ended: its model is in use",
    Activity.TRAINING_FAILED: "A training failed",
    Activity.TRAINING_CANCELLED: "A training was cancelled",
}
_LEAST_WEIGHT = 0.01  # of a hypothesis that is worth a line
_UNASKED = (Outcome.CLEARED, Outcome.CAMERA_REMOVED)
_BY_ITSELF = {
    Activity.ALERT_RESOLVED: "The alert “{kind}” ended: {outcome}",
    Activity.ALERT_SILENCE_ENDED: "The silence of {alert} ended",
    Activity.SOURCE_USED: "Another source's tracks count; the reference is learned anew",
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
    if alert.kind == AlertKind.CLOCK:
        return "people seem to walk too fast or too slowly: its clock or frame rate looks wrong"
    if alert.kind == AlertKind.UNSURE:
        return "people walk on none of the learned paths: turned far, or they walk elsewhere"
    if alert.kind == AlertKind.DRIFT and (moved := offset_words(alert.drift)):
        return moved
    return in_words(alert.reasons)


def about_words(alert: AlertRecord, names: Mapping[str, str]) -> str:
    """The camera that an alert is about by its name, or how many of which tracker."""
    if alert.camera_id is None:
        return f"{len(alert.camera_ids or ())} cameras of {alert.track_source}"
    return names.get(alert.camera_id, alert.camera_id)


def done_words(alert: AlertRecord, now: datetime) -> str:
    """What was done about an alert, by whom, after how long: "put back by Ada after 3 hours"."""

    def after(at: datetime) -> str:
        return duration((at - alert.opened_at).total_seconds())

    if alert.resolved_at is not None and alert.outcome is not None:
        by = f" by {alert.resolved_by}" if alert.resolved_by else ""
        return f"{OUTCOMES[alert.outcome]}{by} after {after(alert.resolved_at)}"
    if alert.acknowledged_at is not None:
        seen = f"acknowledged by {alert.acknowledged_by} after {after(alert.acknowledged_at)}"
        return f"{seen}, open for {after(now)}"
    if alert.is_silenced(now):
        return f"silenced by {alert.silenced_by}, open for {after(now)}"
    return f"nobody took it up in {after(now)}"


def answers(kind: AlertKind) -> list[AnswerWords]:
    """What a person may answer to an alert of a kind, that it was real first."""
    return [
        AnswerWords(
            outcome=answer, label=ACTS[answer].one, consequence=comes_to, done=ACTS[answer].done
        )
        for answer, comes_to in _ANSWERS[kind].items()
    ]


def why_words(alert: AlertRecord, estimate: EstimateRecord | None, clock: Clock) -> str:
    """Why an alert is believed, in one sentence without a statistic."""
    if alert.source == AlertSource.ESTIMATE and estimate is not None:
        people = f"the last {estimate.tracks} people"
        if alert.kind == AlertKind.DRIFT:
            return (
                f"Where {people} walk, and how fast, fits a camera that has moved; that it still "
                f"stands where it did is {percent(1 - estimate.moved)} likely."
            )
        if alert.kind == AlertKind.CLOCK:
            return (
                f"{people[0].upper()}{people[1:]} keep to their paths, but all of them seem to "
                "walk too fast or too slowly. A clock or a frame rate does that by itself; a "
                "camera seldom rises without turning."
            )
        if alert.kind == AlertKind.UNSURE:
            return f"Of {people}, next to nobody keeps to a path that was learned."
    words = in_words(alert.reasons, clock.zone)
    return f"{words[:1].upper()}{words[1:]}." if words else ""


def evidence_rows(evidence: Mapping[str, Any]) -> list[EvidenceRow]:
    """What may have moved, as likely as it is, and how far tests are beyond their levels."""
    rows = []
    for each in evidence["hypotheses"]:
        if each["weight"] >= _LEAST_WEIGHT:
            named = [NAMES[name] for name in each["moved"]]
            what = f"{', '.join(named)} moved" if named else "it stands"
            rows.append(
                EvidenceRow(
                    label=what[0].upper() + what[1:] + (", far" if each["far"] else ""),
                    share=each["weight"],
                    words=f"{100 * each['weight']:.0f} %",
                )
            )
    for name, label in (("chart", "Drift chart"), ("creep", "Slow turn")):
        test = evidence[name]
        if test is not None:
            ratio = test["statistic"] / test["level"]
            rows.append(
                EvidenceRow(
                    label=label, share=min(ratio / 2, 1.0), words=f"{ratio:.1f} of its alarm level"
                )
            )
    return rows


def source_change(name: str, last: str | None) -> str:
    """A change of the source that counts: "new instead of old"."""
    return f"{name} instead of {last}"


def fired_as(kind: AlertKind) -> str:
    """The note on an alert that ended since another kind tells the same."""
    return f"it is told as {kind} now"


def alert_summary(
    kind: str, camera_id: str | None, camera_ids: Sequence[str] | None, track_source: str | None
) -> str:
    """An alert in a line: "no data: camera north-1", "drift: 4 cameras of bytetrack"."""
    whose = f"camera {camera_id}"
    if camera_id is None and track_source:
        whose = f"{len(camera_ids or ())} cameras of {track_source}"
    return f"{kind.replace('_', ' ')}: {whose}"


def is_act(entry: ActivityRecord) -> bool:
    """True of what a person did to cameras and alerts."""
    return entry.what in DONE and not _by_itself(entry)


def _by_itself(entry: ActivityRecord) -> bool:
    nobody = entry.by is None and entry.outcome in (None, *_UNASKED)
    return entry.what in _BY_ITSELF and nobody


def entry_words(entry: ActivityRecord, clock: Clock) -> str:
    """A sentence without the time: who did what."""
    kind = "" if entry.kind is None else KINDS[entry.kind].lower()
    words = {
        "kind": kind,
        "alert": f"the alert “{kind}”",
        "until": "" if entry.until is None else clock.when(entry.until),
        "outcome": "" if entry.outcome is None else OUTCOMES[entry.outcome],
        "fields": ", ".join(entry.details.get("fields", ())),
    }
    if entry.what in _HAPPENED:
        text = _HAPPENED[entry.what]
    elif _by_itself(entry):
        text = _BY_ITSELF[entry.what]
    else:
        text = f"{{who}} {DONE.get(entry.what, entry.what)}"
    sentence = f"{text.format(who=entry.by or 'Someone', **words)}."
    return f"{sentence} {entry.note}" if entry.note else sentence
