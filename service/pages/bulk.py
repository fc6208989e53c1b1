"""The one rule of which acts are offered for what is chosen on a page, of alerts or of cameras."""

from collections.abc import Iterable
from typing import Any

from service.enums import Action, AlertKind
from service.store.alerts import MEMBER, MEMBER_KINDS, AlertRecord, answers_of
from service.wording.actions import ACTIONS, CHOSEN_AS
from service.wording.language import _

_OF_ALERTS = (Action.ACKNOWLEDGE, Action.SILENCE)


def kinds_of(alerts: Iterable[AlertRecord]) -> str:
    """The kinds of open alerts by which it is known what can be done, most urgent first.

    Of those that belong to a group, only that: the group is answered, and they with it.
    """
    kinds = [MEMBER if each.group_id is not None else each.kind for each in alerts]
    return " ".join(dict.fromkeys(kinds))


def bulk_rule() -> dict[str, Any]:
    """What a page's script offers by: of each kind what it `takes` and its words, and of acts.

    Whatever stands in no `takes` is an act on cameras, of which each takes it.
    """
    takes: dict[str, list[str]] = {"": [], MEMBER: []}
    takes |= {kind: [*answers_of(kind), *_OF_ALERTS] for kind in AlertKind}
    for kind in takes:
        if kind not in MEMBER_KINDS:
            takes[kind].append(Action.MAINTENANCE)
    return {
        "kinds": {
            kind: {"takes": takes[kind], "words": [_(each) for each in words]}
            for kind, words in CHOSEN_AS.items()
        },
        "done": {act: _(words.done) for act, words in ACTIONS.items()},
    }
