"""`/`: the fleet page, every camera in a line, those that need a person first; and its parts."""

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse
from markupsafe import Markup
from sqlalchemy.orm import Session

from models.monitoring.drift import Drift
from service.access.tokens import Caller
from service.api.middleware.dependencies import AppState, ReadDep, StateDep
from service.api.middleware.pages import HEADERS, render
from service.api.schemas import Text
from service.cameras.reference_views import reference_views
from service.cameras.status import CameraStatus, alert_since, camera_statuses, waits
from service.enums import PoseState, TokenScope
from service.pages.bulk import bulk_rule
from service.pages.drawings.sparkline import sparkline
from service.pages.fleet_index import (
    Entry,
    attended_until,
    entry_of,
    fleet_index,
    index_document,
)
from service.references import drift_limits, wanted_tracks
from service.reports.handover import Handover, last_handovers
from service.settings import Settings
from service.store import alerts, fleet, journal
from service.store.alerts import AlertRecord
from service.store.estimates import EstimateRecord
from service.store.fleet import Label
from service.store.trainings import TrainingRecord
from service.wording import alerts as alert_words
from service.wording.actions import ACTIONS
from service.wording.camera import (
    STATES,
    fleet_alert_flags,
    fleet_flags,
    fleet_line,
)
from service.wording.language import _
from service.wording.reasons import group_in_words
from service.wording.times import Clock

_HISTORY = 24  # estimates of a sparkline
PAGE = 50  # rows at once: more are neither read nor laid out in no time
# No reference can be learned there yet.
_WITHOUT_REFERENCE = (PoseState.UNCONNECTED, PoseState.UNCALIBRATED)


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetRow:
    """A camera in one line, as it is `now`.

    `history` has the drift of its newest estimates in units of the limits, oldest first, None where
    nothing was identifiable. `drift` has only what is sure. `learned` and `wanted` are people of
    the reference being learned; None where it is ready, or nobody has posted anybody.
    """

    now: datetime
    label: Label
    status: CameraStatus
    drift: Drift | None
    history: tuple[float | None, ...]
    learned: int | None
    wanted: int
    unfinished: TrainingRecord | None

    @property
    def id(self) -> str:
        """The camera's id."""
        return self.status.camera_id

    @property
    def state(self) -> PoseState:
        """The camera's state."""
        return self.status.state

    @property
    def entry(self) -> Entry:
        """The camera as it stands in the index."""
        return entry_of(self.status, self.label, self.now)

    @property
    def name(self) -> str:
        """The camera's name."""
        return self.label.name

    @property
    def words(self) -> str:
        """The camera's doings, in one line."""
        now_s = self.now.timestamp()
        return fleet_line(
            self.state,
            [alert.kind for alert in self.status.alerts],
            self.drift,
            judged=self.status.judged,
            learned=self.learned,
            wanted=self.wanted,
            silent_s=now_s - (self.status.last_track_s or now_s),
            asked=self.status.in_question,
        )

    @property
    def flags(self) -> tuple[str, ...]:
        """Whatever else is to be known of it at a glance."""
        until = attended_until(self.status, self.now)
        return fleet_flags(self.state, self.status.alerts, until, self.now)

    @property
    def training(self) -> int | None:
        """Progress of the training that waits or is under way, in percent."""
        record = self.unfinished
        if record is None:
            return None
        return round(100 * record.step / record.steps) if record.steps else 0

    @property
    def share(self) -> int | None:
        """Progress of the reference, in percent; None where none is being learned."""
        return None if self.learned is None else round(100 * self.learned / self.wanted)

    @property
    def spark(self) -> Markup:
        """Its drift of late, drawn."""
        return sparkline(self.history)


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetGroup:
    """An alert that blames a tracker or its clock for what many cameras show, by id and name.

    It `waits` as long as nobody has taken it up.
    """

    alert: AlertRecord
    cameras: tuple[tuple[str, str], ...]
    waits: bool

    @property
    def since(self) -> datetime:
        """Since when it is so, as far as is known."""
        return alert_since(self.alert)


def list_fleet(
    session: Session, settings: Settings, ids: Collection[str] | None = None
) -> list[FleetRow]:
    """All cameras, or some, those first that need a person; a dozen statements for all of them."""
    now = datetime.now(UTC)
    statuses = camera_statuses(session, settings, ids)
    labels = fleet.labels(session, ids)
    history = fleet.drift_history(session, ids, _HISTORY, drift_limits(settings))
    references = reference_views(session, settings, statuses)
    trainings = fleet.unfinished_trainings(session, ids)
    rows = [
        FleetRow(
            now=now,
            label=labels[camera_id],
            status=each,
            drift=_sure_drift(each.estimate) if each.state != PoseState.LEARNING else None,
            history=tuple(history[camera_id]),
            learned=None
            if references[camera_id].ready or each.state in _WITHOUT_REFERENCE
            else references[camera_id].counted,
            wanted=wanted_tracks(each.reference, settings),
            unfinished=trainings.get(camera_id),
        )
        for camera_id, each in statuses.items()
        if camera_id in labels
    ]
    return sorted(rows, key=lambda row: row.entry.order)


def list_groups(session: Session) -> list[FleetGroup]:
    """The alerts that blame trackers, the newest first."""
    now, groups = datetime.now(UTC), fleet.firing_groups(session)
    wanted = {camera_id for group in groups for camera_id in group.camera_ids or []}
    names = dict(fleet.names(session, wanted)) if wanted else {}
    return [
        FleetGroup(
            alert=group,
            cameras=tuple((i, names[i]) for i in group.camera_ids or [] if i in names),
            waits=waits(group, now),
        )
        for group in groups
    ]


def _sure_drift(estimate: EstimateRecord | None) -> Drift | None:
    """The drift with what is sure enough to be said: beyond 2 sd, or found to drift."""
    if estimate is None or not estimate.identifiable:
        return None
    drift, drifted = estimate.drift, estimate.drifted
    known = {name: drift.of(name) for name in drift.identifiable}
    sure = [name for name, (by, sd) in known.items() if name in drifted or abs(by) > 2 * sd]
    return replace(drift, identifiable=tuple(sure))


router = APIRouter(include_in_schema=False)


@router.get("/")
def show(
    request: Request,
    state: StateDep,
    session: ReadDep,
    q: Annotated[Text, Query(max_length=200)] = "",
    wanted: Annotated[list[Text] | None, Query(alias="state", max_length=20)] = None,
    site: Annotated[Text, Query(max_length=200)] = "",
    tag: Annotated[list[Text] | None, Query(max_length=20)] = None,
) -> HTMLResponse:
    """The cameras that are asked for, what needs a person first: a page of them, and an index."""
    # What happens from here on is an event that the page asks for, even if it is in here too.
    newest = journal.newest_event_id(session)
    index = fleet_index(session, state.settings)
    count = Counter(entry.shown for entry in index)
    words = q.casefold().split()
    found = [entry for entry in index if entry.fits(wanted or (), words, site, tag or ())]
    groups = list_groups(session)
    return render(
        request,
        "fleet.html",
        newest_event=newest,
        counts=[(each, _(word), count[each]) for each, word in STATES.items()],
        waiting=alerts.count_waiting(session, datetime.now(UTC)),
        index=index_document(index),
        rows=list_fleet(session, state.settings, [entry.id for entry in found[:PAGE]]),
        page_size=PAGE,
        groups=groups,
        handovers=_handovers(session),
        action_words=ACTIONS,
        rule=bulk_rule(),
        **_words(request, state),
    )


@router.get("/ui/fleet/index")
def index(state: StateDep, session: ReadDep) -> JSONResponse:
    """All cameras in a few numbers each, as the page's script keeps them."""
    document = index_document(fleet_index(session, state.settings))
    return JSONResponse(document, headers=HEADERS)


@router.get("/ui/fleet/rows")
def rows(
    request: Request,
    state: StateDep,
    session: ReadDep,
    ids: Annotated[Text | None, Query(max_length=20_000)] = None,
) -> HTMLResponse:
    """The rows of some cameras, or of all; one that is gone has none."""
    wanted = None if ids is None else set(ids.split(","))
    found = list_fleet(session, state.settings, wanted)
    return render(request, "_fleet_rows.html", rows=found, **_words(request, state))


@router.get("/ui/fleet/banners")
def banners(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """The handovers that nobody has taken, and the alerts that blame trackers."""
    return render(
        request,
        "_fleet_banners.html",
        groups=list_groups(session),
        handovers=_handovers(session),
        **_words(request, state),
    )


def _handovers(session: Session) -> list[Handover]:
    """Those of the last that nobody has taken over, the oldest first."""
    return [each for each in last_handovers(session) if each.taken_at is None][::-1]


def _words(request: Request, state: AppState) -> dict[str, Any]:
    """The words that the templates say times, states and alerts with, and what is offered."""
    caller: Caller | None = request.state.caller
    return dict(
        registers=caller is None or caller.may(TokenScope.ADMIN),
        operates=caller is None or caller.may(TokenScope.OPERATE),
        words=alert_words,
        clock=Clock(now=datetime.now(UTC), zone=state.settings.zone),
        states=STATES,
        in_words=group_in_words,
        flags_of=fleet_alert_flags,
    )
