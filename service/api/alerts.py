"""`/alerts`: list, show, acknowledge, silence, resolve."""

from typing import Annotated

from fastapi import APIRouter, Query
from sqlalchemy.orm import Session

from service.alerts import alerts, silence
from service.api.alerts_schemas import (
    AcknowledgeBody,
    AlertDetail,
    AlertList,
    AlertOut,
    ResolveBody,
    SilenceBody,
)
from service.api.fields import Text
from service.api.middleware.dependencies import ActorDep, ReadDep, StateDep, WriteDep, name_of
from service.cameras import decisions
from service.enums import AlertState
from service.store.alerts import AlertFilter, AlertRecord

router = APIRouter(prefix="/alerts", tags=["alerts"])


@router.get("")
def list_all(
    session: ReadDep,
    state: AlertState | None = None,
    camera_id: Text | None = None,
    group_id: Text | None = None,
    acknowledged: bool | None = None,
    silenced: bool | None = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> AlertList:
    """Alerts, newest first."""
    wanted = AlertFilter(
        state=state,
        camera_id=camera_id,
        group_id=group_id,
        acknowledged=acknowledged,
        silenced=silenced,
    )
    records = alerts.list_alerts(session, wanted, limit)
    return AlertList(items=[AlertOut.from_record(record) for record in records])


@router.get("/{alert_id}")
def show(alert_id: str, session: ReadDep) -> AlertDetail:
    """An alert, and what was done with it."""
    return _with_acts(session, alerts.show_alert(session, alert_id))


@router.post("/{alert_id}/acknowledge")
def acknowledge(
    alert_id: str, session: WriteDep, actor: ActorDep, body: AcknowledgeBody | None = None
) -> AlertDetail:
    """Note who has seen an alert."""
    by = name_of(actor, None if body is None else body.by)
    return _with_acts(session, alerts.acknowledge_alert(session, alert_id, by))


@router.post("/{alert_id}/silence")
def silence_one(
    alert_id: str, body: SilenceBody, state: StateDep, session: WriteDep, actor: ActorDep
) -> AlertDetail:
    """Silence an alert until a time, in place of the silence it may have; null ends that."""
    record = silence.silence_alert(
        session, state.settings, alert_id, body.until, body.reason, name_of(actor, body.by)
    )
    return _with_acts(session, record)


@router.post("/{alert_id}/resolve")
def resolve(
    alert_id: str, body: ResolveBody, state: StateDep, session: WriteDep, actor: ActorDep
) -> AlertDetail:
    """End an alert with what came of it; `accepted` accepts the served pose, as `pose/accept`."""
    by = name_of(actor, body.by)
    record = decisions.resolve_alert(
        session, state.queue, state.settings, alert_id, body.outcome, body.note, by
    )
    return _with_acts(session, record)


def _with_acts(session: Session, record: AlertRecord) -> AlertDetail:
    return AlertDetail.from_records(record, alerts.activity_of_alert(session, record.id))
