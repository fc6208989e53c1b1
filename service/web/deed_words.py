"""What was done at a camera, as sentences."""

from service.recalibration.deeds import Deed
from service.web.camera_words import KINDS, OUTCOMES, Clock

# By a person; of those that the service does by itself, what happened.
_DONE = {
    "camera.registered": "registered the camera",
    "camera.changed": "changed what is said of the camera",
    "camera.removed": "removed the camera",
    "pose.accepted": "accepted the new pose as the prior pose",
    "pose.put_back": "said that the camera is back at its prior pose",
    "pose.false_alarm": "said that the camera never moved",
    "reference.reset": "had the camera learned anew at its prior pose",
    "source.used": "said whose tracks count; the reference is learned anew",
    "source.removed": "removed a source of tracks with its tracks",
    "alert.acknowledged": "acknowledged {alert}",
    "alert.silenced": "silenced {alert} until {until}",
    "alert.silence_ended": "ended the silence of {alert}",
    "alert.resolved": "closed {alert}: {outcome}",
    "maintenance.planned": "planned maintenance until {until}",
    "maintenance.changed": "changed the maintenance: until {until}",
    "maintenance.ended": "ended the maintenance that was planned until {until}",
    "maintenance.withdrawn": "took back the maintenance that was planned until {until}",
    "training.requested": "asked for a training",
    "snapshot.kept": "put a new still image",
    "snapshot.removed": "deleted the still image",
}
_HAPPENED = {
    "alert.opened": "Alert: {kind}",
    "alert.escalated": "It grew: {alert} is critical now",
    "reference.learned": "The reference was learned",
    "maintenance.over": "The maintenance is over",
    "training.succeeded": "A training ended: its model is in use",
    "training.failed": "A training failed",
    "training.cancelled": "A training was cancelled",
}
_UNASKED = ("cleared", "camera_removed")
_BY_ITSELF = {
    "alert.resolved": "The alert “{kind}” ended: {outcome}",
    "alert.silence_ended": "The silence of {alert} ended",
    "source.used": "Another source's tracks count; the reference is learned anew",
}


def deed_words(deed: Deed, clock: Clock) -> str:
    """Who did what, as a sentence without the time."""
    kind = KINDS.get(deed.kind or "", deed.kind or "").lower()
    words = {
        "kind": kind,
        "alert": f"the alert “{kind}”",
        "until": "" if deed.until is None else clock.when(deed.until),
        "outcome": OUTCOMES.get(deed.outcome or "", deed.outcome or ""),
    }
    if deed.what in _HAPPENED:
        text = _HAPPENED[deed.what]
    elif deed.what in _BY_ITSELF and deed.by is None and deed.outcome in (None, *_UNASKED):
        text = _BY_ITSELF[deed.what]
    else:
        text = f"{{who}} {_DONE.get(deed.what, deed.what)}"
    sentence = f"{text.format(who=deed.by or 'Someone', **words)}."
    return f"{sentence} {deed.note}" if deed.note else sentence
