"""The acts, each by one word: on buttons, for one and for many, and once they are done."""

from dataclasses import dataclass

from service.enums import Act, AlertKind, Answer
from service.store.alerts import MEMBER


@dataclass(frozen=True, slots=True, kw_only=True)
class ActWords:
    """An act on a button for `one` and for `many`, and before what it was `done` with."""

    one: str
    many: str
    done: str


ACTS: dict[Answer | Act, ActWords] = {
    Answer.PUT_BACK: ActWords(one="It was put back", many="They were put back", done="Put back"),
    Answer.ACCEPTED: ActWords(
        one="Keep the new aim", many="Keep the new aims", done="New aim kept"
    ),
    Answer.MENDED: ActWords(one="It was put right", many="They were put right", done="Put right"),
    Answer.FALSE_ALARM: ActWords(one="False alarm", many="False alarms", done="False alarm"),
    Act.ACKNOWLEDGE: ActWords(one="Acknowledge", many="Acknowledge", done="Acknowledged"),
    Act.SILENCE: ActWords(one="Silence…", many="Silence…", done="Silenced"),
    Act.MAINTENANCE: ActWords(
        one="Plan maintenance…", many="Plan maintenance…", done="Maintenance planned"
    ),
    Act.RESET: ActWords(
        one="Learn anew at the old aim",
        many="Learn anew at the old aims",
        done="Being learned anew",
    ),
    Act.TAG: ActWords(one="Tag…", many="Tag…", done="Tagged"),
    Act.UNDO: ActWords(one="Undo", many="Undo", done="Undone"),
}
# After "1 of 5" and "2 of 5": what those are that do not take what the others take.
CHOSEN_AS: dict[AlertKind | str, tuple[str, str]] = {
    AlertKind.DRIFT: ("moved", "moved"),
    AlertKind.CLOCK: ("is a clock fault", "are clock faults"),
    AlertKind.UNSURE: ("is unsure", "are unsure"),
    AlertKind.NO_DATA: ("is silent", "are silent"),
    AlertKind.STALE: ("is not looked at", "are not looked at"),
    AlertKind.TRACKER: ("has another tracker", "have another tracker"),
    AlertKind.PICTURE: ("has a faulty picture", "have faulty pictures"),
    AlertKind.MANY_MOVED: ("is a tracker's", "are trackers'"),
    AlertKind.MANY_SILENT: ("is a tracker's", "are trackers'"),
    MEMBER: ("is answered with its tracker", "are answered with their tracker"),
    "": ("has no open alert", "have no open alert"),
}
