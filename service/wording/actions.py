"""The acts, each by one word: on buttons, for one and for many, and once they are done."""

from dataclasses import dataclass

from service.enums import Action, AlertKind, Answer
from service.store.alerts import MEMBER
from service.wording.language import N_


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionWords:
    """An act on a button for `one` and `many`, before what it was `done` with, and its sense."""

    one: str
    many: str
    done: str
    means: str


ACTIONS: dict[Answer | Action, ActionWords] = {
    Answer.PUT_BACK: ActionWords(
        one=N_("It was put back"),
        many=N_("They were put back"),
        done=N_("Put back"),
        means=N_("The camera is back in its original position. The learned reference is kept."),
    ),
    Answer.ACCEPTED: ActionWords(
        one=N_("Keep the new aim"),
        many=N_("Keep the new aims"),
        done=N_("New aim kept"),
        means=N_("The current position becomes the reference and is relearned."),
    ),
    Answer.FIXED: ActionWords(
        one=N_("Fixed"),
        many=N_("Fixed"),
        done=N_("Fixed"),
        means=N_("The fault in clock, tracker or view is fixed. Monitoring continues."),
    ),
    Answer.FALSE_ALARM: ActionWords(
        one=N_("False alarm"),
        many=N_("False alarms"),
        done=N_("False alarm"),
        means=N_("Nothing was wrong. Monitoring continues."),
    ),
    Action.ACKNOWLEDGE: ActionWords(
        one=N_("Acknowledge"),
        many=N_("Acknowledge"),
        done=N_("Acknowledged"),
        means=N_("Shows others that you are working on the alert. It stays open."),
    ),
    Action.SILENCE: ActionWords(
        one=N_("Silence…"),
        many=N_("Silence…"),
        done=N_("Silenced"),
        means=N_("No notifications about the alert for a time that you choose. It stays open."),
    ),
    Action.MAINTENANCE: ActionWords(
        one=N_("Plan maintenance…"),
        many=N_("Plan maintenance…"),
        done=N_("Maintenance planned"),
        means=N_("While people work on the camera, nothing is estimated or learned."),
    ),
    Action.RESET: ActionWords(
        one=N_("Learn anew at the old aim"),
        many=N_("Learn anew at the old aims"),
        done=N_("Being learned anew"),
        means=N_("The camera has not moved, but people walk differently now: learn it again."),
    ),
    Action.TAG: ActionWords(
        one=N_("Tag…"),
        many=N_("Tag…"),
        done=N_("Tagged"),
        means=N_("A location, such as campus/north/gate, and search words, such as outdoor."),
    ),
    Action.UNDO: ActionWords(
        one=N_("Undo"),
        many=N_("Undo"),
        done=N_("Undone"),
        means=N_("Reverts the last answer about the camera, if it is recent."),
    ),
}
# After "1 of 5" and "2 of 5": what those are that do not take what the others take.
CHOSEN_AS: dict[AlertKind | str, tuple[str, str]] = {
    AlertKind.DRIFT: (N_("moved"), N_("moved")),
    AlertKind.CLOCK: (N_("is a clock fault"), N_("are clock faults")),
    AlertKind.LENS: (N_("has another lens"), N_("have other lenses")),
    AlertKind.UNSURE: (N_("is unsure"), N_("are unsure")),
    AlertKind.NO_DATA: (N_("is silent"), N_("are silent")),
    AlertKind.STALE: (N_("is not looked at"), N_("are not looked at")),
    AlertKind.TRACKER: (N_("has another tracker"), N_("have another tracker")),
    AlertKind.PICTURE: (N_("has a faulty picture"), N_("have faulty pictures")),
    AlertKind.MANY_MOVED: (N_("is a tracker's"), N_("are trackers'")),
    AlertKind.MANY_SILENT: (N_("is a tracker's"), N_("are trackers'")),
    MEMBER: (N_("is answered with its tracker"), N_("are answered with their tracker")),
    "": (N_("has no open alert"), N_("have no open alert")),
}
