"""`/alerts`: list, show, acknowledge, silence, resolve."""

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Self

from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import RedirectResponse, Response
from pydantic import BaseModel, BeforeValidator, Field
from sqlalchemy.orm import Session

from service.alerts import alerts, silence
from service.api.ignored import NamingRoute
from service.api.middleware.dependencies import ReadDep, StateDep, WriteDep
from service.api.schemas import (
    POSE_FIELDS,
    AlternativeOut,
    Body,
    Moment,
    Out,
    ReasonCode,
    ReasonValues,
    SinceOut,
    Text,
    Who,
)
from service.api.spreadsheet import CSV, FileFormat, csv_lines, saved_as
from service.cameras import decisions
from service.degrees import in_degrees
from service.enums import (
    AlertActivity,
    AlertKind,
    AlertState,
    Answer,
    Outcome,
    Severity,
    ZoneOn,
)
from service.errors import MalformedError
from service.notifications.outbox import alert_body, json_time
from service.store.access import name_in
from service.store.alerts import AlertFilter, AlertRecord
from service.wording.times import from_seconds


class AcknowledgeBody(Body):
    """Who looks after the alert; `acknowledged` false gives it back to whoever takes it up."""

    by: Who | None = None
    acknowledged: bool = True


class SilenceBody(Body):
    """Until when nobody is to be woken by the alert, and why; null ends a silence."""

    until: Moment | None
    reason: str | None = Field(None, max_length=2000)
    by: Who | None = None


class ResolveBody(Body):
    """How an alert ended."""

    outcome: Answer
    note: str | None = Field(None, max_length=2000)
    by: Who | None = None


class AlertOut(BaseModel):
    """An alert; a group's has no `camera_id` but `camera_ids`.

    `acknowledged` and `silenced` are flags of a firing alert, not states.
    """

    id: str
    camera_id: str | None
    kind: AlertKind
    state: AlertState
    severity: Severity
    reason: str
    reason_code: ReasonCode | None
    reason_values: ReasonValues
    drift: dict[str, Any]
    opened_at: datetime
    changed_at: datetime | None
    since: SinceOut
    updated_at: datetime
    acknowledged: bool = False
    acknowledged_by: str | None
    acknowledged_at: datetime | None
    escalated_at: datetime | None
    silenced: bool = False
    silenced_until: datetime | None
    silence_reason: str | None
    silenced_by: str | None
    resolved_at: datetime | None
    resolved_by: str | None
    outcome: Outcome | None
    note: str | None
    track_source: str | None
    poster_id: str = Field(
        description="token that posts under `track_source`; empty if access control is off"
    )
    camera_ids: list[str] | None
    group_id: str | None


# Of an activity, `alert.silenced` say, the act alone.
Action = Annotated[AlertActivity, BeforeValidator(lambda what: what.partition(".")[2])]


class ActionOut(Out):
    """What somebody did with an alert; without a name, the service by itself."""

    at: datetime
    action: Action = Field(validation_alias="what")
    by: str | None
    until: datetime | None
    outcome: Outcome | None
    note: str | None


class MovedZoneOut(BaseModel):
    """A zone of a camera that moved, by the newest estimate, as long as nobody mends its drawing.

    `overlap` is the share that still lies where it was drawn, `in_view` the share in the picture.
    Of a line, by the people of that estimate: how many `crossed` it where it should lie now, how
    many of them it `missed` where it was drawn, and its `false_counts` there; null of an area.
    """

    id: str
    on: ZoneOn
    overlap: float
    in_view: float
    crossed: int | None
    missed: int | None
    false_counts: int | None


class CorrectedZonesOut(BaseModel):
    """Where zones are as they should lie now, in the form that they came in, and what to do."""

    path: str
    format: str | None
    how: str


class AlertDetail(AlertOut):
    """An alert, what its move is to zones, and what was done with it, oldest first."""

    zones: list[MovedZoneOut] | None
    corrected_zones: CorrectedZonesOut | None
    acts: list[ActionOut] = []


class AlertList(BaseModel):
    """Alerts, newest first; `next_cursor` leads to older ones."""

    items: list[AlertOut]
    next_cursor: str | None


class OffsetOut(BaseModel):
    """A pose less the prior pose."""

    height_m: float
    tilt_deg: float
    roll_deg: float
    heading_deg: float


class OffsetSdOut(BaseModel):
    """Standard deviations of an offset; null where nothing tells the number, as pictures height."""

    height_m: float | None
    tilt_deg: float
    roll_deg: float
    heading_deg: float


class HypothesisOut(BaseModel):
    """What may have moved, near or far: how likely that is, and the offset if it is so."""

    moved: list[str]
    far: bool
    weight: float
    offset: OffsetOut


class StatisticOut(BaseModel):
    """A test's statistic and the level that it alarms beyond."""

    statistic: float
    level: float


class ChartOut(StatisticOut):
    """Of the drift chart: it is of so many walking groups."""

    walking_groups: int


class EvidenceOut(BaseModel):
    """What the newest estimate behind an alert was by: statistics, and nothing about a person.

    `offset` is the estimate before any hypothesis is weighed; `prior_loss_sd` how much worse people
    fit the learned paths at the prior pose than there, in standard errors.
    """

    tracks: int
    walking_groups: int
    from_: datetime = Field(serialization_alias="from")
    to: datetime
    moved: float
    hypotheses: list[HypothesisOut]
    offset: OffsetOut
    offset_sd: OffsetSdOut
    registered: bool
    prior_loss_sd: float
    alternatives: list[AlternativeOut]
    chart: ChartOut | None
    creep: StatisticOut | None

    @classmethod
    def from_value(cls, evidence: Mapping[str, Any]) -> Self:
        """The body of stored evidence."""
        body = in_degrees(evidence)
        for each in body["hypotheses"]:
            each["moved"] = [POSE_FIELDS[name] for name in each["moved"]]
        times = {"from_": from_seconds(body["from_s"]), "to": from_seconds(body["to_s"])}
        return cls.model_validate(body | times)


def cursor_after(record: AlertRecord) -> str:
    """What leads to the alerts that were opened before one."""
    return f"{json_time(record.opened_at)}~{record.id}"


def _read_cursor(cursor: str) -> tuple[datetime, str]:
    at, _, alert_id = cursor.partition("~")
    try:
        opened_at = datetime.fromisoformat(at)
        if not alert_id or opened_at.tzinfo is None:
            raise ValueError
    except ValueError:
        reason = f"the next_cursor of a page before is needed, got {cursor!r:.80}"
        raise MalformedError.of_field("cursor", reason) from None
    return opened_at, alert_id


def chosen_alerts(
    state: AlertState | None = None,
    kind: Annotated[list[AlertKind] | None, Query(description="one or several")] = None,
    severity: Severity | None = None,
    camera_id: Text | None = None,
    group_id: Text | None = None,
    acknowledged: bool | None = None,
    silenced: bool | None = None,
    from_: Annotated[Moment | None, Query(alias="from", description="opened at or after")] = None,
    to: Annotated[Moment | None, Query(description="opened before")] = None,
    cursor: Annotated[Text | None, Query(description="`next_cursor` of the page before")] = None,
) -> AlertFilter:
    """The choice of alerts that a query says, of the API as of the page."""
    return AlertFilter(
        state=state,
        kinds=kind or None,
        severity=severity,
        camera_id=camera_id,
        group_id=group_id,
        acknowledged=acknowledged,
        silenced=silenced,
        opened_from=from_,
        opened_to=to,
        before=None if cursor is None else _read_cursor(cursor),
    )


ChosenDep = Annotated[AlertFilter, Depends(chosen_alerts)]
_COLUMNS = (
    *("id", "camera_id", "kind", "state", "severity", "reason", "opened_at", "changed_at"),
    *("acknowledged_by", "acknowledged_at", "escalated_at", "silenced_until", "silenced_by"),
    *("resolved_at", "resolved_by", "outcome", "note", "track_source", "group_id"),
)
_MOST_LINES = 10_000
router = APIRouter(prefix="/alerts", tags=["alerts"], route_class=NamingRoute)


@router.get("", response_model=AlertList, responses={200: {"content": {CSV: {}}}})
def list_alerts(
    request: Request,
    session: ReadDep,
    chosen: ChosenDep,
    format_: Annotated[
        FileFormat | None, Query(alias="format", description="a file for a spreadsheet")
    ] = None,
    limit: Annotated[int | None, Query(ge=1, le=10_000, description="1,000 of JSON")] = None,
) -> AlertList | Response:
    """List the alerts, newest first.

    A page has 100 by default, a CSV file 10,000. A browser is redirected to the page of alerts.
    """
    if format_ == FileFormat.CSV:
        found = map(alert_body, alerts.list_alerts(session, chosen, limit or _MOST_LINES))
        lines = csv_lines([_COLUMNS, *([body[name] for name in _COLUMNS] for body in found)])
        return Response(lines, media_type=CSV, headers=saved_as("alerts.csv"))
    if "text/html" in request.headers.get("accept", ""):
        query = f"?{request.url.query}" if request.url.query else ""
        return RedirectResponse(f"/ui/alerts{query}", status_code=303)
    wanted = min(limit or 100, 1000)
    records = alerts.list_alerts(session, chosen, wanted + 1)
    page = records[:wanted]
    return AlertList.model_validate(
        {
            "items": [alert_body(record) for record in page],
            "next_cursor": cursor_after(page[-1]) if len(records) > wanted else None,
        }
    )


@router.get("/{alert_id}")
def get_alert(alert_id: str, session: ReadDep) -> AlertDetail:
    """Get an alert with the actions on it."""
    return _with_actions(session, alerts.show_alert(session, alert_id))


@router.get("/{alert_id}/evidence")
def get_alert_evidence(alert_id: str, session: ReadDep) -> EvidenceOut:
    """Get the evidence of an alert.

    It comes from the newest estimate that supports the alert.
    """
    return EvidenceOut.from_value(alerts.evidence_of_alert(session, alert_id))


@router.post("/{alert_id}/acknowledge")
def acknowledge_alert(
    alert_id: str, session: WriteDep, body: AcknowledgeBody | None = None
) -> AlertDetail:
    """Acknowledge an alert.

    `acknowledged` false takes the acknowledgement back.
    """
    said = body or AcknowledgeBody()
    by = name_in(session, said.by)
    record = alerts.acknowledge_alert(session, alert_id, by, acknowledged=said.acknowledged)
    return _with_actions(session, record)


@router.post("/{alert_id}/silence")
def silence_alert(
    alert_id: str, body: SilenceBody, state: StateDep, session: WriteDep
) -> AlertDetail:
    """Silence an alert until a time.

    The new end replaces an earlier one; null ends the silence.
    """
    record = silence.silence_alert(
        session, state.settings, alert_id, body.until, body.reason, name_in(session, body.by)
    )
    return _with_actions(session, record)


@router.post("/{alert_id}/resolve")
def resolve_alert(
    alert_id: str, body: ResolveBody, state: StateDep, session: WriteDep
) -> AlertDetail:
    """Resolve an alert with an outcome.

    `accepted` accepts the served pose, as `pose/accept` does.
    """
    by = name_in(session, body.by)
    record = decisions.resolve_alert(
        session, state.queue, state.settings, alert_id, body.outcome, body.note, by
    )
    return _with_actions(session, record)


def _with_actions(session: Session, record: AlertRecord) -> AlertDetail:
    acts = alerts.activity_of_alert(session, record.id)
    return AlertDetail.model_validate({**alert_body(record), "acts": acts})
