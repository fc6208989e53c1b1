"""`/ui/alerts`: all alerts in lines, chosen by the address, answered there, one or many at once."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from service.access.tokens import Caller
from service.alerts.alerts import list_alerts
from service.api.alerts import ChosenDep, cursor_after
from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.cameras.status import alert_since
from service.enums import AlertKind, AlertState, Severity, TokenScope
from service.pages.bulk import bulk_rule
from service.store import alerts, fleet, journal
from service.store.alerts import AlertRecord
from service.wording import alerts as alert_words
from service.wording.actions import ACTIONS
from service.wording.camera import fleet_alert_flags
from service.wording.language import N_, _
from service.wording.times import Clock

_A_PAGE = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertRow:
    """An alert in a line: what it is about by name, what it tells, since when, whose it is."""

    alert: AlertRecord
    name: str
    words: str
    since: datetime
    flags: tuple[str, ...]

    @property
    def fires(self) -> bool:
        """True until it has ended."""
        return self.alert.state == AlertState.FIRING

    @property
    def answered_apart(self) -> bool:
        """True if it is answered by itself, and not over or with its group."""
        return self.fires and self.alert.group_id is None


router = APIRouter(include_in_schema=False)


@router.get("/ui/alerts")
def show(
    request: Request,
    state: StateDep,
    session: ReadDep,
    chosen: ChosenDep,
    all_: Annotated[bool, Query(alias="all", description="those that have ended, too")] = False,
) -> HTMLResponse:
    """Alerts, newest first, members below their group; those that fire, unless others are asked."""
    newest = journal.newest_event_id(session)
    if chosen.state is None and not all_:
        chosen = replace(chosen, state=AlertState.FIRING)
    clock = Clock(now=datetime.now(UTC), zone=state.settings.zone)
    found = list_alerts(session, chosen, _A_PAGE + 1)
    shown = found[:_A_PAGE]
    names = dict(fleet.names(session, {a.camera_id for a in shown if a.camera_id is not None}))
    asked = [(k, v) for k, v in request.query_params.multi_items() if v and k != "cursor"]
    more = None
    if len(found) > _A_PAGE:
        more = urlencode([*asked, ("cursor", cursor_after(shown[-1]))])
    caller: Caller | None = request.state.caller
    return render(
        request,
        "alerts.html",
        rows=[_row(record, names, clock) for record in _below_their_groups(shown)],
        more=more,
        chips=_chips(asked),
        csv=_csv(asked, chosen.state),
        clock=clock,
        words=alert_words,
        action_words=ACTIONS,
        rule=bulk_rule(),
        operates=caller is None or caller.may(TokenScope.OPERATE),
        newest_event=newest,
        waiting=alerts.count_waiting(session, clock.now),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Chip:
    """A choice as a link to the page with it, or without it where it is `on`."""

    words: str
    query: str
    on: bool
    kind: AlertKind | None = None


def _chips(asked: Sequence[tuple[str, str]]) -> list[list[Chip]]:
    """The choices, in groups: those of kinds add up, of all others one holds."""
    one_of = [
        (
            (N_("Firing"), ()),
            (N_("Ended"), ("state", AlertState.RESOLVED)),
            (N_("All"), ("all", "true")),
        ),
        (
            (N_("Not acknowledged"), ("acknowledged", "false")),
            (N_("Acknowledged"), ("acknowledged", "true")),
        ),
        tuple((alert_words.SEVERITIES[each], ("severity", each)) for each in Severity),
    ]
    groups = []
    for group in one_of:
        names = {pair[0] for _, pair in group if pair}
        others = [pair for pair in asked if pair[0] not in names]
        chips = []
        for label, pair in group:
            on = pair in asked if pair else not any(name in names for name, _ in asked)
            query = others if on or not pair else [*others, pair]
            chips.append(Chip(words=_(label), query=urlencode(query), on=on))
        groups.append(chips)
    kinds = []
    for kind in AlertKind:
        pair = "kind", kind.value
        on = pair in asked
        query = [each for each in asked if each != pair] if on else [*asked, pair]
        kinds.append(
            Chip(words=_(alert_words.BADGES[kind]), query=urlencode(query), on=on, kind=kind)
        )
    return [*groups, kinds]


def _csv(asked: Sequence[tuple[str, str]], state: AlertState | None) -> str:
    """The query of the file that has what the page has."""
    kept = [pair for pair in asked if pair[0] not in ("all", "state")]
    return urlencode([("format", "csv"), *kept, *([("state", state)] if state else [])])


def _below_their_groups(records: Sequence[AlertRecord]) -> list[AlertRecord]:
    """The alerts in their order, but those for which a shown one speaks right below that."""
    places: dict[str | None, int] = {each.id: place for place, each in enumerate(records)}

    def order(alert: AlertRecord) -> tuple[int, bool]:
        return places.get(alert.group_id, places[alert.id]), alert.group_id is not None

    return sorted(records, key=order)


def _row(record: AlertRecord, names: dict[str, str], clock: Clock) -> AlertRow:
    return AlertRow(
        alert=record,
        name=alert_words.about_words(record, names),
        words=alert_words.alert_line(record),
        since=alert_since(record),
        flags=fleet_alert_flags(record, clock.now),
    )
