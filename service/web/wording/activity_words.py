"""What was done at a camera, as sentences."""

from service.kinds import Act, Outcome
from service.views.camera_activity import Deed
from service.web.wording.camera_words import KINDS, OUTCOMES, Clock

# By a person; of those that the service does by itself, what happened.
_DONE = {
    Act.CAMERA_REGISTERED: "registered the camera",
    Act.CAMERA_CHANGED: "changed what is said of the camera",
    Act.CAMERA_REMOVED: "removed the camera",
    Act.POSE_ACCEPTED: "accepted the new pose as the prior pose",
    Act.POSE_PUT_BACK: "said that the camera is back at its prior pose",
    Act.POSE_FALSE_ALARM: "said that the camera never moved",
    Act.REFERENCE_RESET: "had the camera learned anew at its prior pose",
    Act.SOURCE_USED: "said whose tracks count; the reference is learned anew",
    Act.SOURCE_REMOVED: "removed a source of tracks with its tracks",
    Act.ALERT_ACKNOWLEDGED: "acknowledged {alert}",
    Act.ALERT_SILENCED: "silenced {alert} until {until}",
    Act.ALERT_SILENCE_ENDED: "ended the silence of {alert}",
    Act.ALERT_RESOLVED: "closed {alert}: {outcome}",
    Act.MAINTENANCE_PLANNED: "planned maintenance until {until}",
    Act.MAINTENANCE_CHANGED: "changed the maintenance: until {until}",
    Act.MAINTENANCE_ENDED: "ended the maintenance that was planned until {until}",
    Act.MAINTENANCE_WITHDRAWN: "took back the maintenance that was planned until {until}",
    Act.TRAINING_REQUESTED: "asked for a training",
    Act.SNAPSHOT_KEPT: "put a new still image",
    Act.SNAPSHOT_REMOVED: "deleted the still image",
}
_HAPPENED = {
    Act.ALERT_OPENED: "Alert: {kind}",
    Act.ALERT_ESCALATED: "It grew: {alert} is critical now",
    Act.REFERENCE_LEARNED: "The reference was learned",
    Act.MAINTENANCE_OVER: "The maintenance is over",
    Act.TRAINING_SUCCEEDED: "A training ended: its model is in use",
    Act.TRAINING_FAILED: "A training failed",
    Act.TRAINING_CANCELLED: "A training was cancelled",
}
_UNASKED = (Outcome.CLEARED, Outcome.CAMERA_REMOVED)
_BY_ITSELF = {
    Act.ALERT_RESOLVED: "The alert “{kind}” ended: {outcome}",
    Act.ALERT_SILENCE_ENDED: "The silence of {alert} ended",
    Act.SOURCE_USED: "Another source's tracks count; the reference is learned anew",
}


def deed_words(deed: Deed, clock: Clock) -> str:
    """Who did what, as a sentence without the time."""
    kind = "" if deed.kind is None else KINDS[deed.kind].lower()
    words = {
        "kind": kind,
        "alert": f"the alert “{kind}”",
        "until": "" if deed.until is None else clock.when(deed.until),
        "outcome": "" if deed.outcome is None else OUTCOMES[deed.outcome],
    }
    if deed.what in _HAPPENED:
        text = _HAPPENED[deed.what]
    elif deed.what in _BY_ITSELF and deed.by is None and deed.outcome in (None, *_UNASKED):
        text = _BY_ITSELF[deed.what]
    else:
        text = f"{{who}} {_DONE.get(deed.what, deed.what)}"
    sentence = f"{text.format(who=deed.by or 'Someone', **words)}."
    return f"{sentence} {deed.note}" if deed.note else sentence
